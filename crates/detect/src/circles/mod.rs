//! Circle grids: dots from the component tree, a lattice over them, the board in the lattice.
//!
//! OpenCV's blob detector thresholds the whole image at a few levels and its grid finder wants the board's dots and
//! little else, so dots below ten pixels, uneven light and clutter defeat them; these stages do not mind them.

pub(crate) mod blobs;
pub(crate) mod labelling;
pub(crate) mod lattice;
mod tree;

use depthcal_io::GrayImage;
use depthcal_model::target::{Pattern, Target};

use crate::detection::{Detection, Marker, Polarity};
use crate::geometry::BoardMap;
use crate::stretch::{Plane, Stretch};
use blobs::Blob;
use lattice::{Lattice, Neighbourhood};

/// Candidates that are looked at; the board's dots are among the strongest.
const MAX_BLOBS: usize = 3000;
/// Proposals for a basis that are grown before the search is given up.
const MAX_PROPOSALS: usize = 6000;
/// Largest rms and single distance of a dot from the fitted map, in steps of the lattice.
const MAX_RMS: f64 = 0.06;
const MAX_DISTANCE: f64 = 0.2;
/// The homography alone, lens and all, in steps of the lattice.
const MAX_HOMOGRAPHY_RMS: f64 = 0.2;

/// Looks for the circle grid, dark dots first.
pub(crate) fn find(image: &GrayImage, target: &Target) -> Option<Detection> {
    let board = labelling::board_cells(target);
    for &stretch in Stretch::candidates(image) {
        let bytes = Plane::stretched(image, stretch).to_bytes();
        for polarity in [Polarity::DarkOnBright, Polarity::BrightOnDark] {
            let seen = match polarity {
                Polarity::DarkOnBright => bytes.clone(),
                Polarity::BrightOnDark => bytes.iter().map(|v| 255 - v).collect(),
            };
            let blobs = blobs::dark_blobs(&seen, image.width, image.height, MAX_BLOBS);
            if let Some(markers) = find_among(&blobs, image.width, target, &board) {
                return Some(Detection { markers, polarity });
            }
        }
    }
    None
}

/// Step between neighbouring dots in mm.
pub(crate) fn step_mm(target: &Target) -> f64 {
    match target.pattern {
        Pattern::AsymmetricCircles { .. } => target.spacing_mm * std::f64::consts::SQRT_2,
        _ => target.spacing_mm,
    }
}

fn find_among(blobs: &[Blob], width: usize, target: &Target, board: &[[i32; 2]]) -> Option<Vec<Marker>> {
    let hood = Neighbourhood::new(blobs, width);
    let step_in_radii = 2.0 * step_mm(target) / target.circle_diameter_mm()?;
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

/// The labelling that passes the checks; among those of a board that looks the same after a turn, the most upright.
fn labellings_that_fit(lattice: &Lattice, blobs: &[Blob], target: &Target, board: &[[i32; 2]]) -> Option<Vec<Marker>> {
    labelling::labellings(lattice, board)
        .into_iter()
        .filter_map(|places| {
            let found: Vec<(usize, &Blob)> = places
                .iter()
                .enumerate()
                .filter_map(|(index, place)| lattice.get(place).map(|&blob| (index, &blobs[blob])))
                .collect();
            let upright = verify(&found, target)?;
            let markers = found.iter().map(|(index, blob)| Marker { index: *index, pixel: blob.center }).collect();
            Some((upright, markers))
        })
        .max_by(|a: &(f64, Vec<Marker>), b| a.0.total_cmp(&b.0))
        .map(|(_, markers)| markers)
}

/// Checks a labelling against a smooth map from the board and against the size of the dots; returns how upright the
/// board is: the cosine between its rows and the image's plus that of its columns.
fn verify(found: &[(usize, &Blob)], target: &Target) -> Option<f64> {
    let pairs: Vec<_> = found.iter().map(|(index, blob)| (target.point(*index), blob.center)).collect();
    let map = BoardMap::fit(&pairs)?;
    let homography = *map.homography();
    let step = step_mm(target);
    let (mut squares, mut homography_squares) = (0.0, 0.0);
    let mut scales = Vec::with_capacity(found.len());
    for ((board, pixel), (_, blob)) in pairs.iter().zip(found) {
        let at = map.apply(*board)?;
        let (x, y) = (map.apply([board[0] + 1.0, board[1]])?, map.apply([board[0], board[1] + 1.0])?);
        let (x, y) = ([x[0] - at[0], x[1] - at[1]], [y[0] - at[0], y[1] - at[1]]);
        let step_px = step * x[0].hypot(x[1]).min(y[0].hypot(y[1]));
        let distance = (at[0] - pixel[0]).hypot(at[1] - pixel[1]);
        // A third of a pixel is what the rough centres of small dots are worth.
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
    let n = found.len() as f64;
    if (squares / n).sqrt() > MAX_RMS || (homography_squares / n).sqrt() > MAX_HOMOGRAPHY_RMS {
        return None;
    }
    // Dots of one board have one size on it.
    let mut sorted = scales.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[sorted.len() / 2];
    if scales.iter().any(|s| !(0.45..2.2).contains(&(s / median))) {
        return None;
    }
    upright(target, |p| homography.apply(p))
}

/// How upright a board is seen: the cosine between its rows and the image's, plus the same for its columns.
pub(crate) fn upright(target: &Target, pixel: impl Fn([f64; 2]) -> Option<[f64; 2]>) -> Option<f64> {
    let middle = target.point(target.len() / 2);
    let at = pixel(middle)?;
    let x = pixel([middle[0] + target.spacing_mm, middle[1]])?;
    let y = pixel([middle[0], middle[1] + target.spacing_mm])?;
    let (x, y) = ([x[0] - at[0], x[1] - at[1]], [y[0] - at[0], y[1] - at[1]]);
    Some(x[0] / x[0].hypot(x[1]) + y[1] / y[0].hypot(y[1]))
}
