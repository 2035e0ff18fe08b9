//! Markers that another program found, in place of detected ones.

use std::path::Path;

use depthcal_io::{DatasetCamera, ImageCorners, read_corners};
use depthcal_model::{Pattern, Target};
use depthcal_statistics::upper_median;
use nalgebra::{Matrix3, Vector3};
use tracing::warn;

use super::error::LoadError;
use super::found::Found;
use super::given_markers_error::GivenMarkersError;
use crate::observe::MarkerObservation;

/// The markers of the dataset's frames, in order, from a file of corners; `size` is the width and height of the images, px.
pub(crate) fn given_markers(file: &Path, dataset: &DatasetCamera, size: (usize, usize)) -> Result<Found, LoadError> {
    let images = read_corners(file)?;
    let target = &dataset.target;
    if target.has_circles() && target.circle_diameter_mm().is_none() {
        return Err(GivenMarkersError::Diameter { root: dataset.root.clone() }.into());
    }
    let mut used = vec![false; images.len()];
    let mut markers = Vec::with_capacity(dataset.frames.len());
    for frame in &dataset.frames {
        let path = frame.image.as_deref().unwrap_or(Path::new(""));
        markers.push(match entry_of(file, path, &images)? {
            Some(index) => {
                used[index] = true;
                of_image(file, &images[index], target, [size.0, size.1])?
            }
            None => Vec::new(),
        });
    }
    let unused: Vec<&ImageCorners> = images.iter().zip(&used).filter(|(_, used)| !**used).map(|(i, _)| i).collect();
    if unused.len() == images.len() {
        let example = images.first().map_or("no image".to_owned(), |i| i.image.clone());
        let (file, root) = (file.to_owned(), dataset.root.clone());
        return Err(GivenMarkersError::NoImage { file, root, example }.into());
    }
    if let Some(first) = unused.first() {
        let (count, name) = (unused.len(), &dataset.title);
        warn!("{}: {count} of its images are not in {name}, the first is {}", file.display(), first.image);
    }
    // Relative to the median marker, so that the noise of a typical marker is the adjustment's pixel sigma.
    let mut stds: Vec<f64> = markers.iter().flatten().map(|m: &MarkerObservation| m.std_px).collect();
    if let Some(median) = upper_median(&mut stds) {
        markers.iter_mut().flatten().for_each(|m| m.std_px /= median);
    }
    Ok(Found { markers, ..Found::default() })
}

/// The entry whose path has most of its last parts in common with an image's, the file name at least.
fn entry_of(file: &Path, image: &Path, images: &[ImageCorners]) -> Result<Option<usize>, LoadError> {
    let common = |name: &str| {
        let pairs = Path::new(name).components().rev().zip(image.components().rev());
        pairs.take_while(|(a, b)| a == b).count()
    };
    let rated: Vec<usize> = images.iter().map(|i| common(&i.image)).collect();
    let best = rated.iter().copied().max().unwrap_or(0);
    let mut of_best = (0..images.len()).filter(|&i| best > 0 && rated[i] == best);
    let (first, second) = (of_best.next(), of_best.next());
    if let (Some(a), Some(b)) = (first, second) {
        let (a, b) = (&images[a], &images[b]);
        return Err(GivenMarkersError::Ambiguous {
            file: file.to_owned(),
            first: a.image.clone(),
            second: b.image.clone(),
            lines: [a.lines[0], b.lines[0]],
            image: image.to_owned(),
        }
        .into());
    }
    Ok(first)
}

/// The board's grid of corners, columns and rows.
fn grid(target: &Target) -> [usize; 2] {
    match target.pattern {
        Pattern::Charuco { .. } => [target.columns.saturating_sub(1), target.rows.saturating_sub(1)],
        Pattern::Aprilgrid { .. } => [2 * target.columns, 2 * target.rows],
        _ => [target.columns, target.rows],
    }
}

/// Index on the board of the corner at `place` in the file, which goes through the grid row by row.
fn index_of(target: &Target, place: usize) -> usize {
    match target.pattern {
        // Corners of a tag are numbered together, clockwise from the top left.
        Pattern::Aprilgrid { .. } => {
            let (column, row) = (place % (2 * target.columns), place / (2 * target.columns));
            let tag = row / 2 * target.columns + column / 2;
            4 * tag + [[0, 1], [3, 2]][row % 2][column % 2]
        }
        _ => place,
    }
}

fn of_image(
    file: &Path,
    entry: &ImageCorners,
    target: &Target,
    size: [usize; 2],
) -> Result<Vec<MarkerObservation>, LoadError> {
    let (got, need) = (entry.corners.len(), target.len());
    if got == 0 {
        return Ok(Vec::new());
    }
    if got != need {
        let [columns, rows] = grid(target);
        let (file, image) = (file.to_owned(), entry.image.clone());
        return Err(GivenMarkersError::Count { file, line: entry.lines[0], image, got, need, columns, rows }.into());
    }
    let mut markers = Vec::new();
    for (place, corner) in entry.corners.iter().enumerate() {
        let Some(corner) = corner else { continue };
        let inside = (0..2).all(|axis| (-0.5..=size[axis] as f64 - 0.5).contains(&corner.pixel[axis]));
        if !inside {
            let (file, line) = (file.to_owned(), entry.lines[place]);
            return Err(GivenMarkersError::Outside { file, line, pixel: corner.pixel, size }.into());
        }
        let index = index_of(target, place);
        markers.push(MarkerObservation { index, pixel: corner.pixel, std_px: corner.relative_std });
    }
    markers.sort_by_key(|m| m.index);
    if is_mirrored(&markers, target) {
        let (file, image) = (file.to_owned(), entry.image.clone());
        return Err(GivenMarkersError::Mirrored { file, line: entry.lines[0], image }.into());
    }
    Ok(markers)
}

