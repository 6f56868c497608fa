//! Tests of a window in another language: every text of its own has a line, and passes through it.

use crate::tests::Bench;
use crate::*;
use eframe::egui::Key;
use egui_kittest::kittest::{By, NodeT, Queryable};
use std::collections::HashMap;
use trepan_geometry::{Tool, ToolKind};

/// The program's German texts.
fn german() -> Language {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../simulator/languages/de.json");
    let json = std::fs::read_to_string(file).unwrap();
    // A flat file, one text a line: `"English": "Deutsch",`.
    let unquote = |text: &str| text.trim().trim_matches('"').replace("\\\"", "\"");
    let lines = json.lines().filter_map(|line| line.trim().trim_end_matches(',').split_once("\": \""));
    let texts: HashMap<_, _> = lines.map(|(english, german)| (unquote(english), unquote(german))).collect();
    Language { name: "Deutsch".into(), texts }
}

/// Panels of a hand with the mouse, of a script and of a replay.
fn panels() -> [Panel; 11] {
    let soft = [Tool::probe(2.0), Tool::spatula(), Tool::aspirator(), Tool::bipolar()];
    let tools = [Tool::burr(3.0), Tool::perforator(), Tool::craniotome()].into_iter().chain(soft).collect();
    let names = [
        "burr 6 mm",
        "perforator 11 mm",
        "craniotome",
        "probe",
        "spatula",
        "aspirator",
        "bipolar",
        "scalpel",
        "scissors",
    ];
    let options = names.map(|name| (name.to_string(), None)).into();
    let choice = Choice { name: "Tool".into(), options, chosen: 0, tools };
    let by_hand = Panel { by_hand: true, rate_hz: 1000.0, choices: vec![choice], ..Panel::default() };
    let mark = Mark { at_s: 1.0, text: "brain begins".into(), warning: true };
    let marks = [mark].into();
    let timeline = Timeline { at_s: 2.0, length_s: 9.0, ready_s: 5.0, running: true, speed: 1.0, marks };
    let script = Panel { by_hand: false, ..by_hand.clone() };
    let on_tissue = |kind| [false, true].map(|drilling| Panel { on_tissue: Some(kind), drilling, ..by_hand.clone() });
    let [[rests, runs], [cold, hot], [blunt, sharp], [open, closed]] =
        [ToolKind::Aspirator, ToolKind::Bipolar, ToolKind::Scalpel, ToolKind::Scissors].map(on_tissue);
    let replay = Panel { timeline: Some(timeline), ..script.clone() };
    [Panel { drilling: true, ..by_hand }, rests, runs, cold, hot, blunt, sharp, open, closed, script, replay]
}

#[test]
fn every_text_of_the_window_is_german_where_german_is_spoken() {
    let german = german();
    assert!(german.texts.len() > 300, "{}", german.texts.len());
    for panel in panels() {
        speak(Some(german.clone()));
        let mut bench = Bench::with(panel);
        for key in [Key::F1, Key::C, Key::E, Key::M, Key::S, Key::Num3, Key::Num9, Key::J, Key::OpenBracket] {
            bench.press(key);
            let all = bench.window.query_all(By::new().predicate(|node| node.label().is_some()));
            for label in all.filter_map(|node| node.accesskit_node().label()) {
                let line = german.texts.get(&label).filter(|line| **line != label);
                let is_english = line.is_some() && !german.texts.values().any(|line| *line == label);
                assert!(!is_english, "{label} is not in German after {key:?}");
            }
        }
        assert_eq!(missing(), Vec::<String>::new(), "no German line");
    }
}
