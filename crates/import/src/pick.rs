//! Which images of a stream are worth having: sharp, at rest, with the board, and different from each other.

use std::ops::ControlFlow;

use depthcal_io::GrayImage;
use depthcal_model::Target;

use crate::error::ImportError;
use crate::guess::Candidate;
use crate::message::{Content, content};
use crate::recording::Recording;
use crate::score::{Score, Scorer};
use crate::spread::spread;

/// Candidates per wanted frame that are searched for the board.
const SEARCHED: usize = 5;
/// Images that are searched at a time, which bounds memory.
#[cfg(feature = "detect")]
const BATCH: usize = 16;
/// Least mean distance of the board's corners from those of another frame, in diagonals of the image.
#[cfg(feature = "detect")]
const LEAST_SHIFT: f32 = 0.01;
/// Least mean difference of thumbnails, as share of the brightness.
const LEAST_CHANGE: f32 = 0.01;

/// One image of a stream.
#[derive(Debug, Clone)]
pub(crate) struct Seen {
    /// Its number in the stream.
    pub number: usize,
    pub time_ns: u64,
    pub score: Score,
}

/// Which images are wanted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PickOptions<'a> {
    pub board: Option<&'a Target>,
    pub wanted: usize,
    /// Seconds at the beginning that are left out.
    pub skip_s: f64,
}

/// The images that are kept, and how many there were.
#[derive(Debug)]
pub(crate) struct Picked {
    pub images: Vec<Seen>,
    pub of: usize,
    /// Images that were searched for the board, and those that show it; `None` where there was no search.
    pub searched: Option<(usize, usize)>,
}

/// Picks images as the options say: at most so many, with the board, from a time on.
pub(crate) fn pick(
    recording: &Recording,
    stream: &Candidate,
    options: &PickOptions<'_>,
) -> Result<Picked, ImportError> {
    let PickOptions { board, wanted, skip_s } = *options;
    let mut seen = Vec::new();
    let mut scorer = Scorer::default();
    each_image(recording, stream, |number, time_ns, image| {
        seen.push(Seen { number, time_ns, score: scorer.score(image) });
        true
    })?;
    let of_images = seen.len();
    let first = seen.iter().map(|s| s.time_ns).min().unwrap_or(0);
    let begin = first.saturating_add((skip_s * 1e9) as u64);
    seen.retain(|s| s.time_ns >= begin);
    if seen.is_empty() {
        return Ok(Picked { images: seen, of: of_images, searched: None });
    }
    let best = best_of_windows(seen, SEARCHED.saturating_mul(wanted));
    match board {
        #[cfg(feature = "detect")]
        Some(board) => with_board(recording, stream, board, best, wanted, of_images),
        _ => {
            let descriptors: Vec<Vec<f32>> = best.iter().map(|s| s.score.thumbnail.clone()).collect();
            let images = kept(best, &descriptors, wanted, LEAST_CHANGE);
            Ok(Picked { images, of: of_images, searched: None })
        }
    }
}

/// Calls `with` for every image of the stream, until it returns false.
fn each_image(
    recording: &Recording,
    stream: &Candidate,
    mut with: impl FnMut(usize, u64, &GrayImage) -> bool,
) -> Result<(), ImportError> {
    let mut number = 0;
    recording.visit(&|s| *s == stream.stream, &mut |packet| {
        if let Content::Picture(time_ns, picture) = content(&recording.path, &packet)? {
            let image = picture.gray(&recording.path)?;
            if !with(number, time_ns, &image) {
                return Ok(ControlFlow::Break(()));
            }
            number += 1;
        }
        Ok(ControlFlow::Continue(()))
    })
}

/// The best image of each of so many equal parts of the stream: sharp against its neighbours in time, and at rest before and
/// after.
fn best_of_windows(seen: Vec<Seen>, windows: usize) -> Vec<Seen> {
    let n = seen.len();
    if n <= windows {
        return seen;
    }
    let motion = |i: usize| {
        let after = seen.get(i + 1).map_or(f64::INFINITY, |s| s.score.motion);
        let before = seen[i].score.motion;
        // The first and the last have one neighbour.
        if before.is_infinite() {
            after
        } else if after.is_infinite() {
            before
        } else {
            before.max(after)
        }
    };
    let mut motions: Vec<f64> = (0..n).map(motion).filter(|m| m.is_finite()).collect();
    motions.sort_by(f64::total_cmp);
    let usual = motions.get(motions.len() / 2).copied().unwrap_or(1.0).max(1e-9);
    let merit = |i: usize| seen[i].score.sharpness / (1.0 + (motion(i) / usual).powi(2));
    let part = |w: usize| (w * n / windows..((w + 1) * n / windows)).max_by(|a, b| merit(*a).total_cmp(&merit(*b)));
    let mut chosen: Vec<usize> = (0..windows).filter_map(part).collect();
    chosen.dedup();
    let mut keep = vec![false; n];
    chosen.iter().for_each(|i| keep[*i] = true);
    seen.into_iter().zip(keep).filter(|(_, keep)| *keep).map(|(seen, _)| seen).collect()
}

