//! `select`: the best subset of many frames.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use depthcal_calibration::load::Loaded;
use depthcal_calibration::task::{NextRequest, SelectRequest, Selected};
use depthcal_io::{DATASET_FILE, DatasetFile, FileError, StagedDataset, write_atomically};
use depthcal_report::format::{count, quantity};
use depthcal_report::goal_words;
use serde_json::{Value, json};

use super::common::{Reading, camera_count};
use super::failure::{Failure, input};
use super::goal_options::GoalOptions;
use super::model_options::ModelOptions;
use super::progress::Progress;
use super::session::Session;
use super::voice::say;

/// Names of the folders of frames to fit and of frames to evaluate.
const PARTS: [&str; 2] = ["fitted", "held_out"];

/// Chooses the best subset of many frames, and sets frames aside for evaluation.
///
/// Fits all frames. A part of them, at all distances, is set aside; frames whose views are like theirs are not fitted. Of the
/// others the one that lowers the goal most is taken, then the next with it. With --out the frames are copied into two datasets,
/// fitted/ and held_out/.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal select captures/ --frames 40                      which they are, and which add nothing
  depthcal select captures/ --frames 40 --out selected/      … copied into selected/fitted and selected/held_out
  depthcal calibrate selected/fitted --out result/
  depthcal evaluate result/calibration.json selected/held_out --out check/")]
pub(super) struct Select {
    /// Folder with a dataset.toml.
    pub(super) dataset: PathBuf,
    /// Number of frames to fit.
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: u32,
    /// Share of all frames that is set aside for evaluation.
    #[arg(long, value_name = "SHARE", default_value_t = 0.2)]
    held_out: f64,
    /// Folder for the two datasets; created if it does not exist. It must not hold them already.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    goal: GoalOptions,
    /// The camera of a rig whose goal it is [default: the first with depth].
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    #[command(flatten)]
    pub(super) model: ModelOptions,
    #[command(flatten)]
    reading: Reading,
}

impl Select {
    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        if !(0.0..0.9).contains(&self.held_out) {
            let message = format!("--held-out is {}: give a share of 0 to less than 0.9", self.held_out);
            return Err(Failure::Input(message));
        }
        let request = self.model.request();
        camera_count(&self.dataset, |cameras| request.check(cameras, &session.register))?;
        let staged = self.out.as_deref().map(|out| StagedDataset::within(out, PARTS[0])).transpose().map_err(input)?;
        let loaded = self.reading.load(&self.dataset, session)?;
        let busy = Progress::busy("fitting");
        let fit = request.fit(&loaded, session.calibrate_options())?;
        drop(busy);
        let goal = NextRequest { camera: self.camera.clone(), ..self.goal.request() };
        let request = SelectRequest { goal, frames: self.frames as usize, held_out: self.held_out };
        let selected = request.select(&fit)?;
        print(&selected);
        let mut value = value(&selected);
        if let (Some(staged), Some(out)) = (staged, &self.out) {
            let selection = &selected.selection;
            let chosen = selection.chosen.iter().map(|frame| frame.name.clone()).collect();
            let parts = [chosen, selection.held_out.iter().cloned().collect::<BTreeSet<String>>()];
            let mut written = Vec::new();
            for (part, frames) in PARTS.iter().zip(&parts).filter(|(_, frames)| !frames.is_empty()) {
                write_part(&loaded, frames, &staged.folder().join(part))?;
                written.push(out.join(part));
            }
            staged.commit().map_err(input)?;
            written.iter().for_each(|path| say!("written: {}", path.display()));
            value["written"] = json!(written);
        }
        Ok(value)
    }
}

fn print(Selected { goal, unit, selection, .. }: &Selected) {
    let expected = selection.chosen.last().map_or(f64::NAN, |frame| frame.expected);
    say!(
        "{} to fit: {} of {} expected, {} with all that are not set aside",
        count(selection.chosen.len(), "frame"),
        quantity(expected, unit),
        goal_words(goal),
        quantity(selection.of_all, unit)
    );
    for (number, frame) in selection.chosen.iter().enumerate() {
        say!("  {}. {}  → {}", number + 1, frame.name, quantity(frame.expected, unit));
    }
    let list = |names: &[String]| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    say!("held out: {}", list(&selection.held_out));
    for [name, held] in &selection.like_held_out {
        say!("  not fitted: {name} (its view is like that of {held})");
    }
    say!("add less than 0.2 % each: {}", list(&selection.adds_nothing));
    if !selection.others.is_empty() {
        say!("would still add something: {}", list(&selection.others));
    }
}

