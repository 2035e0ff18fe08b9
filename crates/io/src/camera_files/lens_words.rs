//! Lenses in the words of other programs: the name of a model with a list of coefficients, or coefficients by their own names.

use super::error::CameraFileError;
use super::intrinsics::FileLens;
use super::keys::{self, is_of_lens, plain};
use super::lens_form::needed;
use super::node::Node;

/// A lens model as files name it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LensModel {
    /// OpenCV's first four or five coefficients.
    BrownConrady,
    /// OpenCV's eight coefficients and more.
    Rational,
    /// k1 to k4 of the angle: Kannala and Brandt's model, equidistant in ROS.
    Fisheye,
    /// No distortion.
    Undistorted,
}

/// Models of one name each, in plain letters.
const NAMES: [(&str, LensModel); 25] = {
    use LensModel::{BrownConrady, Fisheye, Rational, Undistorted};
    [
        ("plumbbob", BrownConrady),
        ("radtan", BrownConrady),
        ("radialtangential", BrownConrady),
        ("brownconrady", BrownConrady),
        ("brown", BrownConrady),
        // The SDK projects both by one equation; `modified_lens` says how far that is from Brown's and Conrady's.
        ("modifiedbrownconrady", BrownConrady),
        ("inversebrownconrady", BrownConrady),
        ("rationalpolynomial", Rational),
        ("rational", Rational),
        ("fullopencv", Rational),
        ("brownconradyk6", Rational),
        ("radtan8", Rational),
        ("equidistant", Fisheye),
        ("equi", Fisheye),
        ("fisheye", Fisheye),
        ("opencvfisheye", Fisheye),
        ("kannalabrandt", Fisheye),
        ("kannalabrandt4", Fisheye),
        ("kannalabrandt8", Fisheye),
        ("kb4", Fisheye),
        ("kb8", Fisheye),
        ("none", Undistorted),
        ("nodistortion", Undistorted),
        ("undistorted", Undistorted),
        ("rectified", Undistorted),
    ]
};
/// Models that nothing here states.
const FOREIGN: [&str; 10] =
    ["ds", "doublesphere", "eucm", "omni", "mei", "ftheta", "fov", "scaramuzza", "ocam", "thinprismfisheye"];
/// Models that are read, for errors.
const READ: &str =
    "plumb_bob (radtan, Brown-Conrady), rational_polynomial, equidistant (fisheye, Kannala-Brandt) and none";
/// Names of OpenCV's coefficients in their order, in plain letters.
const TERMS: [&str; 14] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "taux", "tauy"];

/// The lens model of a name; `None` where it is none.
pub(super) fn model_named(name: &str) -> Option<LensModel> {
    let plain = plain(name);
    let plain = ["rs2", "ob"].iter().find_map(|maker| plain.strip_prefix(maker)).unwrap_or(&plain);
    let plain = plain.strip_prefix("distortion").unwrap_or(plain);
    NAMES.iter().find(|(known, _)| *known == plain).map(|(_, model)| *model)
}

/// The lens model that a mapping names; `None` where it names none.
pub(super) fn model_of(node: &Node<'_>) -> Result<Option<LensModel>, CameraFileError> {
    if node.key(keys::FISHEYE).is_some_and(|key| node.is_set(key)) {
        return Ok(Some(LensModel::Fisheye));
    }
    if let Some(name) = node.key(keys::LENS_MODEL).and_then(|key| node.text(key)).filter(|name| !name.is_empty()) {
        return model_named(name).map(Some).ok_or_else(|| node.unsupported(name, READ));
    }
    let Some(name) = node.key(keys::CAMERA_MODEL).and_then(|key| node.text(key)) else { return Ok(None) };
    if FOREIGN.contains(&plain(name).trim_start_matches("distortion")) {
        return Err(node.unsupported(name, READ));
    }
    Ok(model_named(name))
}

