//! The table of effects: names, definitions and default sizes.

use super::info::{EffectInfo, Install};
use super::{beyond, board, drift, lens, light, nature, range, registration, scattering, triangulation};

const fn effect(
    name: &'static str,
    hook: &'static str,
    unit: &'static str,
    default_size: f64,
    size_is: &'static str,
    form: &'static str,
    install: Install,
) -> EffectInfo {
    EffectInfo { name, hook, unit, default_size, size_is, form, install }
}

const RMS_MM: &str = "rms of the depth error over the reference volume";
const RMS_PX: &str = "rms displacement over all pixels of the image";

static CATALOGUE: [EffectInfo; 18] = [
    effect(
        "board_bow",
        "board",
        "mm",
        1.5,
        "peak-to-valley height over the rectangle of the markers",
        "the board is a quadratic surface with twist; image and depth see it",
        board::board_bow,
    ),
    effect(
        "board_warp",
        "board",
        "mm",
        1.0,
        "peak-to-valley height over the rectangle of the markers",
        "a wave of 0.8 cycles along each side of the board, odd about its centre; image and depth see them",
        board::board_warp,
    ),
    effect(
        "print_scale",
        "board",
        "mm",
        0.5,
        "elongation of the rectangle of the markers along y",
        "the print is stretched along y and not along x",
        board::print_scale,
    ),
    effect("thin_prism", "lens", "px", 0.5, RMS_PX, "s1 r² + s2 r⁴ added to x', s3 r² + s4 r⁴ to y'", lens::thin_prism),
    effect(
        "rational_distortion",
        "lens",
        "px",
        0.2,
        "rms displacement over all pixels that the best k1, k2, k3 leave; the sign has no effect",
        "1 + k4 r² + k5 r⁴ + k6 r⁶ in the denominator, with the numerator that nearly cancels it",
        lens::rational_distortion,
    ),
    effect(
        "tilted_sensor",
        "lens",
        "px",
        2.0,
        RMS_PX,
        "the sensor is turned by τx, τy; most of the displacement is a shift and a shear that K takes up",
        lens::tilted_sensor,
    ),
    effect(
        "depth_registration",
        "pixel",
        "px",
        2.0,
        "length of the displacement",
        "what the image shows at (u, v), the depth image shows at (u + du, v + dv)",
        registration::depth_registration,
    ),
    effect(
        "projector_distortion",
        "depth",
        "mm",
        4.0,
        RMS_MM,
        "the projector's lens moves its pattern: second order in (x, y) in ρ, weaker third order",
        triangulation::projector_distortion,
    ),
    effect(
        "disparity_ripple",
        "depth",
        "mm",
        2.0,
        RMS_MM,
        "a sinusoid in disparity of constant amplitude in ρ, period 4 px",
        triangulation::disparity_ripple,
    ),
    effect("range_offset", "depth", "mm", 6.0, "the offset along the ray", "range + offset", range::range_offset),
    effect(
        "quadratic_depth",
        "depth",
        "mm",
        6.0,
        RMS_MM,
        "q2 z² + q3 z³; D's offset takes up most of the second order",
        range::quadratic_depth,
    ),
    effect(
        "cyclic_depth",
        "depth",
        "mm",
        4.0,
        "amplitude of the fundamental",
        "a sinusoid in z of period 300 mm with a harmonic of 15 %",
        range::cyclic_depth,
    ),
    effect("radial_range", "depth", "mm", 6.0, RMS_MM, "z (1 + w (√(1 + x² + y²) − 1))", range::radial_range),
    effect(
        "incidence_bias",
        "depth",
        "mm",
        4.0,
        "depth error at 45° of incidence",
        "c (1/cos − 1)",
        light::incidence_bias,
    ),
    effect(
        "reflectivity_bias",
        "depth",
        "mm",
        6.0,
        "difference in depth between the board's dark and bright areas",
        "−c ln(amplitude), amplitude being the infrared signal at the pixel, illumination and exposure included",
        light::reflectivity_bias,
    ),
    effect(
        "temporal_drift",
        "depth",
        "mm",
        4.0,
        "rms over the reference volume of the change in depth from the first frame to the settled state",
        "scale and offset in ρ that settle exponentially; time constant a third of the session",
        drift::temporal_drift,
    ),
    effect(
        "temperature_drift",
        "depth",
        "mm",
        4.0,
        "rms over the reference volume of the change in depth for 5 °C",
        "scale and offset in ρ, linear in the temperature",
        drift::temperature_drift,
    ),
    effect(
        "focus_breathing",
        "lens",
        "px",
        1.0,
        "displacement, 240 px from the principal point, between 0.5 m and 1 m",
        "the focal length grows linearly with inverse depth",
        lens::focus_breathing,
    ),
];

static UNCATALOGUED: [EffectInfo; 7] = [
    effect(
        "nature",
        "depth",
        "mm",
        4.0,
        RMS_MM,
        "a random function of one or two covariates, in a random place and form",
        nature::nature,
    ),
    effect(
        "smooth_map",
        "depth",
        "mm",
        4.0,
        RMS_MM,
        "a smooth random map over the image in ρ that decays with disparity",
        beyond::smooth_map,
    ),
    effect("row_banding", "depth", "mm", 4.0, RMS_MM, "blocks of rows, each with a bias in ρ", beyond::row_banding),
    effect(
        "edge_step",
        "depth",
        "mm",
        6.0,
        "the step",
        "left of a column depth is larger by a constant",
        beyond::edge_step,
    ),
    effect(
        "multipath_corner",
        "depth",
        "mm",
        15.0,
        "depth error in the corner at 0.8 m",
        "depth too large near one corner of the image, in proportion to depth",
        beyond::multipath_corner,
    ),
    effect(
        "tilted_frames",
        "depth",
        "mm",
        5.0,
        "rms over the reference volume in a usual affected frame",
        "three frames in ten have a plane of their own added in ρ",
        beyond::tilted_frames,
    ),
    effect(
        "lens_glare",
        "depth",
        "mm",
        4.0,
        RMS_MM,
        "the middle of the image is pulled towards a near distance, the more the farther it is",
        beyond::lens_glare,
    ),
];

static OF_WHOLE_FRAMES: [EffectInfo; 1] = [effect(
    "stray_light",
    "depth",
    "%",
    0.6,
    "share of the light of the scene that falls on every pixel",
    "the phase of the light of the whole scene is added to that of every pixel, and that of the nearest pixels delays it",
    scattering::stray_light,
)];

/// Effects that depend on all pixels of a frame: rendered images have them, single points have not.
pub fn of_whole_frames() -> &'static [EffectInfo] {
    &OF_WHOLE_FRAMES
}

/// The effects of the catalogue, in its order.
pub fn catalogue() -> &'static [EffectInfo] {
    &CATALOGUE
}

/// Effects that the catalogue does not have.
pub fn uncatalogued() -> &'static [EffectInfo] {
    &UNCATALOGUED
}
