//! Which of the usual lens models a camera's lens pieces are, exactly.

use depthcal_model::hook::HookKind;
use depthcal_model::{Block, Camera};

/// A lens in the terms of other programs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum LensForm {
    /// OpenCV's fourteen coefficients; those beyond the last that is not zero are not needed.
    OpenCv([f64; 14]),
    /// k1 to k4 of a fisheye lens.
    Fisheye([f64; 4]),
    /// ξ k1 k2 p1 p2 of the unified model.
    Unified([f64; 5]),
    /// α β r0 r1 r2.
    Cahvor([f64; 5]),
}

/// The lens pieces of a camera, in order.
pub(super) fn lens_blocks(camera: &Camera) -> Vec<&Block> {
    camera.blocks().iter().filter(|b| b.hook() == HookKind::Lens).collect()
}

/// The form of a camera's lens; `None` where it is none of them.
pub(super) fn form_of(camera: &Camera) -> Option<LensForm> {
    let blocks = lens_blocks(camera);
    if let [only] = blocks[..] {
        let values = only.theta.as_slice();
        match only.name() {
            "opencv_lens" => return Some(LensForm::OpenCv(values.try_into().ok()?)),
            "kannala_brandt" => return Some(LensForm::Fisheye(values.try_into().ok()?)),
            "unified" => return Some(LensForm::Unified(values.try_into().ok()?)),
            "cahvor" => return Some(LensForm::Cahvor(values.try_into().ok()?)),
            _ => {}
        }
    }
    // Brown–Conrady with the effects that complete it, in the order of OpenCV's model. The denominator acts first in a camera.
    const ORDER: [(&str, &[usize]); 4] = [
        ("rational_distortion", &[5, 6, 7]),
        ("brown_conrady", &[0, 1, 2, 3, 4]),
        ("thin_prism", &[8, 9, 10, 11]),
        ("tilted_sensor", &[12, 13]),
    ];
    let (mut coefficients, mut next) = ([0.0; 14], 0);
    for block in blocks {
        let place = ORDER.iter().position(|(name, _)| *name == block.name())?;
        if place < next {
            return None;
        }
        next = place + 1;
        ORDER[place].1.iter().zip(&block.theta).for_each(|(i, value)| coefficients[*i] = *value);
    }
    Some(LensForm::OpenCv(coefficients))
}

/// Number of coefficients up to the last that is not zero.
pub(super) fn needed(coefficients: &[f64]) -> usize {
    coefficients.iter().rposition(|c| *c != 0.0).map_or(0, |last| last + 1)
}
