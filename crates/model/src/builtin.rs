//! The register of depthcal's own pieces.

use crate::register::Register;
use crate::{board, depth, lens, pixel};

impl Register {
    /// All pieces that depthcal has, by the folders of their hooks.
    pub fn builtin() -> Self {
        let mut register = Self::empty();
        board::register(&mut register);
        lens::register(&mut register);
        pixel::register(&mut register);
        depth::register(&mut register);
        register
    }
}

impl Default for Register {
    fn default() -> Self {
        Self::builtin()
    }
}

#[cfg(test)]
mod tests {
    use crate::Register;

    #[test]
    fn names_with_subsets_and_constants() {
        let register = Register::builtin();
        let d = register.block("projective:xw", None).unwrap();
        assert_eq!(d.free, [true, false, false, true]);
        assert_eq!(register.depth_model("none").unwrap().len(), 0);
        let stack = register.depth_model("projective+cyclic_depth@period_mm=250").unwrap();
        assert_eq!(stack[1].piece().unwrap().options()["period_mm"], 250.0);
    }

    #[test]
    fn a_piece_can_be_taken_out() {
        let (all, fewer) = (Register::builtin(), Register::builtin().without("cyclic_depth"));
        assert!(all.find("cyclic_depth").is_some() && fewer.find("cyclic_depth").is_none());
        assert_eq!(fewer.names().count() + 1, all.names().count());
        assert!(!Register::empty().names().any(|_| true));
    }

    #[test]
    fn values_are_found_by_the_parameters_names() {
        let mut d = Register::builtin().block("projective", None).unwrap();
        d.theta = vec![1e-5, -2e-5, 3e-5, 1.02];
        assert_eq!((d.value("dy"), d.value("dw"), d.value("w")), (Some(-2e-5), Some(1.02), None));
        assert!(d.free.iter().all(|free| *free) && d.hold().free.iter().all(|free| !free));
    }

    #[test]
    fn maps_of_offsets_get_scale_and_offset_unless_the_stack_says_otherwise() {
        let register = Register::builtin();
        let names = |model: &str| -> Vec<String> {
            register.depth_model(model).unwrap().iter().map(|b| b.name().to_owned()).collect()
        };
        let stack = register.depth_model("disparity_decay@columns=10").unwrap();
        assert_eq!(stack[0].free, [false, false, true, true]);
        assert_eq!(stack[1].piece().unwrap().options()["columns"], 10.0);
        assert_eq!(names("free_map"), ["projective", "free_map"]);
        assert_eq!(names("projective:xw+disparity_decay"), ["projective", "disparity_decay"]);
        assert_eq!(names("none+disparity_decay"), ["disparity_decay"]);
        assert_eq!(names("bspline"), ["bspline"]);
    }

    #[test]
    fn what_is_unknown_is_refused_with_what_is_known() {
        let register = Register::builtin();
        let message = |name: &str| register.depth_model(name).unwrap_err().to_string();
        assert!(message("projectiv").contains("projective"), "{}", message("projectiv"));
        assert!(message("projective:q").contains("dx, dy, dz, dw"), "{}", message("projective:q"));
        assert!(message("cyclic_depth@period=3").contains("period_mm"), "{}", message("cyclic_depth@period=3"));
        assert!(message("cyclic_depth@period_mm=x").contains("period_mm"));
        assert!(message("board_bow").contains("acts on the board"), "{}", message("board_bow"));
    }
}
