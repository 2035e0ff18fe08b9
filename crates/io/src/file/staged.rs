//! Results of several files that belong together: all new, or all as they were.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::error::FileError;
use super::temporary::{temporary_file, temporary_folder, without_name};
use super::write::synchronise;

/// The files beside a `calibration.json` that say something of it. They never outlast it: a command that replaces the calibration
/// removes those that it does not write anew.
pub const OF_CALIBRATION: &[&str] =
    &["diagnosis.json", "evaluation.json", "observations.json", "report.html", "scores.json"];

const CALIBRATION: &str = "calibration.json";

/// Earlier files that a command removed or replaced ([`StagedResults::commit`]).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Displaced {
    /// Files that told of the calibration that was replaced, and were not written anew.
    pub removed: Vec<PathBuf>,
    /// Files beside a calibration that stayed.
    pub replaced: Vec<PathBuf>,
}

/// A hidden folder within a folder of results, in which a command writes its files before any of the present ones is touched.
///
/// A disk that is full, or a run that is killed, leaves the earlier results as they were. [`commit`](Self::commit) then puts the
/// new ones into their places. Without it, the new ones are removed.
#[derive(Debug)]
pub struct StagedResults {
    out: PathBuf,
    staging: TempDir,
    /// Held while the folder is in use; see [`super::temporary`].
    _lock: Option<File>,
}

impl StagedResults {
    /// Prepares results for the folder `out`, which is created if it does not exist.
    ///
    /// # Errors
    /// [`FileError::Write`] with the folder.
    pub fn within(out: &Path) -> Result<Self, FileError> {
        let made = fs::create_dir_all(out).and_then(|()| temporary_folder(out, "results"));
        let (staging, lock) =
            made.map_err(|error| FileError::Write { path: out.to_owned(), error: without_name(error) })?;
        Ok(Self { out: out.to_owned(), staging, _lock: lock })
    }

    /// The folder to write the files into, under the names that they will have.
    pub fn folder(&self) -> &Path {
        self.staging.path()
    }

    /// An error of writing, told of the place where the file was to be in the end.
    pub fn located(&self, error: FileError) -> FileError {
        error.moved(self.staging.path(), &self.out)
    }

    /// Puts the files into their places; returns what that removed and replaced beside a calibration.
    ///
    /// `first` is the file that all others tell of. In every folder that has a new `first`, the earlier files that tell of it
    /// ([`OF_CALIBRATION`] if it is a `calibration.json`, and those that are written anew) are removed before it is replaced, and
    /// the new ones follow it: whenever this is interrupted, each file tells of the `first` beside it or is missing.
    ///
    /// # Errors
    /// [`FileError::Write`] with the file. Where something that cannot be replaced is in the way of a file, nothing is changed.
    pub fn commit(self, first: &str) -> Result<Displaced, FileError> {
        let steps = self.steps(first)?;
        let replaced = if first == CALIBRATION { Vec::new() } else { replaced_beside_calibration(&steps) };
        // Two runs that end at once follow each other. A system that cannot lock folders does without.
        let lock = File::open(&self.out).ok().filter(|folder| folder.lock().is_ok());
        for step in &steps {
            step.take().map_err(|error| FileError::Write { path: step.target().to_owned(), error })?;
        }
        drop(lock);
        let is_new = |path: &Path| steps.iter().any(|s| matches!(s, Step::Move { to, .. } if to == path));
        let removed = steps.iter().filter_map(|step| match step {
            Step::Remove { path } if !is_new(path) => Some(path.clone()),
            _ => None,
        });
        Ok(Displaced { removed: removed.collect(), replaced })
    }

