//! Finds out which frames of an interrupted `apply` are complete.
//!
//! During a run, a hidden file in the folder of the results lists the frames whose results are in their places, each with a
//! digest of everything that they depend on: program, calibration, settings, and the contents of the frame's files. Dates are not
//! looked at: a clock that was set back, or files that were copied with their dates, would make results of another input look
//! complete. The file is removed at the end of a run; where it is, the folder is not complete.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use depthcal_io::FileError;

use super::images::stem;
use super::job::Job;
use super::written::Written;
use crate::failure::{Failure, input};

const FILE: &str = ".depthcal-apply.journal";

/// An interrupted run, and the present one.
pub(super) struct Resume {
    path: PathBuf,
    /// Digest of program, calibration and settings.
    settings: blake3::Hash,
    /// Frames that the interrupted run completed, and the digests of what they depend on.
    before: BTreeMap<String, String>,
    /// The open list, locked; `None` before the run begins in a folder without one.
    journal: Mutex<Option<File>>,
}

impl Resume {
    /// Looks for an interrupted run in a folder.
    pub(super) fn open(folder: &Path, calibration: &Path, written: &Written) -> Result<Self, Failure> {
        let bytes = fs::read(calibration)
            .map_err(|error| Failure::Input(format!("{}: cannot read the file: {error}", calibration.display())))?;
        let mut settings = blake3::Hasher::new();
        settings.update(env!("CARGO_PKG_VERSION").as_bytes());
        settings.update(blake3::hash(&bytes).as_bytes());
        settings.update(format!("{written:?}").as_bytes());
        let path = folder.join(FILE);
        let mut before = BTreeMap::new();
        let mut journal = None;
        if path.is_file() {
            let file = open(&path, false)?;
            // What is not a line of this form is that of a run that was killed while it wrote, and counts as not there.
            for line in read(&file).unwrap_or_default().lines() {
                if let Some((digest, stem)) = line.split_once(' ').filter(|(digest, _)| digest.len() == 64) {
                    before.insert(stem.to_owned(), digest.to_owned());
                }
            }
            journal = Some(file);
        }
        Ok(Self { path, settings: settings.finalize(), before, journal: Mutex::new(journal) })
    }

    /// Whether the interrupted run has completed a frame, whose results are `outputs`, as the present one would.
    pub(super) fn is_done(&self, job: &Job, outputs: &[PathBuf]) -> bool {
        let Some(before) = self.before.get(&stem(&job.depth)) else { return false };
        outputs.iter().all(|path| path.is_file()) && self.digest(job).is_ok_and(|now| now == *before)
    }

    /// Begins the list of the present run with the frames that are `done`.
    pub(super) fn begin<'a>(&self, done: impl Iterator<Item = &'a Job>) -> Result<(), Failure> {
        let mut journal = self.journal.lock().unwrap_or_else(PoisonError::into_inner);
        if journal.is_none() {
            let folder = self.path.parent().unwrap_or(Path::new("."));
            fs::create_dir_all(folder).map_err(|error| self.unwritable(error))?;
            *journal = Some(open(&self.path, true)?);
        }
        if let Some(file) = journal.as_mut() {
            let lines = done.filter_map(|job| {
                let name = stem(&job.depth);
                Some(format!("{} {name}\n", self.before.get(&name)?))
            });
            let text: String = lines.collect();
            let written = file.set_len(0).and_then(|()| file.write_all(text.as_bytes()));
            written.map_err(|error| self.unwritable(error))?;
        }
        Ok(())
    }

    /// Notes that all results of a frame are in their places.
    pub(super) fn completed(&self, job: &Job) -> Result<(), Failure> {
        let line = format!("{} {}\n", self.digest(job).map_err(input)?, stem(&job.depth));
        match self.journal.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
            Some(file) => file.write_all(line.as_bytes()).map_err(|error| self.unwritable(error)),
            None => Ok(()),
        }
    }

    /// The run is complete.
    pub(super) fn end(&self) {
        let _ = fs::remove_file(&self.path);
    }

    /// Digest of everything that the results of a frame depend on.
    fn digest(&self, job: &Job) -> Result<String, FileError> {
        let mut all = blake3::Hasher::new();
        all.update(self.settings.as_bytes()).update(job.key().as_bytes());
        for path in job.files() {
            let contents = fs::read(path).map_err(|error| FileError::Read { path: path.to_owned(), error })?;
            all.update(blake3::hash(&contents).as_bytes());
        }
        Ok(all.finalize().to_string())
    }

    fn unwritable(&self, error: io::Error) -> Failure {
        input(FileError::Write { path: self.path.clone(), error })
    }
}

/// Opens the list and locks it, as long as the file is open.
fn open(path: &Path, create: bool) -> Result<File, Failure> {
    let file = OpenOptions::new().read(true).append(true).create(create).open(path);
    let file = file.map_err(|error| input(FileError::Write { path: path.to_owned(), error }))?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => {
            let folder = path.parent().unwrap_or(Path::new("."));
            Err(Failure::Input(format!(
                "{}: another run of apply is writing here: wait for its end, or give another folder",
                folder.display()
            )))
        }
        // A file system without locks is no reason not to write.
        _ => Ok(file),
    }
}

fn read(mut file: &File) -> io::Result<String> {
    let mut bytes = Vec::new();
    file.rewind()?;
    file.read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
