//! Cameras get the fast way that docs/correction.md promises: a slower one gives the same depth, so that no other test would
//! tell.

use depthcal_model::hook::HookKind;
use depthcal_model::{Block, Camera, Register};

use super::{CYCLIC, HEIGHT, PROJECTIVE, REGISTRATION, WIDTH, camera};
use crate::FrameContext;
use crate::plan::Plan;
use crate::prepared::{OnePixel, PreparedCamera};
use crate::simd::dispatch;

fn kinds(camera: &Camera) -> Vec<&'static str> {
    PreparedCamera::new(camera).unwrap().plan.as_ref().map(Plan::kinds).unwrap_or_default()
}

/// A piece away from its nominal values, at which it does nothing.
fn in_effect(spec: &str) -> Block {
    let mut piece = Register::builtin().block(spec, None).unwrap();
    let scales: Vec<f64> = piece.parameters().iter().map(|parameter| parameter.scale).collect();
    for (i, (value, scale)) in piece.theta.iter_mut().zip(scales).enumerate() {
        *value += scale * (0.6 + 0.4 * (0.9 * i as f64).sin());
    }
    piece
}

/// A camera with a usual lens and this piece.
fn with_lens(piece: Block) -> Camera {
    let plain = camera(&[]);
    let lens = plain.blocks().iter().filter(|block| block.hook() == HookKind::Lens).cloned();
    Camera::new(plain.width, plain.height, plain.pinhole(), lens.chain([piece]).collect())
}

#[test]
fn every_built_in_depth_piece_has_the_stage_of_its_form() {
    for (spec, expected) in [
        ("projective", "moebius"),
        ("projector_distortion", "moebius"),
        ("range_offset", "moebius"),
        ("radial_range", "moebius"),
        ("free_map", "moebius"),
        ("bspline", "moebius"),
        ("multiplier@bins=1", "moebius"),
        ("disparity_ripple", "curve"),
        ("quadratic_depth", "curve"),
        ("cyclic_depth", "curve"),
        ("multiplier", "piecewise_factor"),
        ("disparity_decay", "separable"),
        ("polynomial_map", "separable"),
        ("temporal_drift", "frame"),
        ("temperature_drift", "frame"),
        ("reflectivity_bias", "amplitude"),
        ("incidence_bias", "cosine"),
        ("stray_light", "stray_light"),
    ] {
        let piece = in_effect(spec);
        assert_eq!(piece.hook(), HookKind::Depth, "{spec}");
        assert_eq!(kinds(&with_lens(piece)), [expected], "{spec}");
    }
}

/// Depths that the stages do not reach go to the inverse in f64, which is far slower.
#[test]
fn stages_reach_all_depths_of_the_working_range() {
    for spec in
        ["projective", "bspline", "multiplier", "cyclic_depth", "disparity_decay", "polynomial_map", "temporal_drift"]
    {
        let camera = PreparedCamera::new(&with_lens(in_effect(spec))).unwrap();
        let plan = camera.plan.as_ref().unwrap();
        let context = FrameContext { time_s: 300.0, ..FrameContext::default() };
        let inputs = plan.inputs(&context, None, None);
        for index in [0, WIDTH / 3, HEIGHT / 2 * WIDTH + WIDTH / 2, WIDTH * HEIGHT - 1] {
            for measured_mm in [320.0, 700.0, 1431.0, 4100.0] {
                let mut z = [measured_mm];
                dispatch(OnePixel { plan, inputs: &inputs, index, z: &mut z });
                assert!(z[0] > 0.0, "{spec}: pixel {index}, {measured_mm} mm: {}", z[0]);
            }
        }
    }
}

#[test]
fn neighbouring_maps_become_one_stage() {
    let radial: (&str, &[f64]) = ("radial_range", &[0.05]);
    assert_eq!(kinds(&camera(&[])), ["moebius"], "it marks pixels without a ray");
    assert_eq!(kinds(&camera(&[radial, PROJECTIVE, REGISTRATION])), ["moebius"]);
    // In the order of the inversion.
    assert_eq!(kinds(&camera(&[radial, CYCLIC, PROJECTIVE])), ["moebius", "curve", "moebius"]);
}
