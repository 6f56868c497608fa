//! Simulated participants: scores by a law of practice, and recordings of made motion.
//!
//! # Theory
//! A score is `usual × level × (1 + gain × attempt^-rate) × exp(a + e)`, where a is normal and the
//! same in all attempts of a participant, and e is normal and new in each. The motion is a row of
//! strokes of minimum jerk (Flash and Hogan 1985, J Neurosci 5) with pauses and tremor. Nobody
//! operated: each summary, table and page says `simulated`.

use super::plan::{Participant, plan};
use super::protocol::{Measure, Protocol};
use super::runs::Run;
use crate::files::{shown, whole};
use anyhow::{Context, Result, bail};
use fastrand::Rng;
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;
use trepan_geometry::{Pose, Quat, Vec3, Wrench};
use trepan_link::Recorder;
use trepan_link::wire::{EventRecord, SecondRecord, SessionHeader, TickRecord};

/// Program's name in what is simulated.
const PROGRAM: &str = "simulated";
/// Length and rate of a simulated participant's recording, s and Hz; numerical, few bytes.
const SHORT: (f64, f64) = (6.0, 250.0);
/// Pause and length of a made stroke.
const PAUSE_MS: f64 = 150.0;
const STROKE_MM: f64 = 20.0;

/// Scores of every run of a protocol, drawn from a seed.
pub fn draw(protocol: &Protocol, seed: u64) -> Vec<Run> {
    let mut rng = Rng::with_seed(seed);
    let mut runs = Vec::new();
    for participant in &plan(protocol).participants {
        let hand = protocol.groups[participant.group].simulated;
        let own: Vec<f64> = protocol.measures.iter().map(|_| hand.between * normal(&mut rng)).collect();
        for (task, condition) in sequence(protocol, participant) {
            let attempts = protocol.tasks.iter().find(|of| of.name == task).map_or(0, |task| task.attempts);
            for attempt in 1..=attempts {
                let practice = 1.0 + hand.gain * (attempt as f64).powf(-hand.rate);
                let score = |(measure, own): (&Measure, &f64)| {
                    let noise = own + hand.within * normal(&mut rng);
                    (measure.score.clone(), measure.usual * hand.level * practice * noise.exp())
                };
                runs.push(Run {
                    participant: participant.code.clone(),
                    group: participant.group,
                    task: task.clone(),
                    condition: condition.clone(),
                    attempt,
                    scores: protocol.measures.iter().zip(&own).map(score).collect(),
                    complete: true,
                    simulated: true,
                    session: String::new(),
                });
            }
        }
    }
    runs
}

/// Tasks and conditions of a participant, in order.
fn sequence(protocol: &Protocol, participant: &Participant) -> Vec<(String, Option<String>)> {
    if protocol.conditions.is_empty() {
        return participant.order.iter().map(|task| (task.clone(), None)).collect();
    }
    let tasks = |letter: &String| {
        protocol.tasks.iter().map(|task| (task.name.clone(), Some(letter.clone()))).collect::<Vec<_>>()
    };
    participant.order.iter().flat_map(tasks).collect()
}

fn normal(rng: &mut Rng) -> f64 {
    Normal::standard().inverse_cdf(rng.f64().clamp(1e-12, 1.0 - 1e-12))
}

/// Writes a session's folder for every run of simulated participants, and their answers. An error
/// if the folder exists. Returns the number of sessions.
pub fn simulate(protocol: &Protocol, out: &Path, seed: u64) -> Result<usize> {
    if out.exists() {
        bail!("{} is there already; give a new folder, so that real and simulated runs do not mix", shown(out));
    }
    let runs = draw(protocol, seed);
    let of_each = runs.chunk_by(|a, b| a.participant == b.participant);
    let runs: Vec<(&Run, usize)> = of_each.flat_map(|runs| runs.iter().zip(1..)).collect();
    runs.par_iter().enumerate().try_for_each(|(number, (run, nth))| {
        let folder = out.join(format!("{}-{nth:03}", run.participant));
        session(protocol, &folder, run, *nth, seed.wrapping_mul(1_000_003) + number as u64)
    })?;
    if !protocol.questions.is_empty() {
        let mut rng = Rng::with_seed(!seed);
        let answers = plan(protocol).answers_csv(protocol, |code, question| {
            let [low, high] = question.scale.range();
            let own = normal(&mut of_code(code, seed));
            let share = 0.5 + 0.1 * own + 0.1 * normal(&mut rng);
            (low + (high - low) * share.clamp(0.0, 1.0)).round().to_string()
        });
        whole(&out.join("answers.csv"), answers.as_bytes())?;
    }
    Ok(runs.len())
}

