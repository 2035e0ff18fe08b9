//! Keys by which programs name the same quantity.
//!
//! Keys are compared by their letters and digits alone, in lower case: `camera_matrix`, `Camera_Matrix` and `cameraMatrix` are
//! one key. A file of several cameras may number or name them in its keys: `M1`, `mtx_left`, `rgb_camera_matrix`.

/// Camera matrices, 3×3.
pub(super) const MATRIX: &[&str] = &[
    "k",
    "m",
    "mtx",
    "kmatrix",
    "cameramatrix",
    "cammatrix",
    "cameramat",
    "camerak",
    "intrinsic",
    "intrinsics",
    "intrinsicmatrix",
    "intrinsicsmatrix",
    "intrinsicmat",
    "cameraintrinsic",
    "cameraintrinsics",
];
/// Distortion coefficients, a list.
pub(super) const COEFFICIENTS: &[&str] = &[
    "d",
    "kc",
    "dist",
    "distcoef",
    "distcoefs",
    "distcoeff",
    "distcoeffs",
    "distcoefficient",
    "distcoefficients",
    "distmatrix",
    "distparams",
    "distvec",
    "distvector",
    "distortion",
    "distortions",
    "distortioncoef",
    "distortioncoefs",
    "distortioncoeff",
    "distortioncoeffs",
    "distortioncoefficient",
    "distortioncoefficients",
    "distortionmatrix",
    "distortionparameters",
    "distortionparams",
    "distortionvector",
    "lensdistortion",
    "coeff",
    "coeffs",
    "coefficients",
];
/// Width of the image, px.
pub(super) const WIDTH: &[&str] = &["imagewidth", "imgwidth", "width", "w"];
/// Height of the image, px.
pub(super) const HEIGHT: &[&str] = &["imageheight", "imgheight", "height", "h"];
/// Width and height, px, a list.
pub(super) const SIZE: &[&str] = &["imagesize", "imgsize", "imageresolution", "resolution"];
/// Focal length in x, px.
pub(super) const FX: &[&str] = &["fx", "flx", "gamma1", "mu"];
/// Focal length in y, px.
pub(super) const FY: &[&str] = &["fy", "fly", "gamma2", "mv"];
/// Column of the principal point, px.
pub(super) const CX: &[&str] = &["cx", "ppx", "u0"];
/// Row of the principal point, px.
pub(super) const CY: &[&str] = &["cy", "ppy", "v0"];
/// Names of lens models, of which one that is not known is an error.
pub(super) const LENS_MODEL: &[&str] = &["distortionmodel", "distortiontype", "lensmodel"];
/// Names of camera models, which may also be names of products.
pub(super) const CAMERA_MODEL: &[&str] = &["cameramodel", "model", "cameratype", "modeltype", "type"];
/// Whether the lens is a fisheye lens.
pub(super) const FISHEYE: &[&str] = &["fisheyemodel", "fisheye", "isfisheye"];

/// Names of cameras in keys; digits may follow.
const AFFIXES: &[&str] = &[
    "", "l", "r", "left", "right", "rgb", "color", "colour", "depth", "ir", "infra", "infrared", "mono", "thermal",
    "cam", "camera",
];

/// Letters and digits of a key, in lower case.
pub(super) fn plain(key: &str) -> String {
    key.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// The camera that a key names before or after a quantity of a table, in plain letters, empty for the only camera; `None` for a
/// key of another quantity.
pub(super) fn camera_in(key: &str, table: &[&str]) -> Option<String> {
    let plain = plain(key);
    if table.contains(&plain.as_str()) {
        return Some(String::new());
    }
    let is_name = |name: &&str| AFFIXES.contains(&name.trim_end_matches(|c: char| c.is_ascii_digit()));
    let names =
        table.iter().filter_map(|q| plain.strip_prefix(q).filter(is_name).or(plain.strip_suffix(q).filter(is_name)));
    // The longest quantity leaves the shortest name.
    names.min_by_key(|name| name.len()).map(|name| if matches!(name, "cam" | "camera") { "" } else { name }.to_owned())
}

/// Whether a key looks like one of a lens: `dist…`, `…coeff…`, `k1`, `p2`, `radial…`.
pub(super) fn is_of_lens(key: &str) -> bool {
    let plain = plain(key);
    let is_term =
        plain.len() == 2 && plain.starts_with(['k', 'p', 's']) && plain.ends_with(|c: char| c.is_ascii_digit());
    let is_word = ["distortion", "coef", "radial", "tangential"].iter().any(|word| plain.contains(word));
    is_term || is_word || camera_in(key, COEFFICIENTS).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spellings_and_cameras_of_keys() {
        for key in ["K", "camera_matrix", "Camera_Matrix", "cameraMatrix", "mtx", "camera matrix", "intrinsic_matrix"] {
            assert_eq!(camera_in(key, MATRIX).as_deref(), Some(""), "{key}");
        }
        for key in ["D", "dist", "dist_coeff", "distCoeffs", "Distortion_Coefficients", "distortion_coeffs"] {
            assert_eq!(camera_in(key, COEFFICIENTS).as_deref(), Some(""), "{key}");
        }
        let cameras =
            [("M1", "1"), ("mtxL", "l"), ("K_left", "left"), ("rgb_camera_matrix", "rgb"), ("cam0_K", "cam0")];
        for (key, camera) in cameras {
            assert_eq!(camera_in(key, MATRIX).as_deref(), Some(camera), "{key}");
        }
        for key in ["new_camera_matrix", "P", "R1", "kappa", "marker"] {
            assert_eq!(camera_in(key, MATRIX), None, "{key}");
        }
        assert!(is_of_lens("k1") && is_of_lens("radial") && !is_of_lens("distance_mm") && !is_of_lens("P1x"));
    }
}
