//! The camera that a dataset declares, to start from or to keep.

use std::path::PathBuf;

use depthcal_io::{CameraFileError, DatasetCamera, FileLens, IntrinsicNumbers, Intrinsics, read_camera};
use depthcal_model::{Block, Camera, Register, RegisterError};
use thiserror::Error;

use crate::calibrate::{AUTO, lens_named};

/// Pixels over the image at which a lens is fitted to that of the declared camera, columns and rows.
const GRID: [usize; 2] = [41, 31];

/// Why a dataset declares no camera that can be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum DeclaredCameraError {
    /// The file of `camera.intrinsics` is at fault.
    #[error("`camera.intrinsics`: {0}")]
    File(#[from] CameraFileError),
    /// The lens model is unknown.
    #[error("the lens: {0}")]
    Lens(#[from] RegisterError),
    /// The declared camera has images of another size.
    #[error(
        "{}: `camera.intrinsics` is for images of {}×{} px, but the dataset's are {}×{} px: give the intrinsics of this size",
        dataset.display(), declared[0], declared[1], found[0], found[1]
    )]
    Size {
        /// The dataset's folder.
        dataset: PathBuf,
        /// Size in the file, px.
        declared: [usize; 2],
        /// Size of the images, px.
        found: [usize; 2],
    },
    /// Fixed intrinsics with another lens than their own.
    #[error(
        "{}: the intrinsics in [camera] are fixed and have the lens {declared}, but {asked} was asked for: leave out `lens`, or `fixed`",
        dataset.display()
    )]
    FixedLens {
        /// The dataset's folder.
        dataset: PathBuf,
        /// Piece of their lens.
        declared: String,
        /// The lens asked for.
        asked: String,
    },
}

/// The camera that a dataset declares, for images of `width` by `height` px, from numbers or from a file; `None` where it
/// declares no intrinsics. Where another lens model than that of the intrinsics is asked for, or declared, it starts at its
/// nearest to them.
///
/// # Errors
///
/// [`DeclaredCameraError`].
pub fn declared_camera(
    dataset: &DatasetCamera,
    width: usize,
    height: usize,
    asked_lens: Option<&str>,
    register: &Register,
) -> Result<Option<Camera>, DeclaredCameraError> {
    let Some(hint) = &dataset.camera else { return Ok(None) };
    let lens = asked_lens.or(hint.lens.as_deref());
    let intrinsics = match (&hint.numbers, &hint.intrinsics) {
        (Some(numbers), _) => of_numbers(numbers, hint.lens.as_deref()),
        (None, Some(file)) => read_camera(dataset.root.join(file))?,
        (None, None) => return Ok(None),
    };
    let image_size = [width, height];
    if let Some(declared) = intrinsics.size.filter(|size| *size != image_size) {
        return Err(DeclaredCameraError::Size { dataset: dataset.root.clone(), declared, found: image_size });
    }
    let camera = intrinsics.camera(image_size, register)?;
    let declared_lens = intrinsics.lens.as_ref().map_or("none", |lens| lens.piece);
    if hint.fixed {
        if let Some(asked) = lens.filter(|lens| *lens != AUTO) {
            let piece = lens_named(asked, register)?.map_or("none", |block| block.name());
            if piece != declared_lens {
                let (declared, asked) = (declared_lens.to_owned(), asked.to_owned());
                return Err(DeclaredCameraError::FixedLens { dataset: dataset.root.clone(), declared, asked });
            }
        }
        return Ok(Some(camera.map_blocks(Block::hold)));
    }
    let lens = match lens {
        // The comparison has start values of its own.
        Some(AUTO) => return Ok(None),
        // A pinhole that is a start value alone says nothing of the lens.
        None if declared_lens == "none" => Some("brown_conrady"),
        asked => asked,
    };
    let Some(lens) = lens else { return Ok(Some(camera)) };
    let blocks: Vec<Block> = lens_named(lens, register)?.into_iter().collect();
    let [fx, fy, cx, cy, _] = camera.pinhole();
    let (rays, pixels) = camera.rays_over_image(GRID[0], GRID[1]);
    Ok(Some(Camera::new(width, height, [fx, fy, cx, cy, camera.pinhole()[4]], blocks).fitted_to_rays(&rays, &pixels)))
}

