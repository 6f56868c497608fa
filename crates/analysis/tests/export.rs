//! Exports of whole, cut, copied and mixed recordings, and queries over them.

use std::fs;
use std::path::Path;
use trepan_analysis::export::{Exported, export};
use trepan_analysis::query::Database;
use trepan_analysis::study::simulate::write_recording;
use trepan_link::Recorder;
use trepan_link::wire::{EventRecord, SecondRecord, SessionHeader, TickRecord};

/// A session's folder with 3 s of motion.
fn session(runs: &Path, name: &str, seed: u64, second: bool) {
    let folder = runs.join(name);
    fs::create_dir_all(&folder).unwrap();
    write_recording(&folder.join("session.mcap"), seed, (3.0, 1000.0), 400.0, second).unwrap();
    let person = format!("N{seed:02}");
    let summary = serde_json::json!({"person": person, "lesson": "through", "name": "A", "device": "script:drill"});
    fs::write(folder.join("summary.json"), summary.to_string()).unwrap();
    fs::write(folder.join("scores.csv"), format!("name,value\nperson,{person}\nscores.plunge_mm,{seed}.5\n")).unwrap();
}

fn counts(exported: &Exported) -> [usize; 4] {
    [exported.written, exported.skipped, exported.warnings.len(), exported.failed.len()]
}

fn csv(tables: &Path, sql: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("rows.csv");
    Database::open(tables).unwrap().csv(sql, &file).unwrap();
    fs::read_to_string(file).unwrap()
}

#[test]
fn tables_hold_what_was_recorded_and_a_second_run_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (runs, out) = (folder.path().join("runs"), folder.path().join("tables"));
    session(&runs, "a", 1, false);
    session(&runs, "b", 2, true);
    assert_eq!(counts(&export(&runs, &out).unwrap()), [2, 0, 0, 0]);
    let sql = "select participant, task, condition, c.ticks, second_hand, complete, value, unit, count(t.tick) as n, \
               count(second_depth_mm) as pairs, min(second_proxy_x_mm - device_x_mm) > 0.9 as beside \
               from cases c join scores s on c.session = s.session join ticks t on c.session = t.session \
               group by all order by participant"
        .replace("group by all", "group by 1, 2, 3, 4, 5, 6, 7, 8");
    let rows = csv(&out, &sql);
    let lines: Vec<&str> = rows.lines().skip(1).collect();
    assert_eq!(
        lines,
        ["N01,through,A,3000,false,true,1.5,mm,3000,0,", "N02,through,A,3000,true,true,2.5,mm,3000,3000,true"]
    );
    // Bit for bit against the reader that keeps everything.
    let recording = trepan_link::Recording::open(&runs.join("a/session.mcap")).unwrap();
    let rows = csv(
        &out,
        "select time_ms, depth_mm, proxy_x_mm from ticks where session = (select session from cases \
                          where participant = 'N01') order by tick",
    );
    for (line, tick) in rows.lines().skip(1).zip(&recording.ticks) {
        let numbers: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        assert_eq!(numbers[0], tick.time_ms);
        assert_eq!([numbers[1] as f32, numbers[2] as f32], [tick.depth_mm, tick.proxy.translation.x]);
    }
    assert_eq!(csv(&out, "select count(*) as n from events"), "n\n6\n");

    assert_eq!(counts(&export(&runs, &out).unwrap()), [0, 2, 0, 0]);
    // New scores are taken, and the session is there once.
    fs::write(runs.join("a/scores.csv"), "name,value\nscores.plunge_mm,10.25\n").unwrap();
    assert_eq!(counts(&export(&runs, &out).unwrap()), [1, 1, 0, 0]);
    assert_eq!(csv(&out, "select value from scores order by value"), "value\n2.5\n10.25\n");
}

#[test]
fn a_cut_recording_gives_its_whole_part_and_is_replaced_by_the_whole_one() {
    let folder = tempfile::tempdir().unwrap();
    let (runs, out) = (folder.path().join("runs"), folder.path().join("tables"));
    session(&runs, "a", 1, true);
    let file = runs.join("a/session.mcap");
    let bytes = fs::read(&file).unwrap();
    fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    let exported = export(&runs, &out).unwrap();
    assert_eq!(counts(&exported), [1, 0, 1, 0]);
    let warning = &exported.warnings[0];
    assert!(warning.contains("cut or damaged at byte") && warning.contains("fetch the file again"), "{warning}");
    let ticks: u64 = csv(&out, "select count(*) from ticks").lines().nth(1).unwrap().parse().unwrap();
    assert!((500..2900).contains(&ticks), "{ticks}");
    assert!(csv(&out, "select complete, losses from cases").contains("false,it is cut or damaged"));
    fs::write(&file, &bytes).unwrap();
    assert_eq!(counts(&export(&runs, &out).unwrap()), [1, 0, 0, 0]);
    assert_eq!(csv(&out, "select count(*) as n from ticks"), "n\n3000\n");
    assert_eq!(csv(&out, "select complete from cases"), "complete\ntrue\n");
}

