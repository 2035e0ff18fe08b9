//! The Rust files that formulas print as are pieces: they compile, and have the values and derivatives of the formula.
//!
//! `UPDATE_EMITTED=1 cargo test -p depthcal-formula --test emitted` writes the files anew.

use std::path::Path;
use std::sync::Arc;

use depthcal_formula::FormulaFile;
use depthcal_model::hook::HookKind;
use depthcal_model::{AnyPiece, Options, erase};

/// The modules that a piece of depthcal's own finds in its crate.
mod hook {
    pub use depthcal_model::hook::*;
}
mod piece {
    pub use depthcal_model::{Constant, Context, Covariate, On, Options, Parameter, Piece, Scalar, ScanKind};
}

#[rustfmt::skip]
#[path = "emitted/amplitude_bias.rs"]
mod amplitude_bias;
#[rustfmt::skip]
#[path = "emitted/rolling.rs"]
mod rolling;
#[rustfmt::skip]
#[path = "emitted/row_gain.rs"]
mod row_gain;
#[rustfmt::skip]
#[path = "emitted/sag.rs"]
mod sag;
#[rustfmt::skip]
#[path = "emitted/tangents.rs"]
mod tangents;
#[rustfmt::skip]
#[path = "emitted/warm_up.rs"]
mod warm_up;

fn emitted(name: &str) -> Arc<dyn AnyPiece> {
    let none = Options::new();
    match name {
        "row_gain" => erase(row_gain::RowGain::with_options(&none)),
        "warm_up" => erase(warm_up::WarmUp::with_options(&none)),
        "amplitude_bias" => erase(amplitude_bias::AmplitudeBias::with_options(&none)),
        "tangents" => erase(tangents::Tangents::with_options(&none)),
        "rolling" => erase(rolling::Rolling::with_options(&none)),
        _ => erase(sag::Sag::with_options(&none)),
    }
}

#[test]
fn emitted_files_are_up_to_date_and_have_the_formulas_values() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/emitted");
    let file = FormulaFile::read(&folder.join("all.toml")).unwrap_or_else(|e| panic!("{e}"));
    for effect in file.effects() {
        let path = folder.join(format!("{}.rs", effect.name()));
        if std::env::var_os("UPDATE_EMITTED").is_some() {
            std::fs::write(&path, effect.rust()).unwrap();
        }
        let written = std::fs::read_to_string(&path).unwrap();
        assert!(written == effect.rust(), "{} is out of date: run with UPDATE_EMITTED=1", path.display());

        let (formula, rust) = (effect.piece(&Options::new()), emitted(effect.name()));
        assert_eq!((formula.name(), formula.hook(), formula.form()), (rust.name(), rust.hook(), rust.form()));
        assert_eq!(formula.needs(), rust.needs());
        assert_eq!(formula.parameters(), rust.parameters());
        assert_eq!(formula.constants(), rust.constants());
        assert_eq!((formula.summary(), formula.equation()), (rust.summary(), rust.equation()));
        let (n_in, n_out) = match formula.hook() {
            HookKind::Lens => (5, 2),
            HookKind::Depth => (4, 1),
            HookKind::Pixel => (2, 2),
            _ => (3, 3),
        };
        let theta: Vec<f64> = formula.parameters().iter().map(|p| p.nominal + p.scale).collect();
        let run = |piece: &dyn AnyPiece| {
            let state = match n_in {
                5 => vec![0.21, 0.13, 1.0 / 800.0, 0.22, 0.14],
                4 => vec![0.21, -0.13, 1.0 / 800.0, 0.8],
                2 => vec![120.0, 300.0],
                _ => vec![110.0, 60.0, 0.5],
            };
            let context = depthcal_model::Context {
                pixel: [120.0, 300.0],
                amplitude: 600.0,
                surround: 1300.0,
                time_s: 200.0,
                temperature_c: 31.0,
                ..depthcal_model::Context::default()
            };
            let (mut out, mut d_state) = (vec![0.0; n_out], vec![0.0; n_out * n_in]);
            let mut d_theta = vec![0.0; n_out * theta.len()];
            piece.linearize(&theta, &state, &[context], &mut out, &mut d_state, Some(&mut d_theta));
            [out, d_state, d_theta].concat()
        };
        for (i, (a, b)) in run(&*formula).iter().zip(run(&*rust)).enumerate() {
            assert!((a - b).abs() <= 1e-12 * a.abs().max(1e-9), "{}, {i}: {a} {b}", effect.name());
        }
    }
}
