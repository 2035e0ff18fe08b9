//! The search for the board that the images show, where the declared one is not found or leads to no camera. One entry of
//! [`ALTERNATIVES`] per kind of evidence.

use std::sync::Arc;

use depthcal_detect::{DetectOptions, Detector, chessboard_size, detect};
use depthcal_io::GrayImage;
use depthcal_model::{Pattern, Target};
use depthcal_statistics::upper_median;
use rayon::prelude::*;

use super::board_alternative::Alternative;
use super::board_fault::{BoardCause, BoardFault};
use super::tag_board::tag_board;
use crate::observe::{MarkerObservation, RawFrame, Stored};

/// Images that are looked at, spread over the capture.
const IMAGES: usize = 6;
/// Larger images are halved until they are not.
const MOST_PIXELS: usize = 1_600_000;
/// Share of the images in which the mended board has to be found.
const SHARE: f64 = 0.5;

/// The alternatives in words, for the message where none fits.
pub const TRIED: &str = "mirrored images, columns and rows exchanged or counted otherwise, other kinds of boards, other \
                                dictionaries, first tags and sides of tags were tried as well, and none fits";

/// A source of alternatives to a board, from images.
type Source = fn(&Target, &[GrayImage]) -> Vec<Alternative>;

/// The sources, the most certain first.
const ALTERNATIVES: [Source; 3] = [tag_board, chessboard, circles];

/// The faults of a declared board with which the images show it; `None` where none is certain.
pub fn board_cause<'a>(target: &Target, frames: impl Iterator<Item = &'a RawFrame>) -> Option<BoardCause> {
    let stored: Vec<_> = frames.filter_map(|frame| frame.image.as_ref()).collect();
    let images = spread(stored);
    let alternatives = || ALTERNATIVES.iter().flat_map(|source| source(target, &images));
    alternatives().find_map(|alternative| confirmed(alternative, &images))
}

/// The faults of a declared board of tags of which frames show little, where `markers` are those that were found in each of
/// `frames`, and the mended board shows clearly more; `None` where the board is as declared, or may be.
pub fn board_cause_of_few_markers(
    target: &Target,
    frames: &[RawFrame],
    markers: &[Vec<MarkerObservation>],
) -> Option<BoardCause> {
    /// Share of the board's markers in the median frame from which on nothing is doubted.
    const MANY: f64 = 0.9;
    /// How many times the markers the mended board has to show.
    const MORE: f64 = 1.25;
    let with_board: Vec<_> =
        frames.iter().zip(markers).filter(|(frame, m)| frame.image.is_some() && !m.is_empty()).collect();
    let mut shares: Vec<f64> = with_board.iter().map(|(_, m)| m.len() as f64 / target.len().max(1) as f64).collect();
    let has_tags = |pattern: &Pattern| matches!(pattern, Pattern::Charuco { .. } | Pattern::Aprilgrid { .. });
    if !target.parts().iter().all(|part| has_tags(&part.board.pattern)) || upper_median(&mut shares)? >= MANY {
        return None;
    }
    let mean = with_board.iter().map(|(_, m)| m.len() as f64).sum::<f64>() / with_board.len() as f64;
    let images = spread(with_board.into_iter().filter_map(|(frame, _)| frame.image.as_ref()).collect());
    let shows_more = |cause: &BoardCause| cause.markers as f64 > MORE * mean * cause.found as f64;
    tag_board(target, &images).into_iter().filter_map(|alternative| confirmed(alternative, &images)).find(shows_more)
}

/// Some of the images, in their order, small.
fn spread(stored: Vec<&Stored<GrayImage>>) -> Vec<GrayImage> {
    let step = stored.len().div_ceil(IMAGES).max(1);
    let chosen: Vec<_> = stored.into_iter().step_by(step).collect();
    // An image that has become unreadable is reported by what needs it.
    chosen.into_par_iter().filter_map(|image| image.get().ok()).map(small).collect()
}

/// The image, halved until it is small.
fn small(image: Arc<GrayImage>) -> GrayImage {
    let mut image = (*image).clone();
    while image.data.len() > MOST_PIXELS {
        let (width, height) = (image.width / 2, image.height / 2);
        let grey = |x: usize, y: usize| u32::from(image.data[y * image.width + x]);
        let mean = |i: usize| {
            let [x, y] = [2 * (i % width), 2 * (i / width)];
            ((grey(x, y) + grey(x + 1, y) + grey(x, y + 1) + grey(x + 1, y + 1) + 2) / 4) as u16
        };
        let data = (0..width * height).map(mean).collect();
        image = GrayImage { width, height, data, bits: image.bits };
    }
    image
}