/// The lens of a list of coefficients in OpenCV's order, or k1 to k4 of a fisheye lens. Surplus zeros are left out.
pub(super) fn from_list(
    node: &Node<'_>,
    field: &str,
    model: Option<LensModel>,
) -> Result<Option<FileLens>, CameraFileError> {
    let k = node.required_numbers(field)?;
    if k.is_empty() {
        return Ok(None);
    }
    let used = needed(&k);
    let unexpected = |expected: &str| node.fault(field, format!("has {} numbers, expected {expected}", k.len()));
    match model {
        Some(LensModel::Undistorted) if used == 0 => Ok(None),
        Some(LensModel::Undistorted) => {
            Err(node.fault(field, "is not zero, but the lens model is none: correct one of them"))
        }
        Some(LensModel::Fisheye) => {
            let lens = k.first_chunk().filter(|_| used <= 4).map(|k| FileLens::fisheye(*k));
            lens.map(Some).ok_or_else(|| unexpected("4, k1 to k4 of a fisheye lens"))
        }
        Some(LensModel::BrownConrady) => {
            let lens = FileLens::opencv(&k[..k.len().min(5)]).filter(|_| used <= 5);
            let remedy = "4 or 5 (k1 k2 p1 p2 k3); name the model rational_polynomial where they are OpenCV's 8";
            lens.map(Some).ok_or_else(|| unexpected(remedy))
        }
        Some(LensModel::Rational) => {
            let lens = FileLens::opencv(&k).filter(|_| k.len() >= 8);
            lens.map(Some).ok_or_else(|| unexpected("8, 12 or 14 of OpenCV's"))
        }
        None => FileLens::opencv(&k)
            .map(Some)
            .ok_or_else(|| unexpected("4, 5, 8, 12 or 14 of OpenCV's (k1 k2 p1 p2 k3 …), or 4 and fisheye_model: 1")),
    }
}

/// The lens of coefficients by their own names (`k1`, `k2`, `p1`, …); `None` where there are none.
pub(super) fn from_terms(node: &Node<'_>, model: Option<LensModel>) -> Result<Option<FileLens>, CameraFileError> {
    let mut k = [0.0; 14];
    let mut is_given = [false; 14];
    for (i, term) in TERMS.iter().enumerate() {
        // A list of such a name is the matrix of a camera: `K1`, `P1`.
        if node.key(&[term]).is_some_and(|key| !node.is_list(key)) {
            (k[i], is_given[i]) = (node.quantity(&[term])?.unwrap_or_default(), true);
        }
    }
    let last = is_given.iter().rposition(|given| *given);
    let Some(last) = last else { return Ok(None) };
    let [k1, k2, p1, p2, k3, k4, k5, k6, ..] = k;
    if model == Some(LensModel::Fisheye) {
        if [p1, p2, k5, k6] != [0.0; 4] || last > 7 {
            return Err(
                node.fault("k1", "belongs to a fisheye lens of k1 to k4, but stands beside p1, p2, k5, k6, s1 or more")
            );
        }
        return Ok(Some(FileLens::fisheye([k1, k2, k3, k4])));
    }
    // k4 without k5 and k6 is that of a fisheye lens, or nerfstudio's of r⁸; OpenCV has all three.
    if k4 != 0.0 && !(is_given[6] && is_given[7]) {
        let remedy =
            "stands without k5 and k6: name the lens model, fisheye or rational_polynomial; one of r⁸ is not read";
        return Err(node.fault("k4", remedy));
    }
    if model == Some(LensModel::Undistorted) && needed(&k) > 0 {
        return Err(node.fault("k1", "stands beside the lens model none: correct one of them"));
    }
    if model == Some(LensModel::BrownConrady) && needed(&k) > 5 {
        return Err(node.fault("k4", "is not part of Brown's and Conrady's lens: name the model rational_polynomial"));
    }
    let count = needed(&k).max(if is_given[4] { 5 } else { 4 });
    let count = [4, 5, 8, 12, 14].into_iter().find(|size| *size >= count).unwrap_or(14);
    Ok(FileLens::opencv(&k[..count]))
}

/// The lens of a mapping of a program that leaves it out for a camera without distortion: by the names of its coefficients.
///
/// # Errors
/// A key that looks like one of a lens and is not known.
pub(super) fn optional(node: &Node<'_>, pinhole: &str) -> Result<Option<FileLens>, CameraFileError> {
    match from_terms(node, model_of(node)?)? {
        None if node.keys().into_iter().any(|key| is_of_lens(key) && plain(key) != "distortionmodel") => {
            Err(node.without_lens(pinhole))
        }
        lens => Ok(lens),
    }
}