fn value(Selected { camera, goal, unit, selection }: &Selected) -> Value {
    let chosen = selection.chosen.iter().map(|frame| json!({ "name": frame.name, "expected": frame.expected }));
    let like = selection.like_held_out.iter().map(|[name, held]| json!({ "name": name, "like": held }));
    json!({
        "camera": camera,
        "goal": goal_words(goal),
        "unit": unit,
        "chosen": chosen.collect::<Vec<_>>(),
        "held_out": selection.held_out,
        "like_held_out": like.collect::<Vec<_>>(),
        "adds_nothing": selection.adds_nothing,
        "others": selection.others,
        "expected_of_all": selection.of_all,
    })
}

/// Copies some frames of a dataset into a folder, as a dataset with a table that names the files of every frame.
fn write_part(loaded: &Loaded, frames: &BTreeSet<String>, folder: &Path) -> Result<(), Failure> {
    let Some(first) = loaded.cameras.first() else { return Ok(()) };
    let root = &first.declared.root;
    let mut declaration = DatasetFile::read(root.join(DATASET_FILE)).map_err(input)?;
    let is_short = declaration.is_short();
    let mut rows: BTreeMap<String, BTreeMap<String, String>> = BTreeMap::new();
    let mut columns = BTreeSet::new();
    for camera in &loaded.cameras {
        for frame in camera.declared.frames.iter().filter(|frame| frames.contains(&frame.name)) {
            let row = rows.entry(frame.name.clone()).or_default();
            for (kind, path) in [("image", &frame.image), ("depth", &frame.depth)] {
                let Some(path) = path else { continue };
                let within = path.strip_prefix(root).unwrap_or(path);
                copy(path, &folder.join(within))?;
                let column = if is_short { kind.to_owned() } else { format!("{}.{kind}", camera.name()) };
                row.insert(column, within.display().to_string());
            }
            let number = |value: Option<f64>| value.map(|value| value.to_string());
            let known = [
                ("timestamp_s", number(frame.metadata.timestamp_s)),
                ("temperature_c", number(frame.metadata.temperature_c)),
            ];
            let known = known.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?)));
            row.extend(known.chain(frame.metadata.other.clone()));
            columns.extend(row.keys().cloned());
        }
    }
    for camera in &mut declaration.cameras {
        (camera.image, camera.depth) = (None, None);
        // A file of intrinsics is named from where the dataset was.
        if let Some(intrinsics) = camera.camera.as_mut().and_then(|hint| hint.intrinsics.as_mut()) {
            let path = root.join(&*intrinsics);
            *intrinsics = std::path::absolute(&path).unwrap_or(path).display().to_string();
        }
    }
    (declaration.associations, declaration.within_s) = (None, None);
    declaration.metadata = Some("frames.csv".to_owned());
    let mut table = format!("frame,{}\n", columns.iter().cloned().collect::<Vec<_>>().join(","));
    for (name, row) in &rows {
        let cells = columns.iter().map(|column| cell(row.get(column).map_or("", String::as_str)));
        // Writing to a string cannot fail.
        let _ = writeln!(table, "{},{}", cell(name), cells.collect::<Vec<_>>().join(","));
    }
    write(&folder.join("frames.csv"), &table)?;
    let text = declaration.to_toml().map_err(input)?;
    DatasetFile::parse(&folder.join(DATASET_FILE), &text).map_err(input)?;
    write(&folder.join(DATASET_FILE), &text)
}

/// A cell of CSV, quoted where it needs it.
fn cell(text: &str) -> String {
    let is_plain = !text.contains([',', '"', '\n', '\r']);
    if is_plain { text.to_owned() } else { format!("\"{}\"", text.replace('"', "\"\"")) }
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    write_atomically(path, |file| file.write_all(text.as_bytes())).map_err(input)
}

fn copy(from: &Path, to: &Path) -> Result<(), Failure> {
    let unwritable = |error| input(FileError::Write { path: to.to_owned(), error });
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder).map_err(unwritable)?;
    }
    fs::copy(from, to).map(drop).map_err(unwritable)
}