    fn steps(&self, first: &str) -> Result<Vec<Step>, FileError> {
        let dependants = if first == CALIBRATION { OF_CALIBRATION } else { &[] };
        let unreadable = |error| FileError::Write { path: self.out.clone(), error };
        let files = files_in(self.staging.path()).map_err(unreadable)?;
        let target = |file: &Path| match file.strip_prefix(self.staging.path()) {
            Ok(name) => self.out.join(name),
            Err(_) => self.out.clone(),
        };
        for path in files.iter().map(|file| target(file)) {
            if path.is_dir() {
                return Err(FileError::Write { path, error: io::ErrorKind::IsADirectory.into() });
            }
        }
        let is_first = |file: &Path| file.file_name().is_some_and(|name| name == first);
        let (firsts, others): (Vec<_>, Vec<_>) = files.iter().partition(|file| is_first(file));
        let mut steps = Vec::new();
        for folder in firsts.iter().filter_map(|file| file.parent()) {
            let new = others.iter().filter(|file| file.parent() == Some(folder)).map(|file| target(file));
            let old = dependants.iter().map(|name| target(folder).join(name));
            let mut gone: Vec<PathBuf> = new.chain(old).filter(|path| path.exists()).collect();
            gone.sort();
            gone.dedup();
            steps.extend(gone.into_iter().map(|path| Step::Remove { path }));
        }
        if !steps.is_empty() {
            steps.push(Step::Synchronise { folder: self.out.clone() });
        }
        steps.extend(firsts.into_iter().chain(others).map(|file| Step::Move { from: file.clone(), to: target(file) }));
        steps.push(Step::Synchronise { folder: self.out.clone() });
        Ok(steps)
    }
}

/// One change of the folder of results.
#[derive(Debug)]
enum Step {
    Remove { path: PathBuf },
    Move { from: PathBuf, to: PathBuf },
    Synchronise { folder: PathBuf },
}

impl Step {
    fn target(&self) -> &Path {
        match self {
            Step::Remove { path } => path,
            Step::Move { to, .. } => to,
            Step::Synchronise { folder } => folder,
        }
    }

    fn take(&self) -> io::Result<()> {
        match self {
            Step::Remove { path } => match fs::remove_file(path) {
                // Another run was quicker.
                Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
                other => other,
            },
            Step::Move { from, to } => {
                to.parent().map_or(Ok(()), fs::create_dir_all)?;
                fs::rename(from, to)
            }
            Step::Synchronise { folder } => {
                synchronise(folder);
                Ok(())
            }
        }
    }
}

/// The files of [`OF_CALIBRATION`] that the steps will replace in folders whose calibration stays.
fn replaced_beside_calibration(steps: &[Step]) -> Vec<PathBuf> {
    let is_of_calibration =
        |path: &Path| path.is_file() && OF_CALIBRATION.iter().any(|name| path.file_name().is_some_and(|n| n == *name));
    let targets = steps.iter().filter_map(|step| match step {
        Step::Move { to, .. } => Some(to),
        _ => None,
    });
    targets.filter(|to| is_of_calibration(to) && to.with_file_name(CALIBRATION).is_file()).cloned().collect()
}

/// All files of a folder and the folders in it, sorted.
fn files_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            files.extend(files_in(&entry.path())?);
        } else {
            files.push(entry.path());
        }
    }
    files.sort();
    Ok(files)
}

