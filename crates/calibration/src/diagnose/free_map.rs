//! The free map: a field over the image that corrects what no named effect explains. It names no cause.

use depthcal_model::PieceSpec;
use tracing::info;

use super::augmented_model::{AddedEffect, AugmentedModel, Fitted};
use super::evidence::Evidence;
use super::free_functions::Along;
use super::held_out::Gain;

/// Name of the free map among effects.
pub const FREE_MAP: &str = "free_map";

/// A map over the image with a number of columns and rows of nodes.
fn map(name: &str, columns: f64, rows: f64) -> PieceSpec {
    PieceSpec::new(name).with("columns", columns).with("rows", rows)
}

impl AugmentedModel<'_> {
    /// Adds the free map in the form with the smallest held-out depth error, for the free function `found`. Where no form is
    /// better than the present model nothing is added.
    pub fn add_free_map(&mut self, found: &Evidence, present: &mut Fitted, p_value: f64) {
        // An offset of inverse depth, and an offset with a scale.
        let forms = [PieceSpec::new(FREE_MAP), map("bspline", 6.0, 6.0)];
        // Fine across what the residuals follow alone.
        let fine = match found.along {
            Some(Along::Row) => Some(map(FREE_MAP, 4.0, 48.0)),
            Some(Along::Column) => Some(map(FREE_MAP, 64.0, 4.0)),
            _ => None,
        };
        let rms = |f: &Fitted| f.held_out.errors.depth_rms_mm.unwrap_or(f64::INFINITY);
        let mut best: Option<(PieceSpec, Fitted)> = None;
        for spec in forms.into_iter().chain(fine) {
            let mut model = self.present();
            model.effects.push(spec.clone());
            let fitted = match self.fitted(&model) {
                Ok(fitted) => fitted,
                Err(error) => {
                    info!("{spec} cannot be fitted: {error}");
                    continue;
                }
            };
            // A map names no cause: that it may be chance is no reason against it where the error falls.
            let lowest = rms(best.as_ref().map_or(&*present, |(_, b)| b));
            if self.gain(present, &fitted, &[]) != Gain::None && rms(&fitted) < lowest {
                best = Some((spec, fitted));
            }
        }
        let Some((spec, fitted)) = best else { return };
        self.added.push(AddedEffect {
            evidence: Evidence { name: FREE_MAP.to_owned(), spec, ..found.clone() },
            effects: vec![FREE_MAP.to_owned()],
            indistinguishable: Vec::new(),
            placements_not_told_apart: Vec::new(),
            p_value,
            after: fitted.held_out.clone(),
        });
        *present = fitted;
    }
}
