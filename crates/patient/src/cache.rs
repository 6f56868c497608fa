//! Caches derived data in the user's cache folder, named by the hash of its inputs.
//!
//! # Practice
//! A folder appears complete or not at all: it is filled under a temporary name and then renamed.
//! If two programs build the same case at once, the folder of the second replaces the first.
//! `--cache` or `TREPAN_CACHE` names another folder. Above 8 GB in total the least recently used
//! folders are removed, but none that was used within the last hour.

use crate::PatientError;
use etcetera::{BaseStrategy, choose_base_strategy};
use serde::{Serialize, de::DeserializeOwned};
use sha2::{Digest, Sha256};
use std::error::Error;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};
use trepan_volume::open_regular;

/// Version of cached cases; raised when their format or the results of the code change.
const FORM: u32 = 17;

/// Folder of cached cases.
#[derive(Clone, Debug)]
pub struct Cache {
    root: PathBuf,
}

impl Cache {
    /// Cache in this folder, else the user's.
    pub fn of(root: Option<PathBuf>) -> Result<Self, PatientError> {
        root.map_or_else(Self::of_user, |root| Ok(Self::at(root)))
    }

    /// The user's cache: `TREPAN_CACHE`, else `trepan/cases` in the platform's cache folder.
    pub fn of_user() -> Result<Self, PatientError> {
        if let Some(root) = std::env::var_os("TREPAN_CACHE").filter(|root| !root.is_empty()) {
            return Ok(Self { root: root.into() });
        }
        let strategy = choose_base_strategy()
            .map_err(|fault| PatientError::Usage(format!("no cache folder ({fault}): set HOME or TREPAN_CACHE")))?;
        Ok(Self { root: strategy.cache_dir().join("trepan").join("cases") })
    }

    /// Cache in a given folder.
    pub fn at(root: PathBuf) -> Self {
        Self { root }
    }

    /// Key of data derived from these files (folders with all their files) by this recipe, 64
    /// digits.
    pub fn key(&self, inputs: &[&Path], recipe: &str) -> Result<String, PatientError> {
        digest_of_all(&format!("{FORM} {recipe}"), inputs)
    }

    /// Key of data derived from cached data by further numbers.
    pub fn under(&self, key: &str, numbers: &str) -> String {
        let mut hash = Sha256::new();
        hash.update(format!("{key} {numbers}"));
        hexadecimal(hash)
    }

    /// Folder of a key, if it exists; marks it as used.
    pub fn find(&self, key: &str) -> Option<PathBuf> {
        let folder = Some(self.root.join(key)).filter(|folder| folder.is_dir())?;
        // Records the time of the last use for the sweep. It fails for a folder of another user.
        _ = File::open(&folder).and_then(|file| file.set_modified(SystemTime::now()));
        Some(folder)
    }

    /// Reads a value from a file of a key; `None` if it was never written, or by another version.
    pub fn read<T: DeserializeOwned>(&self, key: &str, file: &str) -> Option<T> {
        serde_json::from_slice(&fs::read(self.find(key)?.join(file)).ok()?).ok()
    }

    /// Writes a value as a file of a key; if that fails, it is computed again next time.
    pub fn write(&self, value: &impl Serialize, key: &str, file: &str) {
        let write = |folder: &Path| Ok(fs::write(folder.join(file), serde_json::to_vec(value)?)?);
        self.keep(key, write).err().into_iter().for_each(|fault| tracing::debug!("{file} not cached: {fault}"));
    }

    /// Fills a temporary folder and moves it to its place; replaces an existing one.
    pub fn keep(
        &self,
        key: &str,
        fill: impl FnOnce(&Path) -> Result<(), Box<dyn Error>>,
    ) -> Result<(), Box<dyn Error>> {
        let text = |fault: io::Error| format!("{}: {fault}", self.root.display());
        fs::create_dir_all(&self.root).map_err(text)?;
        self.sweep(MOST_BYTES);
        let folder = tempfile::Builder::new().prefix(MAKING).tempdir_in(&self.root).map_err(text)?;
        fill(folder.path())?;
        let place = self.root.join(key);
        if place.is_dir() {
            fs::remove_dir_all(&place).map_err(text)?;
        }
        fs::rename(folder.path(), &place).map_err(text)?;
        _ = folder.keep();
        Ok(())
    }
}

/// SHA-256 of a text and of these files (folders with all their files), hexadecimal.
pub(crate) fn digest_of_all(text: &str, inputs: &[&Path]) -> Result<String, PatientError> {
    let mut hash = Sha256::new();
    hash.update(text);
    for input in inputs {
        for file in files_of(input).map_err(|fault| unreadable(input, &fault))? {
            add(&mut hash, &file).map_err(|fault| unreadable(&file, &fault))?;
        }
    }
    Ok(hexadecimal(hash))
}

