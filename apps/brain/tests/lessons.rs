//! Each lesson of the program is passed by a script that does what the lesson says.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

#[path = "../../craniotomy/tests/passing/mod.rs"]
mod passing;

#[test]
fn a_script_passes_every_lesson() {
    let lessons = [
        ("script:press", ("press", include_str!("../../../crates/report/lessons/4-press.json"))),
        ("script:retract", ("retract", include_str!("../../../crates/report/lessons/5-retract.json"))),
        // A second hand that sucks beside the spatula changes nothing in the first one's marks.
        (
            "script:retract --second-device script:suck",
            ("retract", include_str!("../../../crates/report/lessons/5-retract.json")),
        ),
        // A script does not see where the tumour sinks to, and need not be slow.
        (
            "script:resect --duration 45 --aspiration 50 --csf-loss 0",
            ("resect", include_str!("../../../crates/report/lessons/6-resect.json")),
        ),
        ("script:bleed --duration 60", ("bleeding", include_str!("../../../crates/report/lessons/7-bleeding.json"))),
        (
            "script:arm --duration 60 --aspiration 50 --csf-loss 0",
            ("arm", include_str!("../../../crates/report/lessons/9-arm.json")),
        ),
    ];
    passing::all_pass(env!("CARGO_BIN_EXE_brain"), &lessons);
}
