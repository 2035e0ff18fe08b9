//! Intrinsics and lens declared by a dataset.

use depthcal_model::Technology;
use serde::Serialize;

use super::error::DatasetError;
use super::section::{Field, Section};

/// Keys of intrinsics and lens, in `[camera]` and in `[cameras.NAME]`.
pub(super) const CAMERA_KEYS: &[&str] =
    &["fx", "fy", "cx", "cy", "skew", "distortion", "intrinsics", "lens", "fixed", "technology"];

const FX: Field = Field { key: "fx", remedy: "give the focal length in x, in px" };
const FY: Field = Field { key: "fy", remedy: "give the focal length in y, in px" };
const CX: Field = Field { key: "cx", remedy: "give the column of the principal point, in px" };
const CY: Field = Field { key: "cy", remedy: "give the row of the principal point, in px" };
const SKEW: Field = Field { key: "skew", remedy: "give the skew in px, normally 0" };
const DISTORTION: Field = Field {
    key: "distortion",
    remedy: "give OpenCV's coefficients [k1, k2, p1, p2, k3, …], 4, 5, 8, 12 or 14 of them; with lens = \"kannala-brandt\" [k1, k2, k3, k4]",
};
const INTRINSICS: Field = Field {
    key: "intrinsics",
    remedy: "give a camera file that docs/lenses.md lists, relative to the dataset, and no numbers beside it",
};
const LENS: Field = Field {
    key: "lens",
    remedy: "give a lens model as --lens takes it, such as \"brown-conrady\", \"opencv8\", \"kannala-brandt\" or \"auto\"",
};
const TECHNOLOGY: Field = Field {
    key: "technology",
    remedy: "give the principle of the depth camera, \"time-of-flight\", \"structured-light\" or \"stereo\", or leave it out",
};
const FIXED: Field = Field { key: "fixed", remedy: "write true to hold these values, false to start from them" };

/// The camera in `dataset.toml`: intrinsics, in numbers or from a file of another program, the lens model of a fit, and the
/// technology. At least one of them is given.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct CameraHint {
    /// Pinhole and Brown–Conrady coefficients in numbers.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub numbers: Option<IntrinsicNumbers>,
    /// File of another program, relative to the dataset's folder; `FILE#NAME` for one of several cameras.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<String>,
    /// Lens model that is fitted, as given to `--lens`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lens: Option<String>,
    /// The principle by which it measures depth; effects of others are not searched.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub technology: Option<Technology>,
    /// Whether a fit holds the intrinsics constant; false where the file has no such field.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub fixed: bool,
}

/// Intrinsics in numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IntrinsicNumbers {
    /// Focal length in x, px.
    pub fx: f64,
    /// Focal length in y, px.
    pub fy: f64,
    /// Column of the principal point, px; the centre of the first pixel is 0.
    pub cx: f64,
    /// Row of the principal point, px; the centre of the first pixel is 0.
    pub cy: f64,
    /// Skew, px; 0 where the file has none.
    pub skew: f64,
    /// OpenCV's coefficients in their order, 4, 5, 8, 12 or 14 of them; with `lens = "kannala-brandt"` the four of a fisheye
    /// lens. Empty where the file has none.
    pub distortion: Vec<f64>,
}

fn technology_from(camera: &Section<'_>) -> Result<Option<Technology>, DatasetError> {
    let Some(text) = camera.string(TECHNOLOGY)? else { return Ok(None) };
    match text.parse() {
        Ok(technology) => Ok(Some(technology)),
        Err(_) => {
            let problem = format!("is no principle of a depth camera: '{text}'");
            Err(camera.fault(camera.required(TECHNOLOGY)?, TECHNOLOGY, &problem))
        }
    }
}

/// Intrinsics and lens of a section that has some of these keys.
pub(super) fn camera_from(camera: &Section<'_>) -> Result<CameraHint, DatasetError> {
    let text = |field| Ok::<_, DatasetError>(camera.string(field)?.map(str::to_owned));
    let (intrinsics, lens) = (text(INTRINSICS)?, text(LENS)?);
    let given = [FX, FY, CX, CY, SKEW, DISTORTION].into_iter().find(|field| camera.get(*field).is_some());
    if let (Some(_), Some(field)) = (&intrinsics, given) {
        let problem = "stands beside `intrinsics`: one of them is too many";
        return Err(camera.fault(camera.required(field)?, INTRINSICS, problem));
    }
    let technology = technology_from(camera)?;
    // A section without numbers has a lens, a file or a technology; one of none of them lacks numbers.
    let needs_numbers = given.is_some() || (intrinsics.is_none() && lens.is_none() && technology.is_none());
    let numbers = needs_numbers.then(|| numbers_from(camera, lens.as_deref())).transpose()?;
    Ok(CameraHint { numbers, intrinsics, lens, technology, fixed: camera.boolean(FIXED)?.unwrap_or(false) })
}

fn numbers_from(camera: &Section<'_>, lens: Option<&str>) -> Result<IntrinsicNumbers, DatasetError> {
    const FAR: f64 = 100_000.0;
    let principal = |field| camera.bounded(field, FAR)?.ok_or_else(|| camera.missing(field));
    let distortion = camera.numbers(DISTORTION, 1000.0)?.unwrap_or_default();
    let counts: &[usize] = if lens.is_some_and(is_fisheye) { &[0, 4] } else { &[0, 4, 5, 8, 12, 14] };
    if !counts.contains(&distortion.len()) {
        let expected = if counts.len() == 2 { "4" } else { "4, 5, 8, 12 or 14" };
        let problem = format!("has {} numbers, expected {expected}", distortion.len());
        return Err(camera.fault(camera.required(DISTORTION)?, DISTORTION, problem));
    }
    Ok(IntrinsicNumbers {
        fx: camera.positive(FX, 1.0..=FAR)?,
        fy: camera.positive(FY, 1.0..=FAR)?,
        cx: principal(CX)?,
        cy: principal(CY)?,
        skew: camera.bounded(SKEW, FAR)?.unwrap_or(0.0),
        distortion,
    })
}

fn is_fisheye(lens: &str) -> bool {
    lens.replace('-', "_") == "kannala_brandt"
}
