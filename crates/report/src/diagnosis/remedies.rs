//! Causes that a person can remove, and what becomes of those that none can.

/// The remedy for an effect that a person has; None for effects that are not of the catalogue.
pub(super) fn remedy(effect: &str) -> Option<&'static str> {
    Some(match effect {
        "board_bow" | "board_warp" => "flatten the board, or keep its fitted shape",
        "print_scale" => "measure the print along both axes, or keep the fitted stretch",
        "focus_breathing" => "lock the focus, or keep the fitted change",
        "rational_distortion" | "thin_prism" | "tilted_sensor" => {
            "keep it: the lens has these terms, and depthcal export writes them where a format can hold them"
        }
        "depth_registration" => "correct the registration in the driver, or keep the fitted displacement",
        "cyclic_depth" | "disparity_ripple" => "keep the correction: no setting removes it",
        "projector_distortion" | "quadratic_depth" => "keep the correction, within the distances that were captured",
        "radial_range" => "check whether the driver gives depth or range, or keep the correction",
        "range_offset" => "keep the correction: it is a property of the camera and its mount",
        "incidence_bias" => {
            "keep surfaces square to the camera where it matters; depthcal apply corrects by the slope of the depth image"
        }
        "reflectivity_bias" | "signal_mixing" => "give depthcal apply the infrared images, by which it corrects",
        "stray_light" => {
            "keep bright things out of view; give depthcal apply the infrared images, by which it corrects"
        }
        "temporal_drift" => "let the camera settle before you measure, or give depthcal apply the times",
        "temperature_drift" => "let the camera warm up before you measure, or give depthcal apply the temperatures",
        "bspline" | "disparity_decay" | "free_map" | "multiplier" | "polynomial_map" => {
            "correct by it, but check it on another capture: its cause is not known"
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use depthcal_model::Register;

    use super::*;

    /// Every piece that a diagnosis can add: lens models and D are chosen, not found.
    #[test]
    fn every_effect_of_the_catalogue_has_a_remedy() {
        let register = Register::builtin();
        let chosen = ["brown_conrady", "cahvor", "division", "kannala_brandt", "opencv_lens", "unified", "projective"];
        for name in register.names().filter(|name| !chosen.contains(name)) {
            assert!(remedy(name).is_some(), "{name}");
        }
        assert!(remedy("found_r").is_none());
    }
}
