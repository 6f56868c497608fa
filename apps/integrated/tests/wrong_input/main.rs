//! Wrong inputs as a table: each case is refused with exit code 2 within 10 s and 4 GB. The message
//! names fault, place and remedy; there is no panic and no file is left.
#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod files;
mod flags;
mod folders;
mod images;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// A case: its name, the command line, words that the message must contain.
///
/// In the command line `IN` is the folder of input files and `OUT` the output folder of the case.
/// `CT=F` gives a file as CT with valid MRI and labels, `MRI=F` and `LABELS=F` likewise. `FILES=N`
/// limits the size of files.
pub type Wrong = (&'static str, &'static str, &'static [&'static str]);

/// Longest time of a case.
const LONGEST: Duration = Duration::from_secs(10);
/// Address space of a case, KiB.
const MEMORY_KIB: usize = 4 << 20;

/// Expands a command line of the table into arguments and a limit for the size of files.
fn expanded(line: &str, home: &Path, own: &Path) -> (Vec<String>, Option<String>) {
    let (mut arguments, mut limit) = (Vec::new(), None);
    let sound = |ct: &str, mri: &str, labels: &str| {
        [("--ct", ct), ("--mri", mri), ("--labels", labels)].map(|(flag, file)| [flag.into(), format!("IN/{file}")])
    };
    for word in line.split_whitespace() {
        match word.split_once('=') {
            Some(("CT", file)) => arguments.extend(sound(file, "mri.nii", "brain.nii").concat()),
            Some(("MRI", file)) => arguments.extend(sound("ct.nii", file, "brain.nii").concat()),
            Some(("LABELS", file)) => arguments.extend(sound("ct.nii", "mri.nii", file).concat()),
            Some(("FILES", blocks)) => limit = Some(blocks.to_string()),
            _ => arguments.push(word.to_string()),
        }
    }
    let session = !["case", "plan", "compare", "device"].contains(&arguments.first().map_or("", String::as_str));
    if session {
        let given = |flag: &str| arguments.iter().any(|word| word == flag);
        let mut more: Vec<String> = Vec::new();
        for flag in ["--duration 1", "--quality draft", "--frames-per-second 0", "--out OUT"] {
            if !given(flag.split(' ').next().unwrap()) {
                more.extend(flag.split(' ').map(String::from));
            }
        }
        arguments.push("--headless".into());
        arguments.extend(more);
    }
    let place = |word: String| {
        let word = word.replace("IN/", &format!("{}/", home.display()));
        word.replace("OUT", &own.join("out").display().to_string()).replace("\\e", "\u{1b}")
    };
    (arguments.into_iter().map(place).collect(), limit)
}

/// Runs a case; returns its output and its wall time.
fn run(line: &str, home: &Path, own: &Path) -> Result<(Output, Duration), String> {
    let (arguments, limit) = expanded(line, home, own);
    for folder in ["tmp", "here"] {
        fs::create_dir_all(own.join(folder)).unwrap();
    }
    let files = limit.map_or_else(String::new, |blocks| format!("ulimit -f {blocks}; "));
    let script = format!("ulimit -v {MEMORY_KIB}; {files}exec \"$@\"");
    let mut command = Command::new("sh");
    command.args(["-c", &script, "sh", env!("CARGO_BIN_EXE_integrated")]).args(&arguments);
    command.env("TREPAN_CACHE", own.join("cache")).env("TMPDIR", own.join("tmp")).current_dir(own.join("here"));
    command.env("RAYON_NUM_THREADS", "2");
    let [stdout, stderr] = ["stdout", "stderr"].map(|name| fs::File::create(own.join(name)).unwrap());
    let began = Instant::now();
    let mut child = command.stdin(Stdio::null()).stdout(stdout).stderr(stderr).spawn().unwrap();
    let status = loop {
        match child.try_wait().unwrap() {
            Some(status) => break status,
            None if began.elapsed() > 3 * LONGEST => {
                child.kill().unwrap();
                child.wait().unwrap();
                return Err("it hangs".into());
            }
            None => std::thread::sleep(Duration::from_millis(5)),
        }
    };
    let [stdout, stderr] = ["stdout", "stderr"].map(|name| {
        let bytes = fs::read(own.join(name)).unwrap();
        fs::remove_file(own.join(name)).unwrap();
        bytes
    });
    Ok((Output { status, stdout, stderr }, began.elapsed()))
}

