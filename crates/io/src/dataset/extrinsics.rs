//! Known extrinsics of a camera of a rig in `dataset.toml`.

use nalgebra::{Matrix3, Matrix3x4};

use super::error::DatasetError;
use super::section::{Field, Section};

/// Largest entry of |RᵀR − 1|: rounding of a file to four digits.
const ROUNDING: f64 = 1e-3;
/// Largest entry: a translation of 100 m.
const LARGEST_MM: f64 = 1e5;
/// Known extrinsics.
pub(super) const EXTRINSICS: Field = Field {
    key: "camera_from_rig",
    remedy: "give 12 or 16 numbers, the matrix [R t] or [R t; 0 0 0 1] by rows, which maps coordinates of the first camera to those of \
             this one in mm, or leave it out to have it estimated",
};

/// Extrinsics that are expected.
pub(super) const EXPECTED: Field = Field {
    key: "expected_from_rig",
    remedy: "give 12 or 16 numbers, the matrix [R t] or [R t; 0 0 0 1] by rows, which maps coordinates of the first camera to those of \
             this one in mm, or leave it out",
};

/// The rows of (R | t) that a section declares under a key; the reference has none.
pub(super) fn extrinsics_from(
    camera: &Section<'_>,
    field: Field,
    is_reference: bool,
) -> Result<Option<[f64; 12]>, DatasetError> {
    let Some(numbers) = camera.numbers(field, LARGEST_MM)? else { return Ok(None) };
    let fault = |problem: &str| Err(camera.fault(camera.required(field)?, field, problem));
    if is_reference {
        return fault("stands in the section of the first camera, whose coordinates are those of the rig");
    }
    let rows: Option<[f64; 12]> = match &numbers[..] {
        [rows @ .., 0.0, 0.0, 0.0, 1.0] if numbers.len() == 16 => rows.try_into().ok(),
        rows => rows.try_into().ok(),
    };
    let Some(rows) = rows else { return fault("is no such matrix") };
    let rotation: Matrix3<f64> = Matrix3x4::from_row_slice(&rows).fixed_columns::<3>(0).into_owned();
    let deviation = (rotation.transpose() * rotation - Matrix3::identity()).amax();
    if deviation > ROUNDING || rotation.determinant() < 0.0 {
        return fault("has no rotation in its first three columns");
    }
    Ok(Some(rows))
}
