//! Depth images as files have them: whole steps of 16 bits or floating-point numbers.

use std::path::Path;

use super::error::ImageError;
use super::raster::DepthImage;

/// A depth image, row-major, in its dataset's unit.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthFrame {
    /// Width in px.
    pub width: usize,
    /// Height in px.
    pub height: usize,
    /// `height` × `width` values.
    pub values: DepthValues,
}

/// Values of a depth image, in units of the dataset's `unit_mm`.
#[derive(Debug, Clone, PartialEq)]
pub enum DepthValues {
    /// Whole steps; 0 and 65535 mean no measurement.
    Steps(Vec<u16>),
    /// Floating-point numbers; NaN, infinity, 0 and what is below mean no measurement.
    Float(Vec<f32>),
}

/// Largest plausible unit of whole steps, mm: with metres per step nothing would be left of depth.
const LARGEST_STEP_MM: f64 = 50.0;

impl DepthFrame {
    /// The measurement of pixel `index` (row-major) in units; `None` where there is none.
    pub fn measurement(&self, index: usize) -> Option<f64> {
        match &self.values {
            DepthValues::Steps(values) => {
                values.get(index).copied().filter(|raw| DepthImage::is_measurement(*raw)).map(f64::from)
            }
            DepthValues::Float(values) => {
                values.get(index).copied().filter(|z| z.is_finite() && *z > 0.0).map(f64::from)
            }
        }
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        match &self.values {
            DepthValues::Steps(values) => values.len(),
            DepthValues::Float(values) => values.len(),
        }
    }

    /// Whether it has no pixels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes that the values take in memory.
    pub fn bytes(&self) -> usize {
        match &self.values {
            DepthValues::Steps(values) => size_of_val(&values[..]),
            DepthValues::Float(values) => size_of_val(&values[..]),
        }
    }

    /// Checks that a unit fits the type of the values; `path` is for the error's message.
    ///
    /// # Errors
    /// [`ImageError::Unsupported`] for whole steps of more than 50 mm, which are usually millimetres declared as metres.
    pub fn check_unit(&self, path: &Path, unit_mm: f64) -> Result<(), ImageError> {
        if matches!(self.values, DepthValues::Float(_)) || unit_mm <= LARGEST_STEP_MM {
            return Ok(());
        }
        let problem = format!(
            "the image holds whole steps, which cannot be {unit_mm} mm each: write the millimetres per step, such as unit_mm = 1.0; \
             unit_mm = 1000 is for floating-point metres"
        );
        Err(ImageError::Unsupported { path: path.to_owned(), problem })
    }
}

impl From<DepthImage> for DepthFrame {
    fn from(image: DepthImage) -> Self {
        let DepthImage { width, height, data } = image;
        DepthFrame { width, height, values: DepthValues::Steps(data) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_a_measurement() {
        let steps = DepthFrame::from(DepthImage { width: 3, height: 1, data: vec![0, 65535, 7] });
        assert_eq!([0, 1, 2, 3].map(|i| steps.measurement(i)), [None, None, Some(7.0), None]);
        let values = vec![0.0, -1.0, f32::NAN, f32::INFINITY, 0.25];
        let float = DepthFrame { width: 5, height: 1, values: DepthValues::Float(values) };
        assert_eq!([0, 1, 2, 3, 4].map(|i| float.measurement(i)), [None, None, None, None, Some(0.25)]);
        assert!(float.check_unit(Path::new("a"), 1000.0).is_ok());
        assert!(steps.check_unit(Path::new("a.png"), 1000.0).unwrap_err().to_string().contains("unit_mm"));
    }
}
