//! `simulate`: datasets of cameras whose errors are known.

use std::fmt::Write as _;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use std::{fs, io};

use clap::Args;
use depthcal_formula::{FormulaCovariate, FormulaEffect};
use depthcal_io::{DATASET_FILE, FileError, StagedDataset, write_json};
use depthcal_model::hook::HookKind;
use depthcal_model::{AddsTo, Of};
use depthcal_simulate::{
    CameraTruth, Effect, EffectInfo, Form, GivenEffect, Kind, Observation, Place, RigCamera, RigSimulation,
    SimulateError, Simulation, catalogue, of_whole_frames, uncatalogued,
};

use serde_json::{Value, json};

use super::common::{Output, read_formulas};
use super::failure::{Failure, input};
use super::voice::say;
use crate::progress::Progress;
use depthcal_report::format::count;

/// Renders captures of a board by a depth camera whose errors are known, as a dataset.
///
/// The dataset does not contain which effects were simulated; --truth writes them to a file elsewhere. The same seed gives
/// the same bytes.
#[derive(Debug, Args)]
#[command(after_long_help = effects_help())]
pub(super) struct Simulate {
    /// Camera of Sjöholm 2017: 1, 2, 3 or 4; or fisheye, of 150°.
    #[arg(long, value_name = "N", default_value = "1")]
    camera: String,
    /// Poses of the board: general1 (any generalN is another such capture), centered1, longplywood1, longplywood2,
    /// plywood1, sameheight1, sameheight2 or vertical1.
    #[arg(long, default_value = "general1")]
    kind: String,
    /// A rig of several cameras instead, the first of which is the reference: infrared (with depth), colour and depth (without
    /// images), with a number for further ones, such as infrared,colour or infrared,infrared2,depth.
    #[arg(long, value_delimiter = ',', value_name = "CAMERA,…", conflicts_with = "with")]
    rig: Vec<String>,
    /// An error of camera or board, of its usual size or of SIZE; may be given several times. --help lists them. With --rig,
    /// CAMERA:NAME[=SIZE] is an error of one camera; others are the reference's, but for those of the board, which all see.
    #[arg(long, value_name = "NAME[=SIZE]")]
    effect: Vec<String>,
    /// Files of formulas of depth with a `value` of every parameter: further errors of the camera.
    #[arg(long, value_delimiter = ',', value_name = "FILE.toml,…")]
    with: Vec<PathBuf>,
    /// Seed of poses, times and noise.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Number of frames [default: that of the kind].
    #[arg(long, value_name = "N")]
    frames: Option<usize>,
    /// JSON file for what was simulated; outside the dataset.
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    #[command(flatten)]
    pub(super) output: Output,
}

impl Simulate {
    /// The camera that is asked for.
    fn camera(&self) -> Result<CameraTruth, Failure> {
        if self.camera == "fisheye" {
            return Ok(CameraTruth::fisheye_150());
        }
        let number = self.camera.parse::<usize>();
        let number =
            number.map_err(|_| Failure::Input(format!("--camera {}: write 1, 2, 3, 4 or fisheye", self.camera)))?;
        CameraTruth::published(number).map_err(|e| Failure::Input(format!("--camera: {e}")))
    }

    pub(super) fn run(&self) -> Result<Value, Failure> {
        let rendered = if self.rig.is_empty() {
            Rendered::Camera(Box::new(self.simulation()?))
        } else {
            Rendered::Rig(Box::new(self.rig()?))
        };
        let out = &self.output.out;
        if let Some(truth) = self.truth.as_deref().filter(|truth| resolved(truth).starts_with(resolved(out))) {
            return Err(Failure::Input(format!(
                "--truth {} lies inside the dataset, which must not tell what was simulated: give a file outside {}",
                truth.display(),
                out.display()
            )));
        }
        let staged = StagedDataset::within(out, DATASET_FILE).map_err(input)?;
        check_empty(out, &staged)?;
        let busy = Progress::busy("rendering");
        let frames = self.render(&rendered, &staged)?;
        drop(busy);
        staged.commit().map_err(input)?;
        say!("{} written: {}", count(frames, "frame"), out.display());
        Ok(json!({ "frames": frames, "written": [out] }))
    }

