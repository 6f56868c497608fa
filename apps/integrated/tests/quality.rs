//! Models of a session: presets reach loops and picture; a plan is recorded and replayed bit for
//! bit without planning again.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use trepan_link::Recording;
use trepan_volume::nifti;

fn integrated(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_integrated"));
    command.args(arguments).env("TREPAN_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("cases"));
    command.output().unwrap()
}

/// Runs an operation of some seconds; returns its summary and its log.
fn operation(out: &Path, seconds: &str, more: &[&str]) -> (Value, String) {
    let fixed = ["--headless", "--duration", seconds, "--out", out.to_str().unwrap()];
    let done = integrated(&[&fixed, more].concat());
    let log = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(done.status.success(), "{log}");
    (serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap(), log)
}

fn replay_of(out: &Path) -> String {
    format!("replay:{}", out.join("session.mcap").display())
}

#[test]
fn a_preset_applies_to_loops_and_picture() {
    let out = tempfile::tempdir().unwrap();
    let pictures = ["--quality", "draft", "--frames-per-second", "1", "--picture", "160x96"];
    let (summary, log) = operation(out.path(), "2", &pictures);
    let models = &summary["models"];
    assert_eq!((&models["quality"], &models["planned_cores"]), (&Value::from("draft"), &Value::Null));
    assert_eq!((models["bone"]["spacing_mm"].as_f64(), models["picture"]["detail"].as_f64()), (Some(1.5), Some(0.5)));
    assert!(log.contains("bone: god-object-sphere on 1.5 mm voxels"), "{log}");
    assert_eq!(models["bone"]["why"], "preset draft");
    // The number of tetrahedra that ran, not the requested one.
    let tets = summary["solver"]["tets"].as_f64().unwrap();
    assert!((tets / 3000.0 - 1.0).abs() < 0.1, "{tets} tetrahedra");
    let [skull, ct] =
        [out.path().join("drilled.nii.gz"), trepan_fixtures::case_head().ct].map(|p| nifti::read(&p).unwrap());
    assert_eq!(
        (skull.dims, skull.world_from_voxel),
        (ct.dims, ct.world_from_voxel),
        "the scanner's voxels, whatever ran"
    );
    let gone = ct.data.iter().zip(&skull.data).filter(|(was, is)| **was >= 300.0 && **is < 150.0).count();
    let others = ct.data.iter().zip(&skull.data).filter(|(was, is)| is > was).count();
    assert!(gone > 3 && others == 0, "{gone} voxels of bone went, {others} became denser");
    assert!(summary["frames"].as_u64().unwrap() >= 2);
    let png = fs::read(out.path().join("frames/frame-00000.png")).unwrap();
    assert_eq!(
        (&png[16..20], &png[20..24]),
        (&160u32.to_be_bytes()[..], &96u32.to_be_bytes()[..]),
        "enlarged to its size"
    );
    assert!(fs::read_to_string(out.path().join("report.html")).unwrap().contains("Quality: draft."));
}

#[test]
fn a_planned_session_replays_bit_for_bit_without_a_plan() {
    let [live, again, other] = [(); 3].map(|()| tempfile::tempdir().unwrap());
    let (was, log) =
        operation(live.path(), "4", &["--force-error-n", "0.5", "--displacement-mm", "4", "--frames-per-second", "0"]);
    assert_eq!(was["models"]["quality"], "auto");
    let why = was["models"]["bone"]["why"].to_string();
    assert!(log.contains("planned: ") && why.contains(" N of 0.5 allowed"), "{why}: {log}");
    assert!(why.contains("error in this case "), "the case itself was measured: {why}");
    let header = Recording::open(&live.path().join("session.mcap")).unwrap().header;
    assert_eq!(header.config["quality"], "auto");
    assert_eq!(was["models"]["tissue"]["tets"].to_string(), header.config["sizes.tets"]);

    let device = replay_of(live.path());
    let (is, log) = operation(again.path(), "4", &["--device", &device, "--frames-per-second", "0"]);
    assert!(!log.contains("planned: "), "{log}");
    assert_eq!(
        (&is["models"]["quality"], &is["replay"]["identical"]),
        (&Value::from("replay"), &is["replay"]["ticks"])
    );
    for part in ["bone", "tissue"] {
        let without_why = |mut part: Value| {
            part.as_object_mut().unwrap().remove("why");
            part
        };
        assert_eq!(without_why(is["models"][part].clone()), without_why(was["models"][part].clone()));
    }

    // With another mesh, whose steps have another length, the simulated time is the same.
    let (is, _) = operation(other.path(), "4", &["--device", &device, "--tets", "4500", "--frames-per-second", "0"]);
    let factor = is["solver"]["real_time_factor"].as_f64().unwrap();
    assert!((factor - 1.0).abs() < 0.1, "{factor}");
}

#[test]
fn a_plan_is_printed_for_the_given_case() {
    let text = integrated(&["plan", "--tets", "6000", "--force-error-n", "0.0001"]);
    assert!(text.status.success());
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    for words in
        ["this machine: ", "this case: CT voxels of ", "--tets 6000 is given", "next ", "cores", "tolerance not met"]
    {
        assert!(text.contains(words), "{words:?} is not in: {text}");
    }
    assert!(text.contains("errors by measuring bone, tissue, picture in it"), "{text}");
    // Measured errors are stored: other tolerances choose among the same errors.
    let again = integrated(&["plan", "--tets", "6000", "--force-error-n", "0.5"]);
    let again = String::from_utf8_lossy(&again.stdout).into_owned();
    let of_tissue = |text: &str| text.lines().skip_while(|l| !l.starts_with("tissue: ")).nth(1).map(String::from);
    let error = |text: &str| of_tissue(text)?.split("error ").nth(1)?.split(" mm").next().map(String::from);
    assert!(error(&text).is_some() && error(&text) == error(&again), "{text}\n{again}");
}

#[test]
fn every_ingredient_at_once_is_shown_recorded_and_replayed() {
    let [live, again] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let all = "shaft=on,shading=on,bone-friction=0.3,vibration=off,element=locking-free,law=ogden,relaxation=prony,\
               device=gpu,threads=2,search=hashed-grid,friction=0.2,folds=on";
    let fixed = ["--quality", "draft", "--frames-per-second", "0", "--set", all];
    let (was, log) = operation(live.path(), "2", &fixed);
    assert!(log.contains("ingredients: shading=on, bone-friction=0.3, vibration=off, element=locking-free"), "{log}");
    let models = &was["models"];
    assert_eq!(
        (&models["ingredients"]["law"], &models["ingredients"]["threads"]),
        (&"ogden+ventricle:neo-hookean".into(), &"2".into())
    );
    assert_eq!(models["bone"]["method"], "god-object-sphere-shaft");
    let report = fs::read_to_string(live.path().join("report.html")).unwrap();
    assert!(report.contains("element locking-free; law ogden"), "the report lacks the ingredients");
    // A machine without a graphics card says so.
    let on_card = models["ingredients"]["device"] == "gpu";
    let remarks = was["remarks"].to_string();
    assert_eq!(remarks.contains("runs on the processor, not on the graphics card"), !on_card, "{remarks}");
    assert_eq!(was["solver"]["contacts_left_out"], 0, "{remarks}");
    let (is, _) = operation(again.path(), "2", &["--device", &replay_of(live.path()), "--frames-per-second", "0"]);
    assert_eq!(is["replay"]["identical"], is["replay"]["ticks"]);
    assert_eq!(is["models"]["ingredients"], models["ingredients"]);
    let listed = integrated(&["--set", "list"]);
    assert!(listed.status.success() && String::from_utf8_lossy(&listed.stdout).contains("surface-pressure"));
    let refused = integrated(&["--headless", "--set", "element=hex"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("known are plain, locking-free"));
}