/// The mended board is looked for in the images.
fn confirmed(Alternative { target, is_mirrored, faults }: Alternative, images: &[GrayImage]) -> Option<BoardCause> {
    let options = DetectOptions { refine: false, detector: Detector::BuiltIn, ..DetectOptions::default() };
    let markers = |image: &GrayImage| {
        let mut image = image.clone();
        if is_mirrored {
            let width = image.width;
            image.data.chunks_exact_mut(width).for_each(<[u16]>::reverse);
        }
        // A board that cannot be, such as one of two corners, is not found.
        let detection = detect(&image, &target, &options).ok().flatten()?;
        Some(detection.markers.len()).filter(|markers| 2 * markers >= target.len().min(24))
    };
    let markers: Vec<usize> = images.par_iter().filter_map(markers).collect();
    let (found_in, tried) = (markers.len(), images.len());
    let is_confirmed = found_in > 0 && found_in as f64 >= SHARE * tried as f64;
    is_confirmed.then(|| BoardCause { faults, found: found_in, markers: markers.iter().sum(), tried })
}

/// The chessboard whose size most images agree on.
fn chessboard(declared: &Target, images: &[GrayImage]) -> Vec<Alternative> {
    let sizes: Vec<[usize; 2]> = images.par_iter().filter_map(chessboard_size).collect();
    let sorted = |mut size: [usize; 2]| {
        size.sort_unstable();
        size
    };
    let count = |size: &[usize; 2]| sizes.iter().filter(|other| sorted(**other) == sorted(*size)).count();
    let Some(size) = sizes.iter().max_by_key(|size| count(size)) else { return Vec::new() };
    let is_chessboard = declared.pattern == Pattern::Chessboard;
    let declared_size = [declared.columns, declared.rows];
    if 2 * count(size) <= images.len() || (is_chessboard && sorted(declared_size) == sorted(*size)) {
        return Vec::new();
    }
    // The longer side is the one that is declared longer.
    let [low, high] = sorted(*size);
    let [columns, rows] = if declared.columns >= declared.rows { [high, low] } else { [low, high] };
    let mut faults = Vec::new();
    if !is_chessboard {
        let evidence = format!("the images show a chessboard of {columns} × {rows} inner corners without legible tags");
        faults.push(BoardFault::Kind { kind: "chessboard", evidence });
    }
    let explanation = match [declared.columns, declared.rows] {
        [c, r] if [c, r] == [columns + 1, rows + 1] => "inner corners are counted, not squares",
        [c, r] if [c + 1, r + 1] == [columns, rows] => "inner corners are counted, those of the outer squares too",
        _ => "inner corners as counted in the images",
    };
    if declared_size != [columns, rows] {
        faults.push(BoardFault::Size { columns, rows, explanation });
    }
    let target = Target { pattern: Pattern::Chessboard, columns, rows, spacing_mm: declared.spacing_mm };
    vec![Alternative { target, is_mirrored: false, faults }]
}

/// Grids of dots of either kind with the declared numbers, exchanged, or off by one. None where the images show a chessboard,
/// whose dark squares lie like dots.
fn circles(declared: &Target, images: &[GrayImage]) -> Vec<Alternative> {
    let is_chessboard = || 2 * images.par_iter().filter_map(chessboard_size).count() > images.len();
    if !declared.has_circles() && (declared.pattern != Pattern::Chessboard || is_chessboard()) {
        return Vec::new();
    }
    let (columns, rows) = (declared.columns, declared.rows);
    let sizes = [
        ([columns, rows], ""),
        ([rows, columns], "columns and rows are exchanged"),
        ([columns.saturating_sub(1), rows.saturating_sub(1)], "dots are counted"),
        ([columns + 1, rows + 1], "dots are counted"),
        ([columns.div_ceil(2), rows], "an asymmetric grid has every other dot of a row"),
    ];
    let kinds = [
        ("asymmetric-circles", Pattern::AsymmetricCircles { circle_diameter_mm: 0.0 }),
        ("symmetric-circles", Pattern::SymmetricCircles { circle_diameter_mm: 0.0 }),
    ];
    let is_declared = |kind: &str| match declared.pattern {
        Pattern::AsymmetricCircles { .. } => kind == "asymmetric-circles",
        Pattern::SymmetricCircles { .. } => kind == "symmetric-circles",
        _ => false,
    };
    let mut alternatives = Vec::new();
    for ([columns, rows], explanation) in sizes {
        for (kind, pattern) in &kinds {
            let mut faults = Vec::new();
            if !is_declared(kind) {
                faults.push(BoardFault::Kind {
                    kind,
                    evidence: "the images show a grid of dots of another kind".to_owned(),
                });
            }
            if !explanation.is_empty() {
                faults.push(BoardFault::Size { columns, rows, explanation });
            }
            if !faults.is_empty() {
                let target = Target { pattern: pattern.clone(), columns, rows, spacing_mm: declared.spacing_mm };
                alternatives.push(Alternative { target, is_mirrored: false, faults });
            }
        }
    }
    alternatives.sort_by_key(|alternative| alternative.faults.len());
    alternatives
}
