"""Reads a recording with the mcap and Rerun packages and prints what they found, one fact a line."""
import sys

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
import rerun

with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    summary = reader.get_summary()
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        count = summary.statistics.channel_message_counts.get(channel.id, 0)
        print("channel", channel.topic, schema.name, count)
    decoded = {}
    for _, channel, _, message in reader.iter_decoded_messages():
        decoded[channel.topic] = decoded.get(channel.topic, 0) + 1
        if channel.topic == "/tick":
            last = message
    for topic, count in decoded.items():
        print("decoded", topic, count)
    print("last_tick", last.tick)

stream = rerun.RecordingStream("trepan")
stream.save(sys.argv[2])
stream.log_file_from_path(sys.argv[1])
stream.flush()