    fn simulation(&self) -> Result<Simulation, Failure> {
        let camera = self.camera()?;
        let kind: Kind = self.kind.parse().map_err(|e| Failure::Input(format!("--kind: {e}")))?;
        let effects = self.effect.iter().filter_map(|text| Effect::parse(text).transpose());
        let effects: Vec<Effect> =
            effects.collect::<Result<_, _>>().map_err(|e| Failure::Input(format!("--effect: {e}")))?;
        let simulation = Simulation::new(camera, kind, &effects, self.seed);
        let mut given = Vec::new();
        for path in &self.with {
            for effect in read_formulas(path)? {
                given.push(
                    given_effect(&effect).map_err(|e| Failure::Input(format!("--with {}: {e}", path.display())))?,
                );
            }
        }
        let simulation = simulation.given(given);
        let simulation = match self.frames {
            Some(frames) => simulation.frames(frames),
            None => simulation,
        };
        // Errors of the simulation show before a folder is created.
        simulation.truth().map_err(input)?;
        Ok(simulation)
    }

    /// The rig that is asked for.
    fn rig(&self) -> Result<RigSimulation, Failure> {
        let kind: Kind = self.kind.parse().map_err(|e| Failure::Input(format!("--kind: {e}")))?;
        let model =
            self.camera.parse::<usize>().map_err(|_| Failure::Input("--camera: write 1, 2, 3 or 4".to_owned()))?;
        let mut cameras = Vec::new();
        for name in &self.rig {
            let usual = RigCamera::usual(name, model).map_err(|e| Failure::Input(format!("--camera: {e}")))?;
            let known = "infrared, colour and depth, with a number for further ones";
            let camera = usual.ok_or_else(|| Failure::Input(format!("--rig {name}: cameras are {known}")))?;
            if cameras.iter().any(|c: &RigCamera| c.name == camera.name) {
                return Err(Failure::Input(format!("--rig {name}: there are two of this name: write {name}2")));
            }
            cameras.push(camera);
        }
        let mut of_board = Vec::new();
        for text in &self.effect {
            let wrong = |error: String| Failure::Input(format!("--effect {text}: {error}"));
            let (camera, effect) = match text.split_once(':') {
                Some((name, effect)) => (Some(name), effect),
                None => (None, text.as_str()),
            };
            let named = |name: &str| cameras.iter().position(|c| c.name == name);
            let place = camera.map_or(Some(0), named);
            let place = place.ok_or_else(|| wrong(format!("--rig has no camera {}", camera.unwrap_or_default())))?;
            let Some(effect) = Effect::parse(effect).map_err(|e| wrong(e.to_string()))? else { continue };
            match (effect.info().map_err(input)?.hook, camera) {
                ("board", None) => of_board.push(effect),
                ("board", Some(_)) => {
                    return Err(wrong("all cameras see the same board: give it without a camera".to_owned()));
                }
                _ => cameras[place].effects.push(effect),
            }
        }
        let mut rig = RigSimulation::new(cameras, kind, self.seed);
        rig = of_board.into_iter().fold(rig, RigSimulation::board_effect);
        if let Some(frames) = self.frames {
            rig = rig.frames(frames);
        }
        rig.truth().map_err(input)?;
        Ok(rig)
    }

    fn write_truth(&self, truth: &impl serde::Serialize) -> Result<(), Failure> {
        self.truth.as_ref().map_or(Ok(()), |path| write_json(path, truth).map_err(input))
    }

    /// Renders the frames; returns their number.
    fn render(&self, rendered: &Rendered, staged: &StagedDataset) -> Result<usize, Failure> {
        let failed = |error| match error {
            SimulateError::Write { path, source } => input(staged.located(FileError::Write { path, error: source })),
            other => input(other),
        };
        match rendered {
            Rendered::Camera(simulation) => {
                let truth = simulation.write_dataset(staged.folder()).map_err(failed)?;
                self.write_truth(&truth)?;
                Ok(truth.frames.len())
            }
            Rendered::Rig(rig) => {
                let truth = rig.write_dataset(staged.folder()).map_err(failed)?;
                self.write_truth(&truth)?;
                Ok(truth.cameras.first().map_or(0, |camera| camera.truth.frames.len()))
            }
        }
    }
}

/// The cameras that are rendered.
enum Rendered {
    Camera(Box<Simulation>),
    Rig(Box<RigSimulation>),
}