/// Returns every file and folder below one, except the folders that the test makes.
fn left(own: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(own).unwrap().flatten() {
        let path = entry.path();
        let ours = ["tmp", "here", "cache"].iter().any(|name| path.ends_with(name));
        if path.is_dir() {
            found.extend(left(&path));
        }
        if !ours {
            found.push(path);
        }
    }
    found
}

/// Returns the faults in how a case is refused.
fn faults((name, line, words): &Wrong, home: &Path, own: &Path) -> Option<String> {
    let (output, took) = match run(line, home, own) {
        Ok(run) => run,
        Err(fault) => return Some(format!("{name}: {fault}")),
    };
    let log = String::from_utf8_lossy(&output.stderr).into_owned();
    let mut faults = Vec::new();
    if output.status.code() != Some(2) {
        faults.push(format!("ends with {:?}", output.status));
    }
    if ["panicked", "RUST_BACKTRACE", "memory allocation", "overflow"].iter().any(|word| log.contains(word)) {
        faults.push("panics".into());
    }
    if log.chars().any(|c| c.is_control() && c != '\n') {
        faults.push("moves the terminal".into());
    }
    if took > LONGEST {
        faults.push(format!("takes {took:?}"));
    }
    faults.extend(words.iter().filter(|word| !log.contains(**word)).map(|word| format!("does not say {word:?}")));
    let left = left(own);
    if !left.is_empty() {
        faults.push(format!("leaves {left:?}"));
    }
    (!faults.is_empty()).then(|| format!("{name}: {}\n    {line}\n    {log}", faults.join(", ")))
}

#[test]
fn every_wrong_input_is_refused_with_its_remedy() {
    let home = tempfile::tempdir().unwrap();
    let inputs = home.path().join("in");
    fs::create_dir(&inputs).unwrap();
    files::make(&inputs);
    images::make(&inputs);
    folders::make(&inputs);
    let table: Vec<&Wrong> = [flags::TABLE, images::TABLE, folders::TABLE].into_iter().flatten().collect();
    assert!(table.len() >= 120, "{} cases", table.len());
    let (next, found) = (AtomicUsize::new(0), std::sync::Mutex::new(Vec::new()));
    let work = || {
        while let Some(case) = table.get(next.fetch_add(1, Ordering::Relaxed)) {
            let own = tempfile::tempdir().unwrap();
            found.lock().unwrap().extend(faults(case, &inputs, own.path()));
        }
    };
    let threads = std::thread::available_parallelism().map_or(2, usize::from).min(8);
    std::thread::scope(|scope| (0..threads).for_each(|_| drop(scope.spawn(work))));
    let found = found.into_inner().unwrap();
    assert!(found.is_empty(), "{} of {} cases:\n{}", found.len(), table.len(), found.join("\n"));
}

#[test]
fn the_valid_files_of_the_table_are_accepted() {
    let home = tempfile::tempdir().unwrap();
    files::make(home.path());
    folders::make(home.path());
    let sound = [
        "CT=ct.nii",
        "CT=series",
        "CT=pipe-beside",
        "--ct IN/pipe-beside/1.2.3-05.dcm --mri IN/mri.nii --labels IN/brain.nii",
        "--ct IN/head-ct.nii --mri IN/head-mri.nii",
        "--ct IN/head-ct.nii --mri IN/turned-mri.nii --register",
    ];
    for line in sound {
        let own = tempfile::tempdir().unwrap();
        let line = format!("case build {line} --tets 500 --spacing-mm 2 --out OUT");
        let (output, _) = run(&line, home.path(), own.path()).unwrap();
        let log = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
        assert!(output.status.success(), "{line}: {log}");
        assert!(!log.contains("may not lie"), "{line}: {log}");
    }
}
