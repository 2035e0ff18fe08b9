//! Frames of several cameras that were taken together, and get one name.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::candidate::Candidate;
use super::declaration::CameraSection;
use super::error::DatasetError;
use super::frame::{Frame, Frames};
use super::pairing;

/// Gives frames of different cameras that were taken together, by nearest time or by their names, the name that the first of
/// these cameras has for it. Frames that only one camera has keep their names, with that of the camera before it where another
/// frame has it.
///
/// # Errors
/// [`DatasetError::NoTime`] where frames are paired by time and one has none.
pub(super) fn give_common_names(
    file: &Path,
    cameras: &[CameraSection],
    found: &mut [Frames],
    within_s: Option<f64>,
) -> Result<(), DatasetError> {
    let Some((first, others)) = found.split_first_mut() else { return Ok(()) };
    // The frames that some camera has, with their times.
    let mut known: Vec<Candidate> = first.frames.iter().map(candidate).collect();
    for (camera, found) in cameras.iter().skip(1).zip(others) {
        let theirs: Vec<Candidate> = found.frames.iter().map(candidate).collect();
        let pairs = match within_s {
            Some(within_s) => {
                let no_time = |untimed| DatasetError::NoTime { path: file.to_owned(), file: untimed };
                pairing::by_time(&known, &theirs, within_s).map_err(no_time)?
            }
            None => pairing::by_name(&known, &theirs).1,
        };
        let names: BTreeMap<usize, String> = pairs.into_iter().map(|(_, k, own)| (own, known[k].stem())).collect();
        for (number, frame) in found.frames.iter_mut().enumerate() {
            match names.get(&number) {
                Some(name) => frame.name.clone_from(name),
                None => {
                    if known.iter().any(|k| k.stem() == frame.name) {
                        frame.name = format!("{}_{}", camera.name, frame.name);
                    }
                    known.push(Candidate { path: named(&frame.name), time_s: theirs[number].time_s() });
                }
            }
        }
    }
    Ok(())
}

/// A path whose stem is the name, dots included.
fn named(name: &str) -> PathBuf {
    PathBuf::from(format!("{name}.frame"))
}

fn candidate(frame: &Frame) -> Candidate {
    Candidate { path: named(&frame.name), time_s: frame.metadata.timestamp_s }
}
