//! An effect of depth in another place or form than its equation's.

use std::sync::Arc;

use super::any::AnyPiece;
use super::context::Context;
use super::erased::identity;
use super::parameter::Parameter;
use super::placement::Placement;
use crate::hook::HookKind;

/// A piece of depth whose shape acts in the form of `placement`. The order of the chain has its place
/// ([`AnyPiece::placement`]): within the chain it is a map of the state that is handed to it, like any piece.
///
/// The size of the effect is that of the piece's own equation, in its own form; it is added in the other form so that both
/// agree at [`REFERENCE_DEPTH_MM`](super::placement::REFERENCE_DEPTH_MM).
#[derive(Debug)]
struct Placed {
    piece: Arc<dyn AnyPiece>,
    placement: Placement,
}

/// A piece in a place and a form; `None` for pieces that have none: those that do not act on depth, parts of the declared model,
/// maps and fields.
pub(crate) fn placed(piece: Arc<dyn AnyPiece>, placement: Placement) -> Option<Arc<dyn AnyPiece>> {
    let on = placement.on.filter(|on| *on != piece.form());
    let placement = Placement { on, ..placement };
    if placement.is_own() {
        return Some(piece);
    }
    piece.can_be_placed().then(|| Arc::new(Placed { piece, placement }) as Arc<dyn AnyPiece>)
}

/// Inputs of a piece of depth: x, y, ρ, cos θ.
const IN: usize = 4;
/// Place of ρ among them.
const RHO: usize = 2;

impl AnyPiece for Placed {
    fn name(&self) -> &'static str {
        self.piece.name()
    }
    fn described_by(&self) -> Option<&dyn AnyPiece> {
        Some(&*self.piece)
    }
    fn source(&self) -> &'static str {
        self.piece.source()
    }
    fn hook(&self) -> HookKind {
        HookKind::Depth
    }
    fn parameters(&self) -> &[Parameter] {
        self.piece.parameters()
    }
    fn placement(&self) -> Placement {
        self.placement
    }

    fn evaluate(&self, theta: &[f64], states: &[f64], contexts: &[Context], out: &mut [f64]) {
        self.piece.evaluate(theta, states, contexts, out);
        let Some(on) = self.placement.on else { return };
        let form = self.piece.form();
        for (state, out) in states.chunks_exact(IN).zip(out) {
            *out = on.apply(state[RHO], form.size_mm(state[RHO], *out)).0;
        }
    }

    fn linearize(
        &self,
        theta: &[f64],
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        d_state: &mut [f64],
        mut d_theta: Option<&mut [f64]>,
    ) {
        self.piece.linearize(theta, states, contexts, out, d_state, d_theta.as_deref_mut());
        let Some(on) = self.placement.on else { return };
        let (form, count) = (self.piece.form(), self.parameters().len());
        for (k, state) in states.chunks_exact(IN).enumerate() {
            let (size, [by_rho, by_out]) = form.size_with_derivatives(state[RHO], out[k]);
            let (placed, [direct, by_size]) = on.apply(state[RHO], size);
            out[k] = placed;
            let scale = by_size * by_out;
            let d_state = &mut d_state[k * IN..][..IN];
            d_state.iter_mut().for_each(|d| *d *= scale);
            d_state[RHO] += direct + by_size * by_rho;
            if let Some(d_theta) = d_theta.as_deref_mut() {
                d_theta[k * count..][..count].iter_mut().for_each(|d| *d *= scale);
            }
        }
    }

    fn linearize_at_nominal(
        &self,
        theta: &[f64],
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        d_state: &mut [f64],
        d_theta: &mut [f64],
    ) {
        self.piece.linearize_at_nominal(theta, states, contexts, out, d_state, d_theta);
        let Some(on) = self.placement.on else { return };
        for (state, row) in states.chunks_exact(IN).zip(d_theta.chunks_exact_mut(self.parameters().len().max(1))) {
            let (_, [_, by_out]) = self.piece.form().size_with_derivatives(state[RHO], state[RHO]);
            let (_, [_, by_size]) = on.apply(state[RHO], 0.0);
            row.iter_mut().for_each(|d| *d *= by_size * by_out);
        }
        identity(states, out, d_state);
    }
}

