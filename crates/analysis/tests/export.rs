//! What `tests/test_export.py` cannot make: recordings of other programs and orders, and faults of
//! SQL.

use anyhow::Result;
use std::path::Path;
use trepan_analysis::export::export;
use trepan_analysis::query::Database;
use trepan_analysis::study::simulate::write_recording;
use trepan_link::Recorder;
use trepan_link::wire::{EventRecord, SecondRecord, SessionHeader, TickRecord};

/// Rows of a query as CSV.
fn csv(tables: &Path, sql: &str) -> Result<String> {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("rows.csv");
    Database::open(tables)?.csv(sql, &file)?;
    Ok(std::fs::read_to_string(file)?)
}

#[test]
fn a_second_hand_that_is_recorded_late_is_paired_by_number_and_texts_lose_their_paths() {
    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (folder.path().join("a.mcap"), folder.path().join("tables"));
    let header = SessionHeader { case: "Lovelace".into(), ..SessionHeader::default() };
    let mut recorder = Recorder::create(&file, &header).unwrap();
    // The second hand's record is 1000 ticks behind in the file, and every tenth is missing.
    for tick in 1..=30_000 {
        recorder.tick(&TickRecord { tick, time_ms: tick as f64, ..TickRecord::default() }).unwrap();
        if tick > 1000 && tick % 10 != 0 {
            let tick = tick - 1000;
            recorder.second(&SecondRecord { tick, depth_mm: tick as f32, ..SecondRecord::default() }).unwrap();
        }
    }
    let text = "cannot read /home/Ada Lovelace/head.nii at 3 mm/s".into();
    recorder.event(&EventRecord { tick: 0, time_ms: 0.0, kind: "warning".into(), text }).unwrap();
    recorder.finish().unwrap();
    let exported = export(&file, &out).unwrap();
    assert!(exported.warnings.len() == 1 && exported.warnings[0].contains("no scores.csv"), "{exported:?}");
    let sql =
        "select count(*), count(second_depth_mm), sum(case when second_depth_mm <> tick then 1 else 0 end) from ticks";
    assert_eq!(csv(&out, sql).unwrap().lines().nth(1), Some("30000,26100,0"));
    assert_eq!(csv(&out, "select text from events").unwrap(), "text\ncannot read (path)\n");
    assert!(!csv(&out, "select * from cases").unwrap().contains("Lovelace"));
    // Bit for bit against the reader that keeps everything.
    write_recording(&file, 7, (20.0, 1000.0), 400.0, true).unwrap();
    export(&file, &out).unwrap();
    let sql =
        "select time_ms, depth_mm, proxy_x_mm, second_proxy_x_mm from ticks where brain_distance_mm > 0 order by tick";
    let (rows, recording) = (csv(&out, sql).unwrap(), trepan_link::Recording::open(&file).unwrap());
    assert_eq!(rows.lines().count(), 1 + recording.ticks.len());
    for (line, (tick, second)) in rows.lines().skip(1).zip(recording.ticks.iter().zip(&recording.second)) {
        let numbers: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let reals = [tick.depth_mm, tick.proxy.translation.x, second.proxy.translation.x];
        assert!(numbers[0] == tick.time_ms && [1, 2, 3].map(|at| numbers[at] as f32) == reals, "{line}");
    }
}

#[test]
fn a_query_reads_recordings_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    write_recording(&folder.path().join("a.mcap"), 1, (3.0, 1000.0), 400.0, false).unwrap();
    let database = Database::open(folder.path()).unwrap();
    let (table, more) = database.table("select tick from ticks order by tick").unwrap();
    assert!(more && table.lines().count() == 1004, "{}", table.lines().count());
    for sql in ["drop table ticks", "copy ticks to 'x.parquet'", "insert into scores values ('a', 1, '', 'b')"] {
        assert!(database.rows(sql).is_err(), "{sql}");
    }
    let fault = format!("{:#}", database.rows("select speed from scores").unwrap_err());
    assert!(fault.contains("speed") && fault.contains("scores (session, name, value, unit)"), "{fault}");
    let file = folder.path().join("rows.csv");
    assert!(database.csv("select 1 / (tick - tick) from ticks", &file).is_err() && !file.exists());
    assert_eq!(database.csv("select * from ticks where tick < 0", &file).unwrap(), 0);
    assert!(std::fs::read_to_string(&file).unwrap().starts_with("tick,time_ms,"));
}
