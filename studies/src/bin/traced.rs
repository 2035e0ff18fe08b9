//! A rendered rig with an effect that is not declared, and its diagnosis.
//!
//!     cargo run --release -p depthcal-studies --bin traced -- FOLDER infrared,depth SEED depth:cyclic_depth=4
//!
//! Renders into FOLDER unless it is there, and prints what every camera lacks.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::error::Error;
use std::path::Path;

use depthcal_calibration::diagnose::{DiagnoseOptions, diagnose};
use depthcal_calibration::load::{LoadOptions, load};
use depthcal_model::Register;
use depthcal_simulate::{Effect, Kind, RigCamera, RigSimulation};

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [folder, names, seed, effect] = &words[..] else {
        return Err("say FOLDER, CAMERA,…, SEED and CAMERA:EFFECT=SIZE".into());
    };
    let (faulty, effect) = effect.split_once(':').ok_or("the effect is CAMERA:EFFECT=SIZE")?;
    let (effect, size_mm) = effect.split_once('=').ok_or("the effect is CAMERA:EFFECT=SIZE")?;
    let mut cameras = Vec::new();
    for name in names.split(',') {
        let camera = RigCamera::usual(name, 1)?.ok_or("a camera without a usual form")?;
        cameras.push(match name == faulty {
            true => camera.effect(Effect::new(effect, size_mm.parse()?)?),
            false => camera,
        });
    }
    if !Path::new(folder).exists() {
        RigSimulation::new(cameras, Kind::General(1), seed.parse()?).frames(20).write_dataset(folder)?;
    }
    let rig = load(Path::new(folder), &LoadOptions { cache: None, ..LoadOptions::default() })?;
    let diagnosis = diagnose(
        &rig.capture(None, &Register::builtin())?,
        None,
        &DiagnoseOptions { formulas: false, ..DiagnoseOptions::default() },
    )?;
    println!("verdict: {:?}", diagnosis.verdict);
    for camera in &diagnosis.cameras {
        let effects: Vec<String> = camera.effects().iter().map(ToString::to_string).collect();
        println!("{}: {} ({:?})", camera.name, effects.join(", "), camera.verdict());
        for shown in camera.in_rig.iter().flat_map(|in_rig| &in_rig.before) {
            println!("  {} in the joint adjustment: {:?}", shown.spec, shown.left_out);
        }
    }
    Ok(())
}