/// Intrinsics from numbers. Without a lens of their own, up to five coefficients are those of Brown and Conrady, all of which are
/// part of the camera.
fn of_numbers(numbers: &IntrinsicNumbers, lens: Option<&str>) -> Intrinsics {
    let k = &numbers.distortion;
    let fisheye = lens.is_some_and(|lens| lens.replace('-', "_") == "kannala_brandt");
    let lens = match <[f64; 4]>::try_from(k.as_slice()) {
        Ok(k) if fisheye => FileLens::fisheye(k),
        _ if k.len() <= 5 => {
            let mut values = k.clone();
            values.resize(5, 0.0);
            FileLens { piece: "brown_conrady", values }
        }
        _ => FileLens { piece: "opencv_lens", values: k.clone() },
    };
    let pinhole = [numbers.fx, numbers.fy, numbers.cx, numbers.cy, numbers.skew];
    Intrinsics { size: None, pinhole, lens: Some(lens) }
}

#[cfg(test)]
mod tests {
    use depthcal_io::{DATASET_FILE, Dataset};

    use super::*;

    fn declared(camera: &str, lens: Option<&str>) -> Result<Option<Camera>, DeclaredCameraError> {
        let folder = tempfile::tempdir().unwrap();
        let board =
            "[board]\nkind = \"chessboard\"\ncolumns = 9\nrows = 6\nspacing_mm = 20\n[frames]\nimage = \"*.png\"\n";
        std::fs::write(folder.path().join(DATASET_FILE), format!("{board}[camera]\n{camera}\n")).unwrap();
        std::fs::write(folder.path().join("image.png"), "").unwrap();
        std::fs::write(
            folder.path().join("factory.yaml"),
            "cam0:\n  camera_model: pinhole\n  intrinsics: [300, 301, 319, 240]\n  distortion_model: equi\n  \
             distortion_coeffs: [0.01, 0.002, 0, 0]\n  resolution: [640, 480]\n",
        )
        .unwrap();
        let dataset = Dataset::open(folder.path()).unwrap().cameras.remove(0);
        declared_camera(&dataset, 640, 480, lens, &Register::builtin())
    }

    const NUMBERS: &str = "fx = 500\nfy = 501\ncx = 320\ncy = 240";

    #[test]
    fn numbers_are_a_brown_conrady_camera() {
        let camera = declared(&format!("{NUMBERS}\ndistortion = [-0.1, 0.02, 0, 0]"), None).unwrap().unwrap();
        let lens = camera.block("brown_conrady").unwrap();
        assert_eq!((lens.theta.as_slice(), lens.free.as_slice()), (&[-0.1, 0.02, 0.0, 0.0, 0.0][..], &[true; 5][..]));
        let eight = format!("{NUMBERS}\ndistortion = [1, 2, 3, 4, 5, 6, 7, 8]\nfixed = true");
        let camera = declared(&eight, None).unwrap().unwrap();
        assert_eq!(camera.block("opencv_lens").unwrap().theta[7], 8.0);
        assert!(camera.blocks().iter().all(|b| b.free.iter().all(|free| !free)));
    }

    #[test]
    fn a_file_gives_its_lens_or_the_nearest_of_another() {
        let file = "intrinsics = \"factory.yaml\"";
        let from_file = declared(file, None).unwrap().unwrap();
        assert_eq!(from_file.block("kannala_brandt").unwrap().theta, [0.01, 0.002, 0.0, 0.0]);
        let other = declared(&format!("{file}\nlens = \"opencv8\""), None).unwrap().unwrap();
        assert_eq!(other.block("opencv_lens").unwrap().free.iter().filter(|f| **f).count(), 8);
        for pixel in [[0.0, 0.0], [639.0, 479.0], [320.0, 100.0]] {
            let [x, y] = from_file.ray(pixel, 1e-3).unwrap();
            let [u, v] = other.project(&nalgebra::Vector3::new(x, y, 1.0)).unwrap();
            assert!((u - pixel[0]).hypot(v - pixel[1]) < 0.05, "{pixel:?}: {u} {v}");
        }
        assert!(declared(file, Some(AUTO)).unwrap().is_none());
        let fixed = declared(&format!("{file}\nfixed = true"), Some("brown-conrady")).unwrap_err().to_string();
        assert!(fixed.contains("kannala_brandt") && fixed.contains("leave out"), "{fixed}");
        let missing = declared("intrinsics = \"none.yml\"", None).unwrap_err().to_string();
        assert!(missing.contains("none.yml"), "{missing}");
        assert!(declared("lens = \"division\"", None).unwrap().is_none());
    }
}
