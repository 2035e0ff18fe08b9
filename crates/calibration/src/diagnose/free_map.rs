//! The free map: a field over the image that corrects what no named effect explains. It names no cause.

use tracing::info;

use super::augmented_model::{AddedEffect, AugmentedModel, Fitted};
use super::evidence::Evidence;
use super::free_functions::Along;

/// Name of the free map among effects.
pub const FREE_MAP: &str = "free_map";
/// Forms of the map that are tried: an offset of inverse depth, and an offset with a scale.
const FORMS: [&str; 2] = [FREE_MAP, "bspline@columns=6@rows=6"];
/// A map that is fine across the rows of the image, for residuals that follow the row alone.
const FINE_ROWS: &str = "free_map@columns=4@rows=48";
/// A map that is fine across the columns, for residuals that follow the column alone.
const FINE_COLUMNS: &str = "free_map@columns=64@rows=4";

impl AugmentedModel<'_> {
    /// Adds the free map in the form with the smallest held-out depth error, for the free function `found`. Where no form is
    /// better than the present model nothing is added.
    pub fn add_free_map(&mut self, found: &Evidence, present: &mut Fitted, p_value: f64) {
        let fine = match found.along {
            Some(Along::Row) => Some(FINE_ROWS),
            Some(Along::Column) => Some(FINE_COLUMNS),
            _ => None,
        };
        let rms = |f: &Fitted| f.held_out.errors.depth_rms_mm.unwrap_or(f64::INFINITY);
        let mut best: Option<(&str, Fitted)> = None;
        for spec in FORMS.into_iter().chain(fine) {
            let mut model = self.present();
            model.effects.push(spec.to_owned());
            let fitted = match self.fitted(&model) {
                Ok(fitted) => fitted,
                Err(error) => {
                    info!("{spec} cannot be fitted: {error}");
                    continue;
                }
            };
            let lowest = rms(best.as_ref().map_or(&*present, |(_, b)| b));
            if self.improves(present, &fitted) && rms(&fitted) < lowest {
                best = Some((spec, fitted));
            }
        }
        let Some((spec, fitted)) = best else { return };
        self.added.push(AddedEffect {
            evidence: Evidence { name: FREE_MAP.to_owned(), spec: spec.to_owned(), ..found.clone() },
            effects: vec![FREE_MAP.to_owned()],
            indistinguishable: Vec::new(),
            p_value,
            after: fitted.held_out.clone(),
        });
        *present = fitted;
    }
}