/// SHA-256 of a file's bytes, hexadecimal.
pub(crate) fn digest(file: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    feed(&mut hash, &mut open_regular(file)?)?;
    Ok(hexadecimal(hash))
}

/// Name prefix of folders that are being filled.
const MAKING: &str = ".making-";
/// Time without use after which a folder is neither in use nor being filled.
const ABANDONED: Duration = Duration::from_secs(3600);
/// Largest total size of cached cases, bytes: about 80 cases.
const MOST_BYTES: u64 = 8 << 30;

impl Cache {
    /// Removes temporary folders of killed programs, and the least recently used cases beyond
    /// `most` bytes in total.
    fn sweep(&self, most: u64) {
        let mut kept = Vec::new();
        for entry in fs::read_dir(&self.root).into_iter().flatten().flatten() {
            let Ok(used) = entry.metadata().and_then(|m| m.modified()) else { continue };
            let old = used.elapsed().is_ok_and(|age| age > ABANDONED);
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.starts_with(MAKING) && old {
                _ = fs::remove_dir_all(entry.path());
            } else if is_key(&name) {
                kept.push((used, old, entry.path()));
            }
        }
        kept.sort_by_key(|kept| std::cmp::Reverse(kept.0));
        let mut bytes = 0;
        for (_, old, folder) in kept {
            bytes += size(&folder);
            if bytes > most && old {
                _ = fs::remove_dir_all(folder);
            }
        }
    }
}

/// Whether a folder's name is one that [`Cache::key`] gives.
fn is_key(name: &str) -> bool {
    name.len() == 64 && name.bytes().all(|byte| byte.is_ascii_hexdigit())
}

/// Bytes of the files in a folder.
fn size(folder: &Path) -> u64 {
    let files = fs::read_dir(folder).into_iter().flatten().flatten();
    files.filter_map(|file| Some(file.metadata().ok()?.len())).sum()
}

