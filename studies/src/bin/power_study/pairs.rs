//! Two effects at once.

use depthcal_simulate::Effect;
use rayon::prelude::*;

use super::single::detectable_size;
use super::{Failure, Study, names, percent, simulation};

/// Pairs over all hooks.
const PAIRS: [(&str, &str); 6] = [
    ("cyclic_depth", "range_offset"),
    ("board_bow", "reflectivity_bias"),
    ("projector_distortion", "temporal_drift"),
    ("depth_registration", "incidence_bias"),
    ("disparity_ripple", "thin_prism"),
    ("radial_range", "temperature_drift"),
];

impl Study {
    /// Both effects of a pair at four times their detectable sizes: are both named, in either order?
    pub fn pairs(&self) {
        println!("| effects | both named | a false name beside them |");
        println!("|---|---|---|");
        for (a, b) in PAIRS.into_iter().filter(|(a, b)| self.wants(a) || self.wants(b)) {
            let runs: Vec<Vec<String>> = self
                .numbers()
                .into_par_iter()
                .filter_map(|seed| {
                    let run = || -> Result<_, Failure> {
                        let effect = |name| Ok::<_, Failure>(Effect::new(name, 4.0 * detectable_size(name, seed)?)?);
                        let d = self.diagnose(&simulation(&[effect(a)?, effect(b)?], seed)?)?;
                        let decisions: Vec<String> =
                            d.rounds.iter().map(|r| format!("{:?}: {:?}", r.decision, r.outcome)).collect();
                        eprintln!("{a} and {b} {seed}: {:?} {:?} {decisions:#?}", d.verdict, names(&d));
                        Ok(names(&d))
                    };
                    run().inspect_err(|e| eprintln!("{a} and {b} seed {seed}: {e}")).ok()
                })
                .collect();
            let both = runs.iter().filter(|r| r.iter().any(|n| n == a) && r.iter().any(|n| n == b)).count();
            let other = runs.iter().filter(|r| r.iter().any(|n| n != a && n != b)).count();
            println!("| {a}, {b} | {} | {} |", percent(both, runs.len()), percent(other, runs.len()));
        }
    }
}