/// Whether the affine map nearest to the markers turns the board over.
pub(super) fn is_mirrored(markers: &[MarkerObservation], target: &Target) -> bool {
    let (mut normal, mut right) = (Matrix3::zeros(), [Vector3::zeros(); 2]);
    for marker in markers {
        let [x, y] = target.point(marker.index);
        let t = Vector3::new(1.0, x / target.spacing_mm, y / target.spacing_mm);
        normal += t * t.transpose();
        for (sum, value) in right.iter_mut().zip(marker.pixel) {
            *sum += t * value;
        }
    }
    let Some(solver) = normal.cholesky() else { return false };
    let [u, v] = right.map(|sum| solver.solve(&sum));
    // Square pixels of a cell of the grid; rounding where all markers are in one place.
    u[1] * v[2] - u[2] * v[1] < -1e-6
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(pattern: Pattern, columns: usize, rows: usize) -> Target {
        Target { pattern, columns, rows, spacing_mm: 20.0 }
    }

    #[test]
    fn places_of_the_file_are_markers_of_the_board_row_by_row() {
        let boards = [
            target(Pattern::Chessboard, 4, 3),
            target(Pattern::AsymmetricCircles { circle_diameter_mm: 8.0 }, 4, 3),
            target(Pattern::Charuco { marker_mm: 10.0, dictionary: "DICT_4X4_50".into() }, 5, 4),
            target(Pattern::Aprilgrid { marker_mm: 12.0 }, 2, 3),
        ];
        for board in boards {
            let [columns, rows] = grid(&board);
            assert_eq!(columns * rows, board.len());
            let points: Vec<[f64; 2]> = (0..board.len()).map(|place| board.point(index_of(&board, place))).collect();
            for (place, pair) in points.windows(2).enumerate() {
                let (a, b) = (pair[0], pair[1]);
                if (place + 1) % columns == 0 {
                    assert!(b[1] > a[1], "{:?}: {place}", board.pattern);
                } else {
                    assert!(b[0] > a[0] && b[1] == a[1], "{:?}: {place}", board.pattern);
                }
            }
        }
    }

    fn corners(pixels: &[Option<[f64; 2]>]) -> ImageCorners {
        let corner = |pixel| depthcal_io::FileCorner { pixel, relative_std: 1.0 };
        ImageCorners {
            image: "a.png".into(),
            lines: (7..7 + pixels.len()).collect(),
            corners: pixels.iter().map(|p| p.map(corner)).collect(),
        }
    }

    #[test]
    fn faults_name_their_line() {
        let board = target(Pattern::Chessboard, 3, 3);
        let file = Path::new("corners.vnl");
        let seen = |mirror: f64| -> Vec<Option<[f64; 2]>> {
            let place = |i: usize| [50.0 + mirror * 10.0 * (i % 3) as f64, 20.0 + 10.0 * (i / 3) as f64];
            (0..9).map(|i| (i != 4).then(|| place(i))).collect()
        };
        let read = |pixels: &[Option<[f64; 2]>]| of_image(file, &corners(pixels), &board, [100, 80]);
        let markers = read(&seen(1.0)).unwrap();
        assert_eq!(markers.iter().map(|m| m.index).collect::<Vec<_>>(), [0, 1, 2, 3, 5, 6, 7, 8]);
        let message = |pixels: &[Option<[f64; 2]>]| read(pixels).unwrap_err().to_string();
        assert!(message(&seen(-1.0)).contains("line 7") && message(&seen(-1.0)).contains("from behind"));
        assert!(message(&seen(1.0)[..8]).contains("8 corners, but the board has 9 (3 rows of 3)"));
        let mut outside = seen(1.0);
        outside[3] = Some([104.0, 30.0]);
        assert!(message(&outside).contains("line 10: (104, 30) is outside"), "{}", message(&outside));
    }

    #[test]
    fn images_are_known_by_the_end_of_their_path() {
        let entry = |name: &str| ImageCorners { image: name.into(), lines: vec![1], corners: Vec::new() };
        let images = [entry("/old/left/0001.png"), entry("right/0001.png"), entry("0002.png")];
        let matching = |path: &str| entry_of(Path::new("c"), Path::new(path), &images);
        assert_eq!(matching("/data/left/0001.png").unwrap(), Some(0));
        assert_eq!(matching("/data/right/0001.png").unwrap(), Some(1));
        assert_eq!(matching("/data/right/0002.png").unwrap(), Some(2));
        assert_eq!(matching("/data/right/0003.png").unwrap(), None);
        let error = matching("/data/ir/0001.png").unwrap_err().to_string();
        assert!(error.contains("may both be"), "{error}");
    }
}
