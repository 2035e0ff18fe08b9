//! The files of a command's results, which take their places together when all are written.

use std::path::{Path, PathBuf};

use depthcal_calibration::task::{Made, Results};
use depthcal_io::{Displaced, check_writable};
use depthcal_report::{SavedResults, prepare_pages};

use super::common::Output;
use super::failure::{Failure, input};
use super::session::Session;
use super::voice::say;

/// Files of results that a failed run leaves as they were, and speaks of.
const TOLD: [&str; 7] = [
    "calibration.json",
    "fleet.json",
    "comparison.json",
    "diff.json",
    "diagnosis.json",
    "evaluation.json",
    "report.html",
];

impl Output {
    /// Refuses a folder that cannot be written before any work is done. The parts that every report has are made in the
    /// background from then on.
    pub(super) fn prepare(&self) -> Result<(), Failure> {
        check_writable(&self.out).map_err(input)?;
        prepare_pages();
        Ok(())
    }
}

/// Writes results into a folder, and then further files elsewhere by `write_more`; only where both succeed do the results
/// replace the earlier ones. Returns the value of `write_more`.
pub(super) fn save<T>(
    results: &dyn Results,
    made: &Made,
    out: &Path,
    session: &Session,
    write_more: impl FnOnce() -> Result<T, Failure>,
) -> Result<T, Failure> {
    let saved = SavedResults::write(results, made, out, &session.progress).map_err(input)?;
    let more = write_more()?;
    told(saved.commit().map_err(input)?, session);
    Ok(more)
}

/// Tells what new results removed and replaced.
fn told(displaced: Displaced, session: &Session) {
    session.committed();
    for path in displaced.removed {
        say!("removed: {}, which told of the calibration that was replaced", path.display());
    }
    for path in displaced.replaced {
        say!("replaced: {}, which an earlier command had written beside calibration.json", path.display());
    }
}

/// The earlier results that a command that failed left in its folder, as a sentence; `None` where there was nothing.
pub(super) fn earlier_results(out: &Path) -> Option<(String, Vec<PathBuf>)> {
    let earlier: Vec<PathBuf> = TOLD.iter().map(|name| out.join(name)).filter(|path| path.is_file()).collect();
    let names: Vec<String> = earlier.iter().map(|path| path.display().to_string()).collect();
    let sentence = match names.as_slice() {
        [] => return None,
        [one] => format!("nothing was written: {one} is of an earlier run and is as it was"),
        [firsts @ .., last] => {
            format!("nothing was written: {} and {last} are of an earlier run and are as they were", firsts.join(", "))
        }
    };
    Some((sentence, earlier))
}
