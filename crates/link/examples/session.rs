//! Records 60 s of a 1 kHz session through a ring, cuts the file, reads both, and prints sizes and
//! losses.
//!
//! `cargo run -p trepan-link --example session [FILE.mcap]`

use std::error::Error;
use std::path::PathBuf;
use trepan_geometry::{Pose, Vec3, Wrench};
use trepan_link::wire::{CollisionRecord, EventRecord, SessionHeader, TickRecord};
use trepan_link::{Recorder, Recording, queue};

const TICKS: u64 = 60_000;

fn main() -> Result<(), Box<dyn Error>> {
    let path =
        std::env::args_os().nth(1).map_or_else(|| std::env::temp_dir().join("trepan-session.mcap"), PathBuf::from);
    let header = SessionHeader { app: "example".into(), case: "circle".into(), ..SessionHeader::default() };
    let mut recorder = Recorder::create(&path, &header)?;

    let (mut sender, mut receiver) = queue::bounded(4096);
    let haptic_loop = std::thread::spawn(move || {
        for number in 0..TICKS {
            while !sender.send(tick(number)) {
                std::thread::yield_now();
            }
        }
    });
    while !(receiver.is_abandoned() && receiver.waiting() == 0) {
        let Some(record) = receiver.receive() else {
            std::thread::yield_now();
            continue;
        };
        recorder.tick(&record)?;
        if record.tick.is_multiple_of(16) {
            recorder.collision(&CollisionRecord { seq: record.tick / 16, tick: record.tick, ..Default::default() })?;
        }
        if record.tick == TICKS / 2 {
            let (kind, text) = ("warning".to_owned(), "half of the time is over".to_owned());
            recorder.event(&EventRecord { tick: record.tick, time_ms: record.time_ms, kind, text })?;
        }
    }
    haptic_loop.join().map_err(|_| "the haptic loop panicked")?;
    recorder.finish()?;

    let bytes = std::fs::read(&path)?;
    println!("{}: {:.1} MB, {} B per tick", path.display(), bytes.len() as f64 * 1e-6, bytes.len() as u64 / TICKS);
    for share in [1.0, 0.6] {
        let length = (bytes.len() as f64 * share) as usize;
        let read = Recording::of_bytes(&bytes[..length], &path)?;
        let same = read.ticks.iter().all(|t| t.wrench.force.to_array() == tick(t.tick).wrench.force.to_array());
        println!(
            "first {:3.0} %: {} ticks, {} collisions, {} events, damaged: {}, forces the same: {same}",
            share * 100.0,
            read.ticks.len(),
            read.collisions.len(),
            read.events.len(),
            read.damage.is_some()
        );
    }
    Ok(())
}

/// A tool that circles at 1 Hz and presses with 1 N.
fn tick(number: u64) -> TickRecord {
    let angle = number as f32 * core::f32::consts::TAU / 1000.0;
    let out = Vec3::new(angle.cos(), angle.sin(), 0.0);
    TickRecord {
        tick: number,
        time_ms: number as f64,
        device: Pose::from_translation(out * 20.0),
        proxy: Pose::from_translation(out * 20.5),
        wrench: Wrench { force: out, torque: Vec3::ZERO },
        ..TickRecord::default()
    }
}
