//! The search for a circle grid.

use depthcal_io::GrayImage;
use depthcal_model::target::Target;

use super::blobs::dark_blobs;
use crate::board::{step_mm, upright};
use crate::detection::{Detection, Marker, Polarity};
use crate::geometry::BoardMap;
use crate::lattice::blob::Blob;
use crate::lattice::labelling::{board_cells, labellings};
use crate::lattice::neighbourhood::{Lattice, Neighbourhood};
use crate::stretch::{Plane, Stretch};

/// Number of candidates searched, those of highest contrast, which include the board's dots.
const MAX_BLOBS: usize = 3000;
/// Number of proposed bases that are grown before the search gives up.
const MAX_PROPOSALS: usize = 6000;
/// Largest rms distance of the dots from the fitted map, in steps of the lattice.
const MAX_RMS: f64 = 0.06;
/// Largest distance of a single dot from the fitted map, in steps of the lattice.
const MAX_DISTANCE: f64 = 0.2;
/// Largest rms distance of the dots from the homography alone, which leaves the lens' distortion, in steps of the
/// lattice.
const MAX_HOMOGRAPHY_RMS: f64 = 0.2;

/// Searches for the circle grid, with dark dots first. The markers are centroids, not yet refined.
pub(crate) fn find(image: &GrayImage, target: &Target) -> Option<Detection> {
    let board = board_cells(target);
    for &stretch in Stretch::candidates(image) {
        let plane = Plane::stretched(image, stretch);
        let bytes = plane.to_bytes();
        for polarity in [Polarity::DarkOnBright, Polarity::BrightOnDark] {
            let seen = match polarity {
                Polarity::DarkOnBright => bytes.clone(),
                Polarity::BrightOnDark => bytes.iter().map(|v| 255 - v).collect(),
            };
            let blobs = dark_blobs(&seen, plane.width, plane.height, MAX_BLOBS);
            if let Some(markers) = find_among(&blobs, image.width, target, &board) {
                return Some(Detection { markers, polarity, charuco_layout: None });
            }
        }
    }
    None
}

fn find_among(blobs: &[Blob], width: usize, target: &Target, board: &[[i32; 2]]) -> Option<Vec<Marker>> {
    let hood = Neighbourhood::new(blobs, width);
    steps_in_radii(target).into_iter().find_map(|step| find_with_step(blobs, &hood, target, board, step))
}

/// Distances of neighbouring dots, in radii of a dot, for which lattices are grown. Each covers dots from 0.67 to 1.67
/// times its own size; where the size is not known, both together those from 0.17 to 1 distance in diameter.
fn steps_in_radii(target: &Target) -> Vec<f64> {
    match target.circle_diameter_mm() {
        Some(diameter_mm) => vec![2.0 * step_mm(target) / diameter_mm],
        None => vec![2.0 / 0.6, 2.0 / 0.25],
    }
}

fn find_with_step(
    blobs: &[Blob],
    hood: &Neighbourhood,
    target: &Target,
    board: &[[i32; 2]],
    step_in_radii: f64,
) -> Option<Vec<Marker>> {
    let mut proposals = 0;
    for seed in 0..blobs.len() {
        for basis in hood.bases(seed, step_in_radii) {
            proposals += 1;
            if proposals > MAX_PROPOSALS {
                return None;
            }
            let lattice = hood.grow(seed, basis);
            let best = labellings_that_fit(&lattice, blobs, target, board);
            if best.is_some() {
                return best;
            }
        }
    }
    None
}

/// The labelling that passes [`verify`]; of several, because the board looks the same after a turn, the most upright.
fn labellings_that_fit(lattice: &Lattice, blobs: &[Blob], target: &Target, board: &[[i32; 2]]) -> Option<Vec<Marker>> {
    labellings(lattice, board)
        .into_iter()
        .filter_map(|places| {
            let labelled: Vec<(usize, &Blob)> = places
                .iter()
                .enumerate()
                .filter_map(|(index, place)| lattice.get(place).map(|&blob| (index, &blobs[blob])))
                .collect();
            let upright = verify(&labelled, target)?;
            let markers = labelled.iter().map(|(index, blob)| Marker { index: *index, pixel: blob.center }).collect();
            Some((upright, markers))
        })
        .max_by(|a: &(f64, Vec<Marker>), b| a.0.total_cmp(&b.0))
        .map(|(_, markers)| markers)
}

/// Checks a labelling against a smooth map from the board and against the size of the dots; returns how upright the
/// board is ([`upright`]), or `None` when a check fails.
fn verify(labelled: &[(usize, &Blob)], target: &Target) -> Option<f64> {
    let pairs: Vec<_> = labelled.iter().map(|(index, blob)| (target.point(*index), blob.center)).collect();
    let map = BoardMap::fit(&pairs)?;
    let homography = *map.homography();
    let step = step_mm(target);
    let (mut squares, mut homography_squares) = (0.0, 0.0);
    let mut scales = Vec::with_capacity(labelled.len());
    for ((board, pixel), (_, blob)) in pairs.iter().zip(labelled) {
        let mapped = map.apply(*board)?;
        let (x, y) = (map.apply([board[0] + 1.0, board[1]])?, map.apply([board[0], board[1] + 1.0])?);
        let (x, y) = ([x[0] - mapped[0], x[1] - mapped[1]], [y[0] - mapped[0], y[1] - mapped[1]]);
        let step_px = step * x[0].hypot(x[1]).min(y[0].hypot(y[1]));
        let distance = (mapped[0] - pixel[0]).hypot(mapped[1] - pixel[1]);
        // 0.35 px: the uncertainty of centroids of small dots.
        if distance > MAX_DISTANCE * step_px + 0.35 {
            return None;
        }
        squares += (distance / (step_px + 6.0)).powi(2);
        let plain = homography.apply(*board)?;
        homography_squares += ((plain[0] - pixel[0]).hypot(plain[1] - pixel[1]) / step_px).powi(2);
        let determinant = x[0] * y[1] - x[1] * y[0];
        if determinant <= 0.0 {
            return None;
        }
        scales.push(blob.area / determinant);
    }
    let n = labelled.len() as f64;
    if (squares / n).sqrt() > MAX_RMS || (homography_squares / n).sqrt() > MAX_HOMOGRAPHY_RMS {
        return None;
    }
    // All dots of a board are printed in the same size.
    let mut sorted = scales.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[sorted.len() / 2];
    if scales.iter().any(|s| !(0.45..2.2).contains(&(s / median))) {
        return None;
    }
    upright(target, |p| homography.apply(p))
}