/// Checks, before any work is done, that results can be written into a folder. It need not exist, and is not created.
///
/// # Errors
/// [`FileError::Write`] with the folder, or with what is in the way of it.
pub fn check_writable(out: &Path) -> Result<(), FileError> {
    let absolute = std::path::absolute(out).unwrap_or_else(|_| out.to_owned());
    let present = absolute.ancestors().find(|folder| folder.symlink_metadata().is_ok()).unwrap_or(&absolute);
    let shown = if present == absolute { out } else { present };
    let unwritable = |error| FileError::Write { path: shown.to_owned(), error: without_name(error) };
    if !present.is_dir() {
        return Err(unwritable(io::ErrorKind::NotADirectory.into()));
    }
    // A file system may be full for contents, but not yet for names.
    let written = temporary_file(present, "check".as_ref())
        .and_then(|mut file| file.write_all(&[0; 4096]).and_then(|()| file.flush()));
    written.map_err(unwritable)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with results of an earlier run, and new ones that are ready.
    fn prepared() -> (TempDir, StagedResults) {
        let folder = tempfile::tempdir().unwrap();
        for name in ["calibration.json", "diagnosis.json", "report.html", "scores.json", "notes.txt", "effects/a.toml"]
        {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "old").unwrap();
        }
        let staged = StagedResults::within(folder.path()).unwrap();
        fs::create_dir(staged.folder().join("effects")).unwrap();
        for name in ["calibration.json", "evaluation.json", "report.html", "effects/b.toml"] {
            fs::write(staged.folder().join(name), "new").unwrap();
        }
        (folder, staged)
    }

    fn contents(folder: &Path) -> Vec<(String, String)> {
        let visible = |path: &PathBuf| !path.to_string_lossy().contains(".depthcal.tmp");
        let files = files_in(folder).unwrap().into_iter().filter(visible);
        let name = |path: &Path| path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
        files.map(|path| (name(&path), fs::read_to_string(&path).unwrap())).collect()
    }

    fn of(folder: &Path, name: &str) -> Option<String> {
        contents(folder).into_iter().find(|(n, _)| n == name).map(|(_, text)| text)
    }

    #[test]
    fn new_results_replace_the_earlier_ones_and_all_that_tells_of_them() {
        let (folder, staged) = prepared();
        let displaced = staged.commit(CALIBRATION).unwrap();
        assert!(displaced.replaced.is_empty());
        assert_eq!(displaced.removed, ["diagnosis.json", "scores.json"].map(|name| folder.path().join(name)));
        let expected = [
            ("calibration.json", "new"),
            ("effects/a.toml", "old"),
            ("effects/b.toml", "new"),
            ("evaluation.json", "new"),
            ("notes.txt", "old"),
            ("report.html", "new"),
        ];
        assert_eq!(contents(folder.path()), expected.map(|(name, text)| (name.to_owned(), text.to_owned())));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 5, "the hidden folder is gone");
    }

    /// A run that is killed after any number of steps leaves no file that tells of another calibration than the one beside it.
    #[test]
    fn no_interruption_leaves_files_that_contradict_each_other() {
        let (_folder, staged) = prepared();
        let count = staged.steps(CALIBRATION).unwrap().len();
        for taken in 0..=count {
            let (folder, staged) = prepared();
            for step in &staged.steps(CALIBRATION).unwrap()[..taken] {
                step.take().unwrap();
            }
            let calibration = of(folder.path(), CALIBRATION);
            assert!(calibration.is_some());
            for name in OF_CALIBRATION {
                let dependant = of(folder.path(), name);
                assert!(dependant.is_none() || dependant == calibration, "{taken}: {name}");
            }
            assert_eq!(of(folder.path(), "notes.txt").as_deref(), Some("old"));
        }
    }

    /// An evaluation in the folder of its calibration: what is replaced is told, in the folder and in those within it.
    #[test]
    fn files_beside_a_calibration_that_stays_are_told() {
        let (folder, staged) = prepared();
        fs::remove_file(staged.folder().join("calibration.json")).unwrap();
        for part in [folder.path(), staged.folder()] {
            fs::create_dir(part.join("alone")).unwrap();
            fs::write(part.join("alone/report.html"), "").unwrap();
        }
        let displaced = staged.commit("evaluation.json").unwrap();
        let replaced = vec![folder.path().join("report.html")];
        assert_eq!(displaced, Displaced { removed: vec![], replaced });
        assert_eq!(of(folder.path(), CALIBRATION).as_deref(), Some("old"));
    }

    #[test]
    fn without_a_commit_nothing_has_changed() {
        let (folder, staged) = prepared();
        let before = contents(folder.path());
        drop(staged);
        assert_eq!(contents(folder.path()), before);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 6);
    }

    #[test]
    fn a_folder_in_the_way_leaves_all_as_it_was() {
        let (folder, staged) = prepared();
        fs::create_dir(folder.path().join("evaluation.json")).unwrap();
        let before = contents(folder.path());
        let error = staged.commit(CALIBRATION).unwrap_err().to_string();
        assert!(error.contains("evaluation.json") && error.contains("move the folder away"), "{error}");
        assert_eq!(contents(folder.path()), before);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn errors_do_not_tell_temporary_names() {
        let error = check_writable(Path::new("/proc/self")).unwrap_err().to_string();
        assert!(error.starts_with("/proc/self: ") && !error.contains(".depthcal.tmp"), "{error}");
    }

    #[test]
    fn errors_name_the_place_in_the_end() {
        let (folder, staged) = prepared();
        let path = staged.folder().join("scores.json");
        let error = staged.located(FileError::Write { path, error: io::Error::other("x") });
        assert!(error.to_string().starts_with(&folder.path().join("scores.json").display().to_string()), "{error}");
    }

    #[test]
    fn folders_are_checked_before_they_exist() {
        let folder = tempfile::tempdir().unwrap();
        check_writable(&folder.path().join("a/b/c")).unwrap();
        check_writable(folder.path()).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        fs::write(folder.path().join("file"), "").unwrap();
        for name in ["file", "file/b/c"] {
            let error = check_writable(&folder.path().join(name)).unwrap_err().to_string();
            assert!(error.contains("file: ") && error.contains("give another folder"), "{error}");
        }
    }
}
