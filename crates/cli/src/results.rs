//! The files of a command's results, which take their places together when all are written.

use std::path::{Path, PathBuf};

use depthcal_io::{FileError, StagedResults, check_writable, write_atomically};
use depthcal_report::{ReportInput, ReportRig, render, render_rig};

use super::common::Output;
use super::failure::{Failure, input};
use super::session::Session;
use super::voice::say;

/// Files of results that a failed run leaves as they were, and speaks of.
const TOLD: [&str; 6] =
    ["calibration.json", "fleet.json", "comparison.json", "diagnosis.json", "evaluation.json", "report.html"];

impl Output {
    /// Refuses a folder that cannot be written, before any work is done.
    pub(super) fn check(&self) -> Result<(), Failure> {
        check_writable(&self.out).map_err(input)
    }
}

/// Results that are being written. Dropped without [`commit`](Self::commit), they leave the earlier ones as they were.
pub(super) struct Results {
    staged: StagedResults,
    out: PathBuf,
}

impl Results {
    /// Results for a folder.
    pub(super) fn begin(out: &Path) -> Result<Self, Failure> {
        Ok(Self { staged: StagedResults::within(out).map_err(input)?, out: out.to_owned() })
    }

    /// The folder itself.
    pub(super) fn place(&self) -> Place<'_> {
        Place { results: self, folder: PathBuf::new() }
    }

    /// Replaces the earlier results: of a calibration all that tells of it, else the files that were written alone. `first` is the
    /// file that the others tell of.
    pub(super) fn commit(self, first: &str, session: &Session) -> Result<(), Failure> {
        let displaced = self.staged.commit(first).map_err(input)?;
        session.committed();
        for path in displaced.removed {
            say!("removed: {}, which told of the calibration that was replaced", path.display());
        }
        for path in displaced.replaced {
            say!("replaced: {}, which an earlier command had written beside calibration.json", path.display());
        }
        Ok(())
    }
}

/// A folder of results.
pub(super) struct Place<'a> {
    results: &'a Results,
    /// Within the folder of all results.
    folder: PathBuf,
}

impl Place<'_> {
    /// A folder in this one.
    pub(super) fn within(&self, name: &str) -> Self {
        Self { results: self.results, folder: self.folder.join(name) }
    }

    /// The path that a file of this name has in the end.
    pub(super) fn shown(&self, name: &str) -> PathBuf {
        self.results.out.join(&self.folder).join(name)
    }

    /// Has a file written; returns the path that it has in the end.
    pub(super) fn write(
        &self,
        name: &str,
        write: impl FnOnce(&Path) -> Result<(), FileError>,
    ) -> Result<PathBuf, Failure> {
        self.write_into(|folder| write(&folder.join(name)))?;
        Ok(self.shown(name))
    }

    /// Has several files written into the folder.
    pub(super) fn write_into<T>(&self, write: impl FnOnce(&Path) -> Result<T, FileError>) -> Result<T, Failure> {
        let staged = &self.results.staged;
        write(&staged.folder().join(&self.folder)).map_err(|error| input(staged.located(error)))
    }

    /// Writes a text.
    pub(super) fn write_text(&self, name: &str, text: &str) -> Result<PathBuf, Failure> {
        self.write(name, |path| write_atomically(path, |file| file.write_all(text.as_bytes())))
    }

    /// Writes `report.html`.
    pub(super) fn write_report(&self, report: &ReportInput<'_>, session: &Session) -> Result<PathBuf, Failure> {
        let _stage = session.progress.stage("report");
        self.write_text("report.html", &render(report).map_err(input)?)
    }

    /// Writes the `report.html` of a rig.
    pub(super) fn write_rig_report(
        &self,
        report: &ReportInput<'_>,
        rig: &ReportRig<'_>,
        session: &Session,
    ) -> Result<PathBuf, Failure> {
        let _stage = session.progress.stage("report");
        self.write_text("report.html", &render_rig(report, rig).map_err(input)?)
    }
}

/// What a command that failed left in the folder of its results, as a sentence; `None` where there was nothing.
pub(super) fn earlier_results(out: &Path) -> Option<(String, Vec<PathBuf>)> {
    let found: Vec<PathBuf> = TOLD.iter().map(|name| out.join(name)).filter(|path| path.is_file()).collect();
    let names: Vec<String> = found.iter().map(|path| path.display().to_string()).collect();
    let sentence = match names.as_slice() {
        [] => return None,
        [one] => format!("nothing was written: {one} is of an earlier run and is as it was"),
        [firsts @ .., last] => {
            format!("nothing was written: {} and {last} are of an earlier run and are as they were", firsts.join(", "))
        }
    };
    Some((sentence, found))
}