#[test]
fn what_cannot_be_read_does_not_stop_the_others_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (runs, out) = (folder.path().join("runs"), folder.path().join("tables"));
    assert!(format!("{:#}", export(&runs, &out).unwrap_err()).contains("check the name"));
    session(&runs, "a", 1, false);
    session(&runs, "a copy", 1, false);
    fs::create_dir_all(runs.join("b")).unwrap();
    fs::write(runs.join("b/session.mcap"), "nothing").unwrap();
    session(&runs, "c", 3, false);
    fs::write(runs.join("c/summary.json"), "{").unwrap();
    let exported = export(&runs, &out).unwrap();
    assert_eq!(counts(&exported), [1, 0, 1, 2]);
    assert!(exported.warnings[0].contains("again"), "{:?}", exported.warnings);
    assert!(exported.failed[0].contains("is not a recording") && exported.failed[1].contains("no summary"));
    // A partition that a killed export left is removed, and so is its temporary folder.
    let left = out.join("ticks/session=0123456789abcdef");
    fs::create_dir_all(&left).unwrap();
    fs::create_dir_all(out.join(".part-x")).unwrap();
    assert_eq!(counts(&export(&runs, &out).unwrap()), [0, 1, 1, 2]);
    assert!(!left.exists() && !out.join(".part-x").exists());
    for table in ["ticks", "events", "scores", "cases"] {
        assert_eq!(fs::read_dir(out.join(table)).unwrap().count(), 1, "{table}");
    }
}

#[test]
fn no_name_reaches_the_tables_and_versions_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let (runs, out) = (folder.path().join("Ada Lovelace"), folder.path().join("tables"));
    for version in ["0.1.0", "0.2.0"] {
        let session = runs.join(version);
        fs::create_dir_all(&session).unwrap();
        let header = SessionHeader {
            app: "brain".into(),
            version: version.into(),
            case: "Lovelace".into(),
            ..SessionHeader::default()
        };
        let mut recorder = Recorder::create(&session.join("session.mcap"), &header).unwrap();
        recorder.tick(&TickRecord::default()).unwrap();
        let text = "cannot read /home/Ada Lovelace/head.nii at 3 mm/s".into();
        recorder.event(&EventRecord { tick: 0, time_ms: 0.0, kind: "warning".into(), text }).unwrap();
        recorder.finish().unwrap();
        let person =
            r#"{"person": "Ada Lovelace", "name": "Ada's", "device": "replay:/data/Ada/a.mcap", "case": "Ada"}"#;
        fs::write(session.join("summary.json"), person).unwrap();
        fs::write(session.join("scores.csv"), "name,value\nperson,Ada\nsession_name,Ada\nhashes.case,7\n").unwrap();
    }
    let exported = export(&runs, &out).unwrap();
    assert_eq!(
        exported.versions.into_iter().collect::<Vec<_>>(),
        [("brain 0.1.0".into(), 1), ("brain 0.2.0".into(), 1)]
    );
    assert!(exported.warnings.iter().all(|warning| warning.contains("--person N07")), "{:?}", exported.warnings);
    let all = ["cases", "events", "scores"].map(|table| csv(&out, &format!("select * from {table}"))).concat();
    assert!(!all.contains("Ada") && !all.contains("Lovelace") && all.contains("brain"), "{all}");
    let names = walk(&out);
    assert!(!names.contains("Ada"), "{names}");
}

fn walk(folder: &Path) -> String {
    let entry =
        |path: std::path::PathBuf| if path.is_dir() { walk(&path) } else { String::new() } + &path.to_string_lossy();
    fs::read_dir(folder).unwrap().map(|of| entry(of.unwrap().path())).collect()
}

#[test]
fn a_second_hand_that_is_recorded_late_is_paired_by_number() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    let mut recorder = Recorder::create(&file, &SessionHeader::default()).unwrap();
    // The second hand's record is 1000 ticks behind in the file, and every tenth is missing.
    let second = |tick: u64| SecondRecord { tick, depth_mm: tick as f32, ..SecondRecord::default() };
    for tick in 1..=30_000 {
        recorder.tick(&TickRecord { tick, time_ms: tick as f64, ..TickRecord::default() }).unwrap();
        if tick > 1000 && tick % 10 != 0 {
            recorder.second(&second(tick - 1000)).unwrap();
        }
    }
    recorder.finish().unwrap();
    let out = folder.path().join("tables");
    let exported = export(&file, &out).unwrap();
    assert!(exported.warnings.iter().all(|warning| warning.contains("no scores.csv")), "{:?}", exported.warnings);
    let rows = csv(
        &out,
        "select count(*), count(second_depth_mm), sum(case when second_depth_mm <> tick then 1 else 0 end) from ticks",
    );
    assert_eq!(rows.lines().nth(1), Some("30000,26100,0"));
}

#[test]
fn a_query_reads_recordings_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    session(folder.path(), "a", 1, false);
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
    assert!(fs::read_to_string(&file).unwrap().starts_with("tick,time_ms,"));
}
