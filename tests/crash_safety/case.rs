//! A command that is killed: how it is run, what it replaces, and what a kill may leave.

use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use depthcal::io::OF_CALIBRATION;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::state::{State, copy, state_of, visible};

/// A command, in a folder with the inputs in `in`, the results in `out` and the cache of detections in `cache`.
pub struct Case {
    pub name: &'static str,
    /// Makes the earlier results, where the command replaces any.
    pub before: &'static str,
    pub command: &'static str,
    /// Whether the cache holds the detections of the dataset already.
    pub warm: bool,
    /// The earlier results are refused rather than replaced, so that a run after a complete one ends with exit code 1.
    pub refuses: bool,
    /// Share of the kills.
    pub weight: usize,
}

/// Counts of what was there after kills.
#[derive(Default)]
pub struct Tally {
    pub kills: usize,
    pub old: usize,
    pub new: usize,
    pub between: usize,
    pub broken: Vec<String>,
    pub with_temporary: usize,
    pub not_healed: Vec<String>,
}

const FOLDERS: [&str; 2] = ["out", "cache"];

impl Case {
    /// Kills the command until it was killed so many times, and examines what each kill leaves and what the next run makes of it.
    pub fn run(&self, folder: &Path, kills: usize, random: &mut ChaCha8Rng) -> Tally {
        let mut tally = Tally::default();
        if kills == 0 {
            return tally;
        }
        for part in FOLDERS {
            copy(Path::new("/nonexistent"), &folder.join(part));
        }
        if !self.before.is_empty() {
            finish(start(folder, self.before), self.before);
        }
        if !self.warm {
            copy(Path::new("/nonexistent"), &folder.join("cache"));
        }
        for part in FOLDERS {
            copy(&folder.join(part), &folder.join("old").join(part));
        }
        let old = states(folder);
        let inputs = state_of(&folder.join("in"));
        // Undisturbed: what the results are to be, and how long it takes until something is written, and in all.
        let mut times = Vec::new();
        let mut new = states(folder);
        for _ in 0..2 {
            self.restore(folder);
            let began = Instant::now();
            let mut child = start(folder, self.command);
            wait_for_writing(folder, &mut child);
            let writing = began.elapsed();
            finish(child, self.command);
            times.push((began.elapsed(), began.elapsed() - writing));
            let again = states(folder);
            assert!(
                times.len() == 1 || again == new,
                "{}: two runs differ in {:?}",
                self.name,
                difference(&again, &new)
            );
            new = again;
        }
        let (all, writing) = (times[0].0.max(times[1].0), times[0].1.max(times[1].1));
        let mut tries = 0;
        while tally.kills < kills {
            tries += 1;
            assert!(tries < 20 * kills + 100, "{}: it ends before it can be killed", self.name);
            self.restore(folder);
            let mut child = start(folder, self.command);
            // Every other kill is aimed at the time in which files are written, which is short.
            if tries % 2 == 0 {
                wait_for_writing(folder, &mut child);
                sleep(writing.mul_f64(random.random_range(0.0..1.0)));
            } else {
                sleep(all.mul_f64(random.random_range(0.0..1.0)));
            }
            child.kill().unwrap();
            if child.wait().unwrap().signal() != Some(9) {
                continue;
            }
            tally.kills += 1;
            self.examine(folder, &old, &new, &mut tally);
        }
        assert!(state_of(&folder.join("in")) == inputs, "{}: an input was changed", self.name);
        tally
    }

    fn restore(&self, folder: &Path) {
        for part in FOLDERS {
            copy(&folder.join("old").join(part), &folder.join(part));
        }
    }

    fn examine(&self, folder: &Path, old: &State, new: &State, tally: &mut Tally) {
        let (state, temporary) = visible(&states(folder));
        tally.with_temporary += usize::from(!temporary.is_empty());
        let neither: Vec<&String> = state
            .iter()
            .filter(|(path, bytes)| old.get(*path) != Some(bytes) && new.get(*path) != Some(bytes))
            .map(|(path, _)| path)
            .collect();
        if state == *new {
            tally.new += 1;
        } else if state == *old {
            tally.old += 1;
        } else if !neither.is_empty() {
            tally.broken.push(format!("neither old nor new: {neither:?}"));
        } else if let Some(path) = contradiction(&state, old, new) {
            tally.broken.push(format!("{path} tells of another calibration than the one beside it"));
        } else {
            tally.between += 1;
        }
        let is_complete = state == *new;
        let output = start(folder, self.command).wait_with_output().unwrap();
        let refused = self.refuses && is_complete && output.status.code() == Some(1);
        if !output.status.success() && !refused {
            let words = String::from_utf8_lossy(&output.stderr);
            tally.not_healed.push(format!("the next run fails, after {temporary:?}: {words}"));
        }
        let after = states(folder);
        if after != *new {
            tally.not_healed.push(format!("after the next run these differ: {:?}", difference(&after, new)));
        }
    }
}

/// Results and cache.
fn states(folder: &Path) -> State {
    let files_of = |part: &str| {
        state_of(&folder.join(part))
            .into_iter()
            .map(move |(path, bytes)| (format!("{part}/{path}"), bytes))
            .collect::<State>()
    };
    FOLDERS.iter().flat_map(|part| files_of(part)).collect()
}

/// A file that tells of a calibration other than the one in its folder.
fn contradiction<'a>(left: &'a State, old: &State, new: &State) -> Option<&'a String> {
    let generation = |path: &str, state: &State| left.get(path).is_some() && left.get(path) == state.get(path);
    left.keys().find(|path| {
        let Some((folder, name)) = path.rsplit_once('/') else { return false };
        let calibration = format!("{folder}/calibration.json");
        OF_CALIBRATION.contains(&name)
            && left.contains_key(&calibration)
            && ![old, new].into_iter().any(|state| generation(path, state) && generation(&calibration, state))
    })
}

fn difference(a: &State, b: &State) -> Vec<String> {
    a.keys().chain(b.keys()).filter(|path| a.get(*path) != b.get(*path)).cloned().collect()
}

fn start(folder: &Path, command: &str) -> Child {
    Command::new(env!("CARGO_BIN_EXE_depthcal"))
        .args(command.split_whitespace())
        .current_dir(folder)
        .env("DEPTHCAL_CACHE", folder.join("cache"))
        .env_remove("DEPTHCAL_LOG")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn finish(child: Child, command: &str) {
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Runs a command to its end.
pub fn prepare(folder: &Path, command: &str) {
    finish(start(folder, command), command);
}

/// Names of results and cached files. The file by which a command checks, before its work, that it can write is none of them.
fn names(folder: &Path) -> Vec<std::ffi::OsString> {
    let entries = |part: &&str| std::fs::read_dir(folder.join(part)).into_iter().flatten().flatten();
    let names = FOLDERS.iter().flat_map(entries).map(|entry| entry.file_name());
    names.filter(|name| !name.to_string_lossy().starts_with(".check.")).collect()
}

/// Waits until something appears or disappears among results and cache, or the command ends.
fn wait_for_writing(folder: &Path, child: &mut Child) {
    let before = names(folder);
    while names(folder) == before && child.try_wait().unwrap().is_none() {
        sleep(Duration::from_micros(100));
    }
}

fn sleep(time: Duration) {
    std::thread::sleep(time);
}
