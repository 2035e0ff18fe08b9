//! Descriptions of pieces are complete, and true where it can be tried.

use std::sync::Arc;

use depthcal_model::hook::HookKind;
use depthcal_model::{AnyPiece, Context, Covariate, PieceSpec, Register, StrayLight, pinhole};

fn pieces() -> Vec<Arc<dyn AnyPiece>> {
    let register = Register::builtin();
    register.names().map(|name| register.find(name).unwrap()).collect()
}

#[test]
fn every_piece_describes_itself_and_its_parameters() {
    let sentence = |text: &str| text.starts_with(char::is_uppercase) && text.ends_with('.');
    for piece in pieces() {
        let name = piece.name();
        assert!(!piece.source().is_empty() && !piece.equation().is_empty() && !piece.title().is_empty(), "{name}");
        assert!(!piece.equation().contains('|'), "{name}: equations are printed in tables");
        let summary = piece.summary();
        assert!(summary.starts_with(char::is_lowercase) && !summary.ends_with('.'), "{name}: '{summary}'");
        for parameter in piece.parameters() {
            assert!(sentence(parameter.meaning), "{name}.{}: '{}'", parameter.name, parameter.meaning);
        }
        assert!(piece.confounded().is_none_or(sentence), "{name}");
    }
    for parameter in &pinhole::PARAMETERS {
        assert!(sentence(parameter.meaning), "{}", parameter.name);
    }
}

/// Constants that are declared are those that files have, with their defaults.
#[test]
fn constants_are_declared() {
    for piece in pieces() {
        let declared = piece.constants().iter().map(|c| (c.name.to_owned(), c.default)).collect();
        assert_eq!(piece.options(), declared, "{}", piece.name());
    }
}

/// A piece depends on the covariates that it declares, and on no other that has to be known.
#[test]
fn needs_are_what_the_equation_reads() {
    let usual = Context {
        pixel: [400.0, 100.0],
        amplitude: 900.0,
        surround: 1400.0,
        slope: [0.03, -0.02],
        stray: StrayLight { scene: [[1.5, 0.4], [-0.8, 1.1], [0.3, -1.2]], near: 1.1 },
        time_s: 100.0,
        temperature_c: 31.0,
        ..Context::default()
    };
    let state = [0.2, -0.1, 1.0 / 900.0, 0.9];
    for piece in pieces().iter().filter(|piece| piece.hook() == HookKind::Depth) {
        let theta: Vec<f64> = piece.parameters().iter().map(|p| p.nominal + 0.7 * p.scale).collect();
        let measured = |state: [f64; 4], context: Context| {
            let mut out = [0.0];
            piece.evaluate(&theta, &state, &[context], &mut out);
            out[0]
        };
        let mut slanted = state;
        slanted[3] = 0.5;
        let changed = [
            (Covariate::Incidence, slanted, usual),
            (Covariate::Temperature, state, Context { temperature_c: 12.0, ..usual }),
            (Covariate::Time, state, Context { time_s: 700.0, ..usual }),
            (Covariate::Amplitude, state, Context { amplitude: 333.0, ..usual }),
            (Covariate::Surroundings, state, Context { surround: 777.0, ..usual }),
            (Covariate::StrayLight, state, Context { stray: StrayLight { near: 1.3, ..usual.stray }, ..usual }),
        ];
        for (covariate, state_changed, context) in changed {
            let reads = measured(state_changed, context) != measured(state, usual);
            assert_eq!(reads, piece.needs().contains(&covariate), "{}: {}", piece.name(), covariate.name());
        }
    }
}

/// Maps of offsets leave differences of inverse depth as they are.
#[test]
fn maps_of_offsets_cannot_scale() {
    let is_map = |name: &str| Register::builtin().find(name).unwrap().is_offset_map();
    assert!(is_map("free_map") && is_map("disparity_decay"));
    for piece in pieces().iter().filter(|piece| piece.is_offset_map()) {
        // So near to the camera that a map that decays with inverse depth has decayed.
        let theta: Vec<f64> = piece.parameters().iter().map(|p| p.nominal + p.scale).collect();
        let measured = |rho: f64| {
            let mut out = [0.0];
            piece.evaluate(&theta, &[0.0, 0.0, rho, 1.0], &[Context::default()], &mut out);
            out[0]
        };
        let (small, large) = (measured(0.1), measured(0.2));
        assert!(((large - small) / 0.1 - 1.0).abs() < 1e-9, "{}", piece.name());
    }
}

#[test]
fn covariates_that_are_recorded_say_how() {
    for covariate in Covariate::ALL {
        assert!(!covariate.missing().is_empty() && !covariate.how_to_record().is_empty(), "{}", covariate.name());
    }
    let recorded: Vec<Covariate> = Covariate::ALL.into_iter().filter(|c| c.is_recorded()).collect();
    for piece in pieces() {
        let from_pose = piece.needs().iter().filter(|c| !recorded.contains(c));
        assert!(from_pose.into_iter().all(|c| *c == Covariate::Incidence), "{}", piece.name());
    }
}

#[test]
fn people_read_words_where_files_have_names() {
    let register = Register::builtin();
    let words = |text: &str| register.words(&text.parse::<PieceSpec>().unwrap());
    assert_eq!(words("cyclic_depth@period_mm=299.90356313997415"), "cyclic_depth (period 300 mm)");
    assert_eq!(words("temporal_drift@tau_s=inf"), "temporal_drift (time constant ∞ s)");
    assert_eq!(words("projective:xw"), "projective (only x, w free)");
    assert_eq!(words("bspline@columns=6@rows=5"), "bspline (columns 6, rows 5)");
    assert_eq!(words("somebody_elses@gain_db=3.14159"), "somebody_elses (gain db 3.14)");
    let model = "projective + cyclic_depth@period_mm=250".parse().unwrap();
    assert_eq!(register.model_words(&model), "projective + cyclic_depth (period 250 mm)");
    assert_eq!(register.model_words(&"none".parse().unwrap()), "none");
}
