//! Captures in which no effect may be named.

use depthcal::io::Verdict;
use depthcal_simulate::{Defects, Noise, Simulation};
use rayon::prelude::*;

use super::drawn::drawn;
use super::{Failure, Study, names, simulation};

impl Study {
    /// Captures without any fault.
    pub fn clean(&self) {
        self.nothing("clean", 1000, |s, _| Ok(s));
    }

    /// Noise with heavy tails.
    pub fn heavy_tails(&self) {
        self.nothing("heavy-tailed noise", 1000, |s, _| Ok(s.noise(Noise { tail_dof: Some(3.0), ..Noise::default() })));
    }

    /// Cameras, boards, numbers of frames and noise drawn at random.
    pub fn faultless(&self) {
        self.nothing("faultless, everything drawn", 0, |_, seed| Ok(drawn(&[], seed)?.simulation));
    }

    /// Frames that do not belong, and gross outliers.
    pub fn bad_frames(&self) {
        self.nothing("two bad frames", 1000, |s, _| Ok(s.defects(Defects { bad_frames: 2, ..Defects::default() })));
        self.nothing("exchanged depth frames", 1000, |s, _| {
            Ok(s.defects(Defects { swapped_depth_pairs: 1, ..Defects::default() }))
        });
        self.nothing("duplicated frames", 1000, |s, _| {
            Ok(s.defects(Defects { duplicated_frames: 2, ..Defects::default() }))
        });
        self.nothing("5 % depth outliers", 1000, |s, _| {
            Ok(s.defects(Defects { depth_outliers: 0.05, ..Defects::default() }))
        });
    }

    fn nothing(&self, what: &str, first: u64, change: impl Fn(Simulation, u64) -> Result<Simulation, Failure> + Sync) {
        let runs: Vec<(String, Verdict)> = self
            .numbers()
            .into_par_iter()
            .filter_map(|seed| {
                let run = || -> Result<_, Failure> {
                    let d = self.diagnose(&change(simulation(&[], first + seed)?, first + seed)?)?;
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
