//! What parameters mean, in plain words.

/// What a parameter of a piece means to a person who has a camera and a board.
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
        ("incidence_bias", _) => "The error grows on surfaces that are seen at a slant.",
        ("reflectivity_bias", _) => "The error depends on how bright the surface is.",
        ("signal_mixing", "m1" | "m2") => {
            "Bright neighbours pull at dark pixels: grows with surroundings over own signal."
        }
        ("signal_mixing", _) => "The same at edges: the slope of the brightness across and down.",
        ("temporal_drift", _) => "Scale (s) and offset (o) drift while the camera settles.",
        ("temperature_drift", _) => "Scale (s) and offset (o) change with temperature.",
        _ => return None,
    })
}

/// What an effect is, in plain words that follow a name and a colon.
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
        "incidence_bias" => "surfaces seen at a slant are measured wrong",
        "reflectivity_bias" => "depth depends on how bright the pixel is",
        "signal_mixing" => "bright neighbours pull at the depth of darker pixels",
        "temporal_drift" => "depth drifts while the camera settles",
        "temperature_drift" => "depth changes with temperature",
        "free_map" | "bspline" => "a smooth map over the image, which corrects but explains nothing",
        _ => "an effect of your own",
    }
}

/// What a free function of the diagnosis is a function of.
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

/// What a piece is called in print.
pub(super) fn piece_title(piece: &str) -> String {
    match piece {
        "pinhole" => "Pinhole K".to_owned(),
        "brown_conrady" => "Lens, Brown–Conrady".to_owned(),
        "projective" => "Projective depth distortion D".to_owned(),
        other => other.replace('_', " "),
    }
}

/// What a board cannot tell apart, where the calibration has a projective piece.
pub(super) const CONFOUNDED: &str = "A board cannot tell apart what D takes up: dw is baseline, focal scale and the \
board's print scale together (a print that is 0.1 % too large makes every depth 0.1 % too large), dz is any constant \
offset of the disparity, dy any roll of the projector. The standard deviations say how well the frames determine the \
number, not its cause.";
