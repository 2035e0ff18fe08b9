//! How far captures may be spoiled: frames that do not belong, gross outliers, holes, wrong start values, wrong declarations.
//!
//! `cargo run --release -p depthcal-studies --bin robustness -- [--seeds N] [--frames N] [--cases a,b]`
//!
//! Every capture is rendered, spoiled, written as a dataset, detected, calibrated and diagnosed as by the command line. A fit is
//! *right* where all free parameters together are within three standard deviations of the truth (χ² at 0.27 %). A *warning* is an
//! error instead of a result, a frame or a marker that is left out and listed, or, of `diagnose`, a bad frame, a declaration that
//! cannot be right, or any verdict but `adequate`. What counts is the last column but one: results that are not right and say
//! nothing.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

mod case;
mod outcome;
mod rendered;
mod spoil;

use std::error::Error;

use rayon::prelude::*;

use crate::case::{Case, cases};
use crate::outcome::{Outcome, row};
use crate::rendered::Rendered;

/// Any error of a study.
type Failure = Box<dyn Error + Send + Sync>;

/// Options of the command line.
struct Options {
    seeds: u64,
    frames: usize,
    cases: Vec<String>,
}

impl Options {
    fn of_arguments() -> Result<Self, Failure> {
        let usage = "usage: robustness [--seeds N] [--frames N] [--cases a,b]";
        let mut options = Self { seeds: 3, frames: 24, cases: Vec::new() };
        let mut arguments = std::env::args().skip(1);
        while let Some(name) = arguments.next() {
            let value = arguments.next().ok_or(usage)?;
            match name.as_str() {
                "--seeds" => options.seeds = value.parse()?,
                "--frames" => options.frames = value.parse()?,
                "--cases" => options.cases = value.split(',').map(str::to_owned).collect(),
                _ => return Err(usage.into()),
            }
        }
        Ok(options)
    }
}

fn main() -> Result<(), Failure> {
    let options = Options::of_arguments()?;
    let wanted = |case: &Case| options.cases.is_empty() || options.cases.iter().any(|c| case.name.starts_with(c));
    let rendered: Vec<Rendered> =
        (0..options.seeds).map(|seed| Rendered::new(seed, options.frames)).collect::<Result<_, _>>()?;
    println!(
        "| what is wrong | captures | refused | right | `calibrate` warns | `diagnose` warns | wrong without a warning of `calibrate` | of \
         either | depth error on other frames over that of the unspoiled: median, worst |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let anything = Outcome { dropped: usize::MAX, wrong_markers: usize::MAX, ..Outcome::default() };
    let plain = |rendered: &Rendered| Outcome::of(rendered, &Case::nothing(), &anything);
    let plain: Vec<Outcome> = rendered.par_iter().map(plain).collect::<Result<_, _>>()?;
    for case in cases().iter().filter(|case| wanted(case)) {
        let outcome = |(rendered, plain): (&Rendered, &Outcome)| Outcome::of(rendered, case, plain);
        let outcomes: Vec<Outcome> = rendered.par_iter().zip(&plain).map(outcome).collect::<Result<_, _>>()?;
        println!("{}", row(&case.name, &outcomes, &plain));
    }
    Ok(())
}
