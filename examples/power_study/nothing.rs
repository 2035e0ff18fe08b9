//! Captures in which no effect may be named.

use depthcal::io::Verdict;
use depthcal_simulate::{Defects, Noise, Simulation};
use rayon::prelude::*;

use super::{Failure, Study, names, simulation};

impl Study {
    /// Captures without any fault.
    pub fn clean(&self) {
        self.nothing("clean", |s| s);
    }

    /// Noise with heavy tails.
    pub fn heavy_tails(&self) {
        self.nothing("heavy-tailed noise", |s| s.noise(Noise { tail_dof: Some(3.0), ..Noise::default() }));
    }

    /// Frames that do not belong, and gross outliers.
    pub fn bad_frames(&self) {
        self.nothing("two bad frames", |s| s.defects(Defects { bad_frames: 2, ..Defects::default() }));
        self.nothing("exchanged depth frames", |s| s.defects(Defects { swapped_depth_pairs: 1, ..Defects::default() }));
        self.nothing("duplicated frames", |s| s.defects(Defects { duplicated_frames: 2, ..Defects::default() }));
        self.nothing("5 % depth outliers", |s| s.defects(Defects { depth_outliers: 0.05, ..Defects::default() }));
    }

    fn nothing(&self, what: &str, change: impl Fn(Simulation) -> Simulation + Sync) {
        let runs: Vec<(String, Verdict)> = (0..self.seeds)
            .into_par_iter()
            .filter_map(|seed| {
                let run = || -> Result<_, Failure> {
                    let d = self.diagnose(&change(simulation(&[], 1000 + seed)?))?;
                    let bad: Vec<&str> = d.bad_frames.iter().map(|b| b.name.as_str()).collect();
                    eprintln!("{what} {seed}: {:?} {:?} left out {}", d.verdict, names(&d), bad.join(" "));
                    Ok((names(&d).join("+"), d.verdict))
                };
                run().inspect_err(|e| eprintln!("{what} seed {seed}: {e}")).ok()
            })
            .collect();
        let adequate = runs.iter().filter(|r| r.1 == Verdict::Adequate).count();
        let unnamed = runs.iter().filter(|r| r.0.is_empty()).count();
        println!("{what}: nothing named in {unnamed}, and nothing left in {adequate}, of {}", runs.len());
    }
}
