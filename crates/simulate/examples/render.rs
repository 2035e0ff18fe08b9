//! Writes one simulated dataset: `render DIR [KIND] [CAMERA] [SEED] [EFFECT[=SIZE]]…`
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::error::Error;
use std::time::Instant;

use depthcal_simulate::{CameraTruth, Effect, Kind, Simulation};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let get = |index: usize, default: &str| arguments.get(index).cloned().unwrap_or(default.to_owned());
    let dir = arguments.first().ok_or("usage: render DIR [KIND] [CAMERA] [SEED] [EFFECT[=SIZE]]...")?;
    let kind: Kind = get(1, "general1").parse()?;
    let camera = CameraTruth::published(get(2, "1").parse()?)?;
    let seed = get(3, "0").parse()?;
    let effects = arguments.iter().skip(4).map(|text| Effect::parse(text)).collect::<Result<Vec<_>, _>>()?;
    let effects: Vec<Effect> = effects.into_iter().flatten().collect();
    let start = Instant::now();
    let truth = Simulation::new(camera, kind, &effects, seed).write_dataset(dir)?;
    let seconds = start.elapsed().as_secs_f64();
    println!("{} frames in {seconds:.2} s", truth.frames.len());
    for effect in &truth.effects {
        println!("{} = {} {}: {:?}", effect.name, effect.size, effect.unit, effect.parameters);
    }
    Ok(())
}
