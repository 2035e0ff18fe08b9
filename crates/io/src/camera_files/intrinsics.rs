//! Pinhole and lens of a camera, as files of other programs hold them.

use depthcal_model::{Block, Camera, Register, RegisterError};

use crate::image::MAX_PIXELS;

/// Pinhole and lens of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Intrinsics {
    /// Width and height of its images, px; `None` where the file has none.
    pub size: Option<[usize; 2]>,
    /// fx, fy, cx, cy, skew, px.
    pub pinhole: [f64; 5],
    /// Its lens; `None` for a camera without distortion.
    pub lens: Option<FileLens>,
}

/// A lens: a piece of depthcal with the values of its first parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct FileLens {
    /// Name of the piece.
    pub piece: &'static str,
    /// Values of its first parameters; the others are zero and not part of the lens.
    pub values: Vec<f64>,
}

impl FileLens {
    /// OpenCV's distortion coefficients in their order: 4 or 5 for Brown–Conrady, 8, 12 or 14 for the larger models; `None` for
    /// another number of them.
    pub fn opencv(coefficients: &[f64]) -> Option<Self> {
        let piece = match coefficients.len() {
            4 | 5 => "brown_conrady",
            8 | 12 | 14 => "opencv_lens",
            _ => return None,
        };
        Some(Self { piece, values: coefficients.to_vec() })
    }

    /// k1 to k4 of a fisheye lens.
    pub fn fisheye(coefficients: [f64; 4]) -> Self {
        Self { piece: "kannala_brandt", values: coefficients.to_vec() }
    }
}

/// Width and height of an image, px, from numbers of a file; `None` where they are none, or of more pixels than any image that is
/// read.
pub(super) fn size_px(width: f64, height: f64) -> Option<[usize; 2]> {
    let is_count = |n: f64| n >= 1.0 && n.fract() == 0.0;
    (is_count(width) && is_count(height) && width * height <= MAX_PIXELS as f64)
        .then_some([width as usize, height as usize])
}

impl Intrinsics {
    /// The camera with images of this size (px) where the file has none; its parameters are free but for the skew and those
    /// that the file's lens does not have.
    ///
    /// # Errors
    /// [`RegisterError`] where `register` lacks the piece of its lens.
    pub fn camera(&self, size: [usize; 2], register: &Register) -> Result<Camera, RegisterError> {
        let lens = self.lens.as_ref().map(|lens| {
            let mut block = register.block(lens.piece, None)?;
            let n = lens.values.len().min(block.theta.len());
            block.theta[..n].copy_from_slice(&lens.values[..n]);
            block.free.iter_mut().skip(n).for_each(|free| *free = false);
            Ok(block)
        });
        let lens: Vec<Block> = lens.transpose()?.into_iter().collect();
        let [width, height] = self.size.unwrap_or(size);
        Ok(Camera::new(width, height, self.pinhole, lens))
    }
}
