//! Each lesson of the program is passed by a script that does what the lesson says.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod passing;

#[test]
fn a_script_passes_every_lesson() {
    let lessons = [
        (
            "script:craniotomy",
            ("first-operation", include_str!("../../../crates/report/lessons/1-first-operation.json")),
        ),
        ("script:craniotomy", ("through", include_str!("../../../crates/report/lessons/2-straight-through.json"))),
        ("script:flap", ("flap", include_str!("../../../crates/report/lessons/3-flap.json"))),
    ];
    passing::all_pass(env!("CARGO_BIN_EXE_craniotomy"), &lessons);
}
