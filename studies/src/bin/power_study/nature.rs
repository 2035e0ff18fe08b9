//! Functions that no catalogue has, of random covariates, places and forms, seen by random cameras.

use depthcal::calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal::calibration::diagnose::{CameraDiagnoseOptions, FREE_MAP};
use depthcal::calibration::judge::cross_validation::{cross_validate_thinned, errors};
use depthcal::calibration::judge::parts::Parts;
use depthcal::io::Verdict;
use depthcal_simulate::Effect;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::drawn::drawn;
use super::{Failure, Study, depth_rms_mm, names, percent};

/// Smallest and largest function, mm root mean square; between them evenly in the logarithm.
const SIZES_MM: [f64; 2] = [0.3, 6.0];
/// Held-out error over that of the same capture without the function from which the verdict must not be `adequate`.
const MUCH: f64 = 1.1;

/// Board pixels of a frame, about, on which errors without the function are judged.
const JUDGED_PIXELS: usize = 16_000;

/// One run: names, verdict, held-out error over that of the same capture without the function.
type Run = (Vec<String>, Verdict, f64);

impl Study {
    /// One capture per seed.
    pub fn nature(&self) {
        let runs: Vec<Run> = self
            .numbers()
            .into_par_iter()
            .filter_map(|seed| self.natural(seed).inspect_err(|e| eprintln!("nature {seed}: {e}")).ok())
            .collect();
        let n = runs.len();
        let nameless = runs.iter().filter(|r| r.0.is_empty()).count();
        let large: Vec<&Run> = runs.iter().filter(|r| r.2 > MUCH).collect();
        let seen = large.iter().filter(|r| r.1 != Verdict::Adequate).count();
        println!("functions in no catalogue: no name in {} of {n}", percent(nameless, n));
        println!(
            "not adequate in {} of the {} with an error of more than {MUCH} times that without it",
            percent(seen, large.len()),
            large.len()
        );
    }

    fn natural(&self, seed: u64) -> Result<Run, Failure> {
        let mut rng = ChaCha8Rng::seed_from_u64(9000 + seed);
        let size = SIZES_MM[0] * (SIZES_MM[1] / SIZES_MM[0]).powf(rng.random());
        let simulation = drawn(&[Effect::new("nature", size)?], seed)?.simulation;
        let d = self.diagnose(&simulation)?;
        let function: Vec<String> =
            simulation.truth()?.effects.iter().flat_map(|e| e.parameters.keys().cloned()).collect();
        let options = CameraOptions::default();
        let without = calibrate_camera(&self.capture(&drawn(&[], seed)?.simulation)?, &options)?;
        let folds = CameraDiagnoseOptions::default().folds;
        let pure = errors(&cross_validate_thinned(&without, folds, Parts::Interleaved, JUDGED_PIXELS, &options)?);
        let ratio = depth_rms_mm(&d.before) / pure.depth_rms_mm.unwrap_or(f64::NAN);
        // The free map and formulas describe and name nothing.
        let is_description = |name: &String| name == FREE_MAP || d.formulas.iter().any(|f| f.effect.name() == name);
        let (verdict, mut names) = (d.verdict, names(&d));
        names.retain(|name| !is_description(name));
        eprintln!("nature {seed}: {size:.2} mm {verdict:?} {names:?} error over pure {ratio:.3} {function:?}");
        Ok((names, verdict, ratio))
    }
}
