//! Parameters, effects and free functions in words.

/// The meaning of a piece's parameter, in a sentence; `None` for pieces from outside depthcal.
pub(super) fn meaning(piece: &str, parameter: &str) -> Option<&'static str> {
    Some(match (piece, parameter) {
        ("pinhole", "fx" | "fy") => "Focal length: pixels per unit of slope, across and down.",
        ("pinhole", "cx" | "cy") => "Principal point: where the optical axis meets the image.",
        ("pinhole", "skew") => "Shear of the pixel grid; zero for real sensors.",
        ("brown_conrady", "k1" | "k2" | "k3") => {
            "Radial distortion: straight lines bend like a barrel or a pincushion."
        }
        ("brown_conrady", "p1" | "p2") => "Decentring: lens elements that are not on one axis.",
        ("projective", "dx") => "Depth tilts from left to right: the projector is turned against the camera.",
        ("projective", "dy") => "Depth tilts from top to bottom: a rolled projector.",
        ("projective", "dz") => "A constant offset of the disparity.",
        ("projective", "dw") => "Scale of the depth: baseline, focal scale and the board's print scale together.",
        ("board_bow", _) => "The board is bent: height grows with the square of the position (twist for bxy).",
        ("print_scale", _) => "The print is stretched along y against x.",
        ("thin_prism", _) => "A tilted lens element or filter before the sensor.",
        ("rational_distortion", _) => "Radial distortion of wide lenses, in the denominator.",
        ("tilted_sensor", _) => "The sensor is not square to the lens axis.",
        ("focus_breathing", _) => "The focal length changes with distance.",
        ("depth_registration", "du") => "The depth image is displaced sideways against the image.",
        ("depth_registration", "dv") => "The depth image is displaced up or down against the image.",
        ("projector_distortion", _) => "The projector's lens distorts its pattern.",
        ("disparity_ripple", _) => "Sub-pixel locking: depth waves that repeat with every step of disparity.",
        ("range_offset", _) => "A constant added along the ray: signal delay or mounting datum.",
        ("quadratic_depth", _) => "The error grows with the square (or cube) of the distance.",
        ("cyclic_depth", _) => "Time-of-flight wiggling: depth waves over distance.",
        ("radial_range", _) => "Range along the ray is reported as depth, in part.",
        ("incidence_bias", _) => "The error grows with the angle of incidence.",
        ("reflectivity_bias", _) => "The error depends on how bright the surface is.",
        ("signal_mixing", "m1" | "m2") => {
            "Bright neighbours shift the depth of dark pixels; grows with the surroundings' signal over the pixel's own."
        }
        ("signal_mixing", _) => "The same at edges: the slope of the brightness across and down.",
        ("temporal_drift", _) => "Scale (s) and offset (o) drift while the camera settles.",
        ("temperature_drift", _) => "Scale (s) and offset (o) change with temperature.",
        _ => return None,
    })
}

/// An effect in words that follow its name and a colon.
pub(super) fn effect_meaning(effect: &str) -> &'static str {
    match effect {
        "board_bow" => "the board is bent",
        "print_scale" => "the print is stretched along one axis",
        "thin_prism" => "a lens element or filter is tilted",
        "rational_distortion" => "the lens distorts more than Brown–Conrady describes",
        "tilted_sensor" => "the sensor is not square to the lens axis",
        "focus_breathing" => "the focal length changes with distance",
        "depth_registration" => "the depth image is displaced against the image",
        "projector_distortion" => "the projector's lens distorts its pattern",
        "disparity_ripple" => "depth waves with every step of disparity (sub-pixel locking)",
        "range_offset" => "a constant is added along every ray (signal delay, mounting datum)",
        "quadratic_depth" => "the error grows with the square of the distance",
        "cyclic_depth" => "depth waves over distance (time-of-flight wiggling)",
        "radial_range" => "range along the ray is reported as depth, in part",
        "incidence_bias" => "the error grows with the angle of incidence",
        "reflectivity_bias" => "depth depends on how bright the pixel is",
        "signal_mixing" => "bright neighbours shift the depth of darker pixels",
        "temporal_drift" => "depth drifts while the camera settles",
        "temperature_drift" => "depth changes with temperature",
        "free_map" | "bspline" => "a smooth map over the image, which corrects depth without naming a cause",
        _ => "an effect from outside depthcal",
    }
}

/// The quantity that a free function of the diagnosis depends on.
pub(super) fn free_function(name: &str) -> &str {
    match name {
        "map" | "free_map" => "the position in the image",
        "map of depth" => "the position in the image (in depth)",
        "columns" => "the image column",
        "rows" => "the image row",
        "board" => "the position on the board",
        "depth" => "the distance",
        "amplitude" => "the infrared amplitude",
        "incidence" => "the angle of incidence",
        "time" => "the time",
        "temperature" => "the temperature",
        other => other,
    }
}

/// The title of a piece.
pub(super) fn piece_title(piece: &str) -> String {
    match piece {
        "pinhole" => "Pinhole K".to_owned(),
        "brown_conrady" => "Lens, Brown–Conrady".to_owned(),
        "projective" => "Projective depth distortion D".to_owned(),
        other => other.replace('_', " "),
    }
}

/// Causes that a board cannot separate, for calibrations with a projective piece.
pub(super) const CONFOUNDED: &str = "A board cannot separate the causes behind D: dw is the product of baseline, focal scale and the \
board's print scale (a print that is 0.1 % too large makes every depth 0.1 % too large), dz is any constant offset of the \
disparity, dy any roll of the projector. The standard deviations tell how well the frames determine a number, not its \
cause.";