/// The candidates that differ most, beginning with the sharpest.
fn kept(candidates: Vec<Seen>, descriptors: &[Vec<f32>], wanted: usize, least: f32) -> Vec<Seen> {
    let sharpest = (0..candidates.len())
        .max_by(|a, b| candidates[*a].score.sharpness.total_cmp(&candidates[*b].score.sharpness))
        .unwrap_or(0);
    let chosen = spread(descriptors, sharpest, wanted, least);
    candidates.into_iter().enumerate().filter(|(i, _)| chosen.binary_search(i).is_ok()).map(|(_, seen)| seen).collect()
}

#[cfg(feature = "detect")]
fn with_board(
    recording: &Recording,
    stream: &Candidate,
    board: &Target,
    candidates: Vec<Seen>,
    wanted: usize,
    of_images: usize,
) -> Result<Picked, ImportError> {
    use rayon::prelude::*;

    let looked_at = candidates.len();
    let mut described: Vec<(Seen, Vec<f32>)> = Vec::new();
    let mut fault = None;
    {
        let mut batch: Vec<(Seen, GrayImage)> = Vec::with_capacity(BATCH);
        let mut search = |batch: &mut Vec<(Seen, GrayImage)>| -> bool {
            let results: Vec<_> =
                batch.par_drain(..).map(|(seen, image)| (seen, board_corners(&image, board))).collect();
            for (seen, corners) in results {
                match corners {
                    Ok(Some(corners)) => described.push((seen, corners)),
                    Ok(None) => {}
                    Err(error) => fault = Some(error),
                }
            }
            fault.is_none()
        };
        let mut next = candidates.into_iter().peekable();
        each_image(recording, stream, |number, _, image| {
            if let Some(seen) = next.next_if(|seen| seen.number == number) {
                batch.push((seen, image.clone()));
                if batch.len() == BATCH && !search(&mut batch) {
                    return false;
                }
            }
            next.peek().is_some()
        })?;
        search(&mut batch);
    }
    if let Some(message) = fault {
        return Err(ImportError::Detect { path: recording.path.clone(), message });
    }
    if described.is_empty() {
        return Err(ImportError::NoBoard {
            path: recording.path.clone(),
            stream: stream.stream.name.clone(),
            looked_at,
        });
    }
    let with_board = described.len();
    let (candidates, descriptors): (Vec<Seen>, Vec<Vec<f32>>) = described.into_iter().unzip();
    let images = kept(candidates, &descriptors, wanted, LEAST_SHIFT);
    Ok(Picked { images, of: of_images, searched: Some((looked_at, with_board)) })
}

/// The corners of the board's markers in the image, in diagonals of it: of the rectangle around all markers, by the homography of
/// those that were found. `None` where the board is not seen.
#[cfg(feature = "detect")]
fn board_corners(image: &GrayImage, board: &Target) -> Result<Option<Vec<f32>>, String> {
    use depthcal_detect::{DetectOptions, Homography, detect};

    // Places to a fraction of a pixel are not needed here.
    let options = DetectOptions { refine: false, ..DetectOptions::default() };
    let Some(detection) = detect(image, board, &options).map_err(|error| error.to_string())? else { return Ok(None) };
    let pairs: Vec<([f64; 2], [f64; 2])> =
        detection.markers.iter().map(|marker| (board.point(marker.index), marker.pixel)).collect();
    let Some(homography) = Homography::fit(&pairs) else { return Ok(None) };
    let [[x0, y0], [x1, y1]] = board.marker_rectangle();
    let diagonal = (image.width as f64).hypot(image.height as f64);
    let corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
    let placed = corners.iter().map(|corner| homography.apply(*corner)).collect::<Option<Vec<_>>>();
    Ok(placed.map(|placed| placed.into_iter().flatten().map(|v| (v / diagonal) as f32).collect()))
}