fn hexadecimal(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

fn unreadable(path: &Path, fault: &io::Error) -> PatientError {
    let remedy = match fault.kind() {
        io::ErrorKind::NotFound => "give the path of a file, or of a folder of DICOM slices, that exists",
        io::ErrorKind::PermissionDenied => "allow reading it",
        io::ErrorKind::Other => "give one regular file, or the folder of one series of DICOM slices",
        _ => "check the file and the disk",
    };
    PatientError::Usage(format!("cannot read {}: {fault}; {remedy}", path.display()))
}

/// Extensions of images stored in one file.
const WHOLE: [&str; 5] = ["nii", "gz", "nrrd", "mha", "vtk"];

/// Largest number of files of a folder; more is not a series of slices.
const MOST_FILES: usize = 20_000;

/// Depth of subfolders that are read, as for DICOM series.
const DEEPEST: usize = 4;

/// Lists the file itself, or every file under a folder, in a fixed order. A file with another
/// extension may be one of several (a slice of a series, half of a pair), so all files of its
/// folder are listed.
fn files_of(input: &Path) -> io::Result<Vec<PathBuf>> {
    if !fs::metadata(input)?.is_dir() {
        // Refuses pipes before anything is read: reading one would block.
        open_regular(input)?;
        let whole = input.extension().is_some_and(|e| WHOLE.iter().any(|known| e.eq_ignore_ascii_case(known)));
        return match input.parent().filter(|_| !whole) {
            None => Ok(vec![input.to_path_buf()]),
            Some(folder) => beside(if folder.as_os_str().is_empty() { Path::new(".") } else { folder }),
        };
    }
    let mut files = Vec::new();
    below(input, DEEPEST, &mut files)?;
    Ok(files)
}

/// Adds the regular files of a folder and its subfolders; links to folders are not followed.
fn below(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) -> io::Result<()> {
    let mut entries: Vec<_> = fs::read_dir(folder)?.collect::<io::Result<_>>()?;
    entries.sort_by_key(|entry| entry.file_name());
    for entry in entries {
        let path = entry.path();
        if entry.file_type()?.is_dir() {
            if depth > 0 {
                below(&path, depth - 1, files)?;
            }
        } else if path.is_file() {
            files.push(path);
        }
        if files.len() > MOST_FILES {
            return Err(io::Error::other(format!("it holds more than {MOST_FILES} files")));
        }
    }
    Ok(())
}

/// Lists the files of a folder, without subfolders.
fn beside(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let paths: Vec<PathBuf> = fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<io::Result<_>>()?;
    let mut files: Vec<PathBuf> = paths.into_iter().filter(|path| path.is_file()).collect();
    files.sort();
    Ok(files)
}

fn add(hash: &mut Sha256, file: &Path) -> io::Result<()> {
    let mut stream = open_regular(file)?;
    hash.update(stream.metadata()?.len().to_le_bytes());
    feed(hash, &mut stream)
}

fn feed(hash: &mut Sha256, stream: &mut File) -> io::Result<()> {
    let mut buffer = vec![0; 1 << 16];
    loop {
        match stream.read(&mut buffer)? {
            0 => return Ok(()),
            count => hash.update(&buffer[..count]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_names_a_case_and_a_failed_fill_leaves_nothing() {
        let home = tempfile::tempdir().unwrap();
        let cache = Cache::at(home.path().join("cases"));
        let file = home.path().join("a");
        fs::write(&file, b"one").unwrap();
        let key = cache.key(&[&file], "r").unwrap();
        fs::write(&file, b"two").unwrap();
        assert_ne!(key, cache.key(&[&file], "r").unwrap());
        assert_eq!(key.len(), 64);
        let failed = cache.keep(&key, |folder| {
            fs::write(folder.join("half"), b"x").unwrap();
            Err("disk full".into())
        });
        assert_eq!(failed.unwrap_err().to_string(), "disk full");
        assert!(cache.find(&key).is_none());
        assert_eq!(fs::read_dir(home.path().join("cases")).unwrap().count(), 0);
        cache.keep(&key, |folder| Ok(fs::write(folder.join("whole"), b"x")?)).unwrap();
        assert!(cache.find(&key).unwrap().join("whole").is_file());
    }

    #[test]
    fn abandoned_folders_are_removed_but_not_recent_ones() {
        let home = tempfile::tempdir().unwrap();
        let (old, new) = (home.path().join(".making-old"), home.path().join(".making-new"));
        [&old, &new].iter().for_each(|folder| fs::create_dir(folder).unwrap());
        let long_ago = SystemTime::now() - 2 * ABANDONED;
        File::open(&old).unwrap().set_modified(long_ago).unwrap();
        Cache::at(home.path().into()).keep("case", |_| Ok(())).unwrap();
        assert!(!old.exists() && new.exists());
    }

    #[test]
    fn cases_over_the_limit_go_the_longest_unused_first_but_none_in_use_and_nothing_else() {
        let home = tempfile::tempdir().unwrap();
        let cache = Cache::at(home.path().into());
        let keys: Vec<String> = (0..4).map(|n| format!("{n:064}")).collect();
        for (n, key) in keys.iter().enumerate() {
            cache.keep(key, |folder| Ok(fs::write(folder.join("x"), [0; 100])?)).unwrap();
            let used = SystemTime::now() - (4 - n as u32) * ABANDONED - ABANDONED / 2;
            File::open(home.path().join(key)).unwrap().set_modified(used).unwrap();
        }
        fs::create_dir(home.path().join("mine")).unwrap();
        assert!(cache.find(&keys[0]).is_some(), "used now");
        let there = || keys.iter().map(|key| home.path().join(key).is_dir()).collect::<Vec<_>>();
        cache.sweep(250);
        assert_eq!(there(), [true, false, false, true]);
        cache.sweep(0);
        assert_eq!(there(), [true, false, false, false]);
        assert!(home.path().join("mine").is_dir());
    }

    #[test]
    fn one_slice_stands_for_its_series() {
        let home = tempfile::tempdir().unwrap();
        let slices = [home.path().join("1.dcm"), home.path().join("2.dcm")];
        slices.iter().for_each(|slice| fs::write(slice, b"a").unwrap());
        let cache = Cache::at(home.path().join("cases"));
        let before = cache.key(&[&slices[0]], "").unwrap();
        fs::write(&slices[1], b"b").unwrap();
        assert_ne!(before, cache.key(&[&slices[0]], "").unwrap());
    }

    #[test]
    #[cfg(unix)]
    fn pipes_and_link_cycles_in_a_folder_are_skipped_and_a_named_pipe_is_refused() {
        let home = tempfile::tempdir().unwrap();
        let (folder, pipe) = (home.path().join("ct"), home.path().join("ct/pipe"));
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("1.dcm"), b"a").unwrap();
        let cache = Cache::at(home.path().join("cases"));
        let before = cache.key(&[&folder], "").unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for name in ["one", "other"] {
            std::os::unix::fs::symlink(&folder, folder.join(name)).unwrap();
        }
        assert_eq!(before, cache.key(&[&folder], "").unwrap());
        let fault = cache.key(&[&pipe], "").unwrap_err().to_string();
        assert!(fault.contains("ct/pipe") && fault.contains("a named pipe"), "{fault}");
    }

    #[test]
    fn a_missing_input_is_named_with_a_remedy() {
        let cache = Cache::at(PathBuf::from("nowhere"));
        let fault = cache.key(&[Path::new("no/such/ct.nii.gz")], "").unwrap_err().to_string();
        assert!(fault.contains("no/such/ct.nii.gz") && fault.contains("give the path"), "{fault}");
    }
}