fn session(protocol: &Protocol, folder: &Path, run: &Run, nth: usize, seed: u64) -> Result<()> {
    let began = format!("2000-01-{:02}T{:02}:{:02}:00Z", 1 + nth / 1440 % 28, nth / 60 % 24, nth % 60);
    let summary = serde_json::json!({
        "app": PROGRAM, "simulated": true, "date": began, "person": run.participant, "lesson": run.task,
        "name": run.condition, "device": PROGRAM,
    });
    whole(&folder.join("summary.json"), serde_json::to_string_pretty(&summary)?.as_bytes())?;
    let mut csv = "name,value\n".to_owned();
    for (name, value) in run.scores.iter().filter(|(name, _)| !name.starts_with("strokes.")) {
        let part = if name.contains('.') { "" } else { "scores." };
        _ = writeln!(csv, "{part}{name},{value}");
    }
    whole(&folder.join("scores.csv"), csv.as_bytes())?;
    // Who has more practice makes a stroke in less time; hands and sessions differ.
    let hand = protocol.groups[run.group].simulated;
    let practice = 1.0 + 0.3 * hand.gain * (run.attempt as f64).powf(-hand.rate);
    let mut own = of_code(&run.participant, protocol.seed);
    let spread = hand.between * normal(&mut own) + 0.3 * hand.within * normal(&mut Rng::with_seed(!seed));
    let stroke_ms = 400.0 * hand.level * practice * spread.exp();
    write_recording(&folder.join("session.mcap"), seed, SHORT, stroke_ms, false)
}

/// Draws that are the participant's own.
fn of_code(code: &str, seed: u64) -> Rng {
    Rng::with_seed(code.bytes().fold(!seed, |hash, byte| hash.rotate_left(9) ^ u64::from(byte)))
}

/// Writes a recording of made motion: `length` in s and rate in Hz, strokes of `stroke_ms`, and a
/// second hand if asked. The same by the same seed. Costs about 3 µs a tick.
pub fn write_recording(path: &Path, seed: u64, length: (f64, f64), stroke_ms: f64, second: bool) -> Result<()> {
    let (seconds, rate_hz) = length;
    let config = [("quality", "draft"), ("ingredients.rigid", "none"), ("operation.rate_hz", &rate_hz.to_string())];
    let header = SessionHeader {
        app: PROGRAM.into(),
        version: env!("CARGO_PKG_VERSION").into(),
        case: PROGRAM.into(),
        seed,
        hashes: [("case".to_owned(), format!("{:064x}", 0))].into(),
        config: config.map(|(key, value)| (key.to_owned(), value.to_owned())).into(),
    };
    let mut rng = Rng::with_seed(seed);
    let mut recorder = Recorder::create(path, &header)?;
    let mut last = Vec3::ZERO;
    for number in 1..=(seconds * rate_hz).round() as u64 {
        let time_ms = 1e3 * number as f64 / rate_hz;
        let mut tick = tick(number, time_ms, stroke_ms, &mut rng);
        tick.twist.linear = (tick.device.translation - last) * (1e-3 * rate_hz) as f32;
        last = tick.device.translation;
        recorder.tick(&tick)?;
        if second {
            let TickRecord { device, wrench, twist, .. } = tick;
            let proxy = Pose::from_parts(device.translation + Vec3::X, device.rotation);
            recorder.second(&SecondRecord {
                tick: number,
                time_ms,
                device,
                twist,
                proxy,
                wrench,
                ..Default::default()
            })?;
        }
        if number % rate_hz as u64 == 0 {
            let text = format!("second {:.0} of a simulated session", 1e-3 * time_ms);
            recorder.event(&EventRecord { tick: number, time_ms, kind: PROGRAM.into(), text })?;
        }
    }
    recorder.finish().with_context(|| format!("cannot finish {}", shown(path)))
}

fn tick(number: u64, time_ms: f64, stroke_ms: f64, rng: &mut Rng) -> TickRecord {
    let period = stroke_ms + PAUSE_MS;
    let s = (time_ms % period / stroke_ms).min(1.0);
    let part = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
    let along = STROKE_MM * if ((time_ms / period) as u64).is_multiple_of(2) { part } else { 1.0 - part };
    let tremor = 0.02 * (1e-3 * time_ms * 9.0 * TAU).sin();
    let mut noise = |size: f32| size * (rng.f32() - 0.5);
    let depth_mm = 0.3 + noise(0.1);
    let tip = Vec3::new(along as f32 + noise(2e-3), tremor as f32 + noise(2e-3), noise(2e-3));
    let rotation = Quat::from_rotation_z(noise(1e-3));
    let force = Vec3::new(noise(0.1), noise(0.1), 2.0 * depth_mm + noise(0.02));
    TickRecord {
        tick: number,
        time_ms,
        device: Pose::from_parts(tip - Vec3::Z * depth_mm, rotation),
        proxy: Pose::from_parts(tip, rotation),
        wrench: Wrench { force, torque: Vec3::ZERO },
        contact_normal: Vec3::Z,
        depth_mm,
        removed_mm3: 0.01 + noise(0.01),
        spindle_rpm: 9000.0,
        brain_distance_mm: 8.0 + noise(1.0),
        compute_us: 5.0 + noise(2.0),
        flags: TickRecord::DRILLING,
        ..TickRecord::default()
    }
}