#[cfg(test)]
mod tests {
    use super::super::placement::{Of, On, REFERENCE_DEPTH_MM};
    use super::super::role::Role;
    use super::*;
    use crate::Register;

    fn effects() -> Vec<Arc<dyn AnyPiece>> {
        let register = Register::builtin();
        let all = register.names_at(HookKind::Depth).filter_map(|name| register.find(name));
        all.filter(|piece| piece.can_be_placed()).collect()
    }

    fn placements() -> impl Iterator<Item = Placement> {
        Of::ALL.into_iter().flat_map(|state| On::ALL.map(|on| Placement { of: state, on: Some(on) }))
    }

    fn context() -> Context {
        let stray = crate::StrayLight { scene: [[0.3, 0.1], [0.2, -0.2], [-0.1, 0.3]], near: 1.2 };
        let (amplitude, surround, slope) = (700.0, 900.0, [0.01, -0.02]);
        Context { amplitude, surround, slope, stray, time_s: 500.0, temperature_c: 31.0, ..Context::default() }
    }

    fn theta(piece: &dyn AnyPiece) -> Vec<f64> {
        piece.parameters().iter().map(|p| p.nominal + p.scale).collect()
    }

    fn value(piece: &dyn AnyPiece, state: [f64; 4]) -> f64 {
        let mut out = [0.0];
        piece.evaluate(&theta(piece), &state, &[context()], &mut out);
        out[0]
    }

    #[test]
    fn all_forms_agree_at_the_reference_depth_and_differ_elsewhere_as_they_say() {
        for piece in effects() {
            for placement in placements() {
                let other = placed(piece.clone(), placement).unwrap();
                let name = piece.name();
                let sizes_at = |rho: f64| {
                    let state = [0.2, -0.3, rho, 0.8];
                    (1.0 / value(&*piece, state) - 1.0 / rho, 1.0 / value(&*other, state) - 1.0 / rho)
                };
                let (original, changed) = sizes_at(1.0 / REFERENCE_DEPTH_MM);
                // Equal in first order: the forms differ by the square of the effect over the depth.
                let second_order = 2.0 * original * original / REFERENCE_DEPTH_MM + 1e-9;
                assert!((original - changed).abs() <= second_order, "{name}{placement}: {original} {changed}");
                // Twice as far an effect on depth stays, a factor doubles it, one on inverse depth makes it four times as large.
                let power = |on: On| match on {
                    On::Depth => 0,
                    On::Factor => 1,
                    On::InverseDepth => 2,
                };
                let (original, changed) = sizes_at(0.5 / REFERENCE_DEPTH_MM);
                let expected = original * 2f64.powi(power(placement.on.unwrap()) - power(piece.form()));
                let second_order = 4.0 * expected.abs().max(original.abs()).powi(2) / REFERENCE_DEPTH_MM + 1e-9;
                assert!((expected - changed).abs() <= second_order, "{name}{placement}: {expected} {changed}");
            }
        }
    }