/// A formula as an effect of the simulation.
fn given_effect(effect: &FormulaEffect) -> Result<GivenEffect, String> {
    let name = effect.name();
    let form = match (effect.hook(), effect.adds_to()) {
        (HookKind::Depth, AddsTo::Depth) => Form::Depth,
        (HookKind::Depth, AddsTo::InverseDepth) => Form::InverseDepth,
        (HookKind::Depth, _) => Form::Factor,
        (hook, _) => {
            return Err(format!(
                "effect '{name}' acts on the {}; formulas are simulated at hook 'depth' only",
                hook.name()
            ));
        }
    };
    let Some(theta) = effect.values() else {
        let remedy = "parameters = { a = { unit = \"mm\", value = 2 } }";
        return Err(format!("effect '{name}' has no value of every parameter: write {remedy}"));
    };
    let is_unknown =
        |c: &&FormulaCovariate| matches!(c, FormulaCovariate::Surroundings | FormulaCovariate::Quantity(_));
    if let Some(unknown) = effect.covariates().iter().find(is_unknown) {
        let unknown = unknown.name();
        return Err(format!("effect '{name}' depends on '{unknown}', which the simulator does not have"));
    }
    let function = effect.function();
    let value_at = |o: &Observation, covariate: FormulaCovariate| {
        use FormulaCovariate as C;
        let [x, y] = o.ray;
        match covariate {
            C::X => x,
            C::Y => y,
            C::R => x.hypot(y),
            C::U => o.pixel[0],
            C::V => o.pixel[1],
            C::Z => o.depth_mm,
            C::Rho => 1.0 / o.depth_mm,
            C::Range => o.depth_mm * (1.0 + x * x + y * y).sqrt(),
            C::Incidence => 1.0 / o.cosine - 1.0,
            // Simulated images have 8 bits; a pixel without light has no logarithm.
            C::Amplitude => (255.0 * o.amplitude).max(1e-3),
            C::Time => o.time_s,
            C::Temperature => o.temperature_c,
            C::Surroundings | C::BoardX | C::BoardY | C::Quantity(_) => f64::NAN,
        }
    };
    Ok(GivenEffect {
        name: name.to_owned(),
        place: if effect.definition().of == Of::Measured { Place::Measured } else { Place::True },
        form,
        function: Arc::new(move |observation| {
            let covariates: Vec<f64> = function.covariates().iter().map(|c| value_at(observation, *c)).collect();
            function.values(&theta, &covariates)[0]
        }),
    })
}

/// Refuses a folder that is not empty, so that nothing of the user's is overwritten or mixed with the dataset.
fn check_empty(out: &Path, staged: &StagedDataset) -> Result<(), Failure> {
    for entry in fs::read_dir(out).map_err(|e| unwritable(out, &e))? {
        let entry = entry.map_err(|e| unwritable(out, &e))?;
        if entry.path() != staged.folder() {
            return Err(Failure::Input(format!(
                "{} is not empty (it holds {}): give --out a new or an empty folder",
                out.display(),
                entry.file_name().display()
            )));
        }
    }
    Ok(())
}

fn unwritable(path: &Path, error: &io::Error) -> Failure {
    Failure::Input(format!("{}: cannot write here: {error}; give --out a folder that can be written", path.display()))
}

/// The path without links, `.` and `..`; it need not exist.
fn resolved(path: &Path) -> PathBuf {
    let mut resolved = PathBuf::new();
    for component in std::path::absolute(path).unwrap_or_else(|_| path.to_owned()).components() {
        match component {
            Component::ParentDir => _ = resolved.pop(),
            other => resolved.push(other),
        }
        if let Ok(real) = resolved.canonicalize() {
            resolved = real;
        }
    }
    resolved
}

/// All effects with their usual sizes.
fn effects_help() -> String {
    let mut text = "Examples:
  depthcal simulate --camera 1 --kind general1 --out captures/
  depthcal simulate --camera fisheye --out wide/        150°, for the lens kannala-brandt
  depthcal simulate --rig infrared,colour --out rig/     several cameras
  depthcal simulate --effect cyclic_depth=4 --effect thin_prism --truth truth.json --out captures/

"
    .to_owned();
    let mut list = |title: &str, effects: &[EffectInfo]| {
        let _ = writeln!(text, "{title}:");
        for effect in effects {
            let _ =
                writeln!(text, "  {:22} {:>5} {}  {}", effect.name, effect.default_size, effect.unit, effect.size_is);
        }
    };
    list("Effects that depthcal has models for, with their usual sizes", catalogue());
    list("\nOther effects", uncatalogued());
    list("\nEffects of whole frames, in images only", of_whole_frames());
    text
}