    #[test]
    fn derivatives_match_differences() {
        for piece in effects() {
            for placement in placements() {
                let piece = placed(piece.clone(), placement).unwrap();
                let (state, theta) = ([0.2, -0.3, 1.0 / 1300.0, 0.8], theta(&*piece));
                let count = theta.len();
                let (mut out, mut d_state, mut d_theta) = ([0.0], [0.0; 4], vec![0.0; count]);
                piece.linearize(&theta, &state, &[context()], &mut out, &mut d_state, Some(&mut d_theta));
                assert!((out[0] - value(&*piece, state)).abs() <= 1e-15, "{}{placement}", piece.name());
                let evaluate = |theta: &[f64], state: &[f64]| {
                    let mut out = [0.0];
                    piece.evaluate(theta, state, &[context()], &mut out);
                    out[0]
                };
                let near = |derivative: f64, expected: f64, size: f64, what: &str| {
                    // Inverse depths of 1e-3 1/mm have 1e-19 of rounding, waves over depth some ten times that.
                    let tolerance = 1e-6 * expected.abs() + 1e-17 / size;
                    assert!(
                        (derivative - expected).abs() <= tolerance,
                        "{}{placement} {what}: {derivative} {expected}",
                        piece.name()
                    );
                };
                for i in 0..4 {
                    let h = 1e-5 * state[i].abs();
                    let mut ends = [state; 2];
                    ends[0][i] -= h;
                    ends[1][i] += h;
                    let expected = (evaluate(&theta, &ends[1]) - evaluate(&theta, &ends[0])) / (2.0 * h);
                    near(d_state[i], expected, h, "state");
                }
                for i in 0..count {
                    let h = 1e-3 * piece.parameters()[i].scale;
                    let mut ends = [theta.clone(), theta.clone()];
                    ends[0][i] -= h;
                    ends[1][i] += h;
                    let expected = (evaluate(&ends[1], &state) - evaluate(&ends[0], &state)) / (2.0 * h);
                    near(d_theta[i], expected, h, "theta");
                }
            }
        }
    }

    /// Every effect of depth, those that cannot be placed too: at its nominal parameters it changes nothing, and the short way to
    /// its derivatives gives those of the long one.
    #[test]
    fn at_nominal_parameters_the_derivatives_are_the_same() {
        let register = Register::builtin();
        let all = register.names_at(HookKind::Depth).filter_map(|name| register.find(name));
        for piece in all.filter(|piece| piece.role() == Role::Effect) {
            for placement in placements() {
                let piece = placed(piece.clone(), placement).unwrap_or_else(|| piece.clone());
                let theta: Vec<f64> = piece.parameters().iter().map(|p| p.nominal).collect();
                let states = [0.2, -0.3, 1.0 / 1300.0, 0.8, -0.1, 0.25, 1.0 / 700.0, 0.9];
                let contexts = [context(), context()];
                let mut results = [false, true].map(|short| {
                    let (mut out, mut d_state, mut d_theta) = ([0.0; 2], [0.0; 8], vec![0.0; 2 * theta.len()]);
                    if short {
                        piece.linearize_at_nominal(&theta, &states, &contexts, &mut out, &mut d_state, &mut d_theta);
                    } else {
                        piece.linearize(&theta, &states, &contexts, &mut out, &mut d_state, Some(&mut d_theta));
                    }
                    [&out[..], &d_state, &d_theta].concat()
                });
                let [long, short] = &mut results;
                for (i, (a, b)) in long.iter().zip(short.iter()).enumerate() {
                    let close = (a - b).abs() <= 1e-12 * a.abs().max(1e-6);
                    assert!(close, "{}{placement}, number {i}: {a} {b}", piece.name());
                }
            }
        }
    }

    #[test]
    fn only_effects_of_depth_have_a_place() {
        let register = Register::builtin();
        let measured = Placement { of: Of::Measured, on: None };
        for name in ["brown_conrady", "board_bow", "projective", "bspline", "free_map", "depth_registration"] {
            assert!(placed(register.find(name).unwrap(), measured).is_none(), "{name}");
        }
        let ripple = register.find("disparity_ripple").unwrap();
        let declared = Placement { of: Of::True, on: Some(On::InverseDepth) };
        assert!(placed(ripple, declared).unwrap().placement().is_own());
    }

    /// The description of a piece is that of its equation, wherever it acts.
    #[test]
    fn a_piece_in_another_place_describes_itself_as_before() {
        for piece in effects() {
            let other = placed(piece.clone(), Placement { of: Of::Measured, on: None }).unwrap();
            let words = |p: &dyn AnyPiece| {
                let texts = [p.name(), p.summary(), p.equation(), p.source(), p.confounded().unwrap_or_default()];
                (texts.map(str::to_owned), p.title().into_owned(), p.options(), p.needs(), p.role(), p.form())
            };
            assert_eq!(words(&*other), words(&*piece));
            assert_eq!((other.parameters(), other.constants()), (piece.parameters(), piece.constants()));
            assert_eq!((other.hook(), other.placement().of), (HookKind::Depth, Of::Measured));
        }
    }
}
