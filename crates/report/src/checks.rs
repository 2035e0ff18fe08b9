//! May I trust this calibration? What an experienced eye would look at, one answer each.

use super::covariates::Image;
use super::headline::{Direction, direction};
use super::html::{count, fixed, number};
use super::leftover::{Leftover, join};
use super::pool::Pool;
use super::{ReportInput, Role};

/// How an answer turned out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// As it should be.
    Good,
    /// Worth a thought before relying on the result.
    Care,
    /// A reason not to use the result.
    Bad,
}

impl Level {
    /// A word for people and for style sheets.
    pub fn name(self) -> &'static str {
        match self {
            Level::Good => "good",
            Level::Care => "care",
            Level::Bad => "bad",
        }
    }
}

/// One question with its answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Check {
    /// How it turned out.
    pub level: Level,
    /// What was asked.
    pub question: &'static str,
    /// The answer in a sentence.
    pub answer: String,
}

/// Held-out errors may exceed fitted ones by this factor before it is remarked on.
const OVERFIT: f64 = 1.3;
/// Frames below which an interval is too narrow.
const FEW_FRAMES: usize = 8;
/// Share of the image that the markers should reach.
const COVERED: f64 = 0.7;
/// Ratio of farthest to nearest depth below which offset and scale cannot be told apart.
const DEPTH_RATIO: f64 = 1.5;
/// Tilt of the board, degrees, below which focal length and distance are hard to tell apart.
const TILT: f64 = 20.0;

/// All answers that these data allow.
pub(super) fn checks(input: &ReportInput<'_>, image: &Image, leftover: Option<&Leftover>) -> Vec<Check> {
    let mut list = Vec::new();
    let mut add = |level, question, answer: String| list.push(Check { level, question, answer });
    let (pool, role) = Pool::headline(input);
    let depth = pool.depth_rms();
    if let Some(c) = input.calibrated {
        add(
            Level::Good,
            "Did the fit converge?",
            format!("Yes: {} ({}).", c.termination, count(c.iterations, "iteration")),
        );
    }
    let frames = pool.frames.len();
    if frames > 0 {
        let (level, answer) = match (role, frames) {
            (Role::Fitted, _) => (
                Level::Care,
                "No: all errors here are on frames that the fit has seen, which flatters them. Calibrate with \
                 --hold-out, or evaluate on another capture."
                    .to_owned(),
            ),
            (_, n) if n < FEW_FRAMES => {
                (Level::Care, format!("Yes, but on {} only: the interval is likely too narrow.", count(n, "frame")))
            }
            (_, n) => (Level::Good, format!("Yes, on {}.", count(n, "frame"))),
        };
        add(level, "Was it judged on frames that the fit did not see?", answer);
    }
    if let Some(change) = &depth {
        let (level, answer) = match direction(change) {
            Direction::Fell => (Level::Good, "Yes, by more than the frames disagree."),
            Direction::Same => (Level::Care, "Not by more than the frames disagree."),
            Direction::Rose => (Level::Bad, "No: it makes the depth worse."),
        };
        add(level, "Does the correction help?", answer.to_owned());
    }
    if let (Some(unseen), Role::HeldOut | Role::Other) = (&depth, role)
        && let Some(seen) = Pool::of(input, |r| r == Role::Fitted).depth_rms()
    {
        let ratio = unseen.after.value / seen.after.value;
        let overfit = ratio > OVERFIT && unseen.after.low > seen.after.value;
        let level = if overfit { Level::Care } else { Level::Good };
        let numbers = format!(
            "{} mm rms on frames that it did not see, {} mm on those that it did",
            number(unseen.after.value),
            number(seen.after.value)
        );
        let answer = if overfit { format!("No: {numbers}.") } else { format!("Yes: {numbers}.") };
        add(level, "Is it as good on new frames as on fitted ones?", answer);
    }
    match leftover {
        Some(l) => {
            let doubt = l.found().next().is_some() || l.could_hide_much();
            let level = if doubt { Level::Care } else { Level::Good };
            add(level, "Is the rest noise?", l.sentence());
        }
        None if depth.is_some() => {
            let answer = "Unknown: too few frames with depth to tell a pattern from chance.".to_owned();
            add(Level::Care, "Is the rest noise?", answer);
        }
        None => {}
    }
    coverage(input, image, &mut add);
    if let Some(c) = input.calibrated {
        let samples: usize = c.capture.frames.iter().map(|f| f.samples.len()).sum();
        if c.with_depth && samples > 0 {
            let share = c.outliers as f64 / (samples + c.outliers) as f64;
            let level = if share < 0.02 { Level::Good } else { Level::Care };
            let answer = format!("{} of {} depth samples were left out as outliers.", c.outliers, samples + c.outliers);
            add(level, "Were there many outliers?", answer);
        }
    }
    let dropped: usize = super::tables::dropped(input).len();
    let used = input.calibrated.map_or(0, |c| c.capture.frames.len()).max(Pool::of(input, |_| true).frames.len());
    let share = dropped as f64 / (dropped + used).max(1) as f64;
    let level = if share <= 0.2 { Level::Good } else { Level::Care };
    let answer = match dropped {
        0 => "No.".to_owned(),
        n => format!("{} of {}; the reasons are listed below.", n, count(n + used, "frame")),
    };
    add(level, "Were frames dropped?", answer);
    let lost: usize = Pool::of(input, |_| true).frames.iter().map(|f| f.frame.uncorrectable).sum();
    if lost > 0 {
        let answer =
            format!("No: {} of the board cannot be corrected, the model folds there.", count(lost, "depth pixel"));
        add(Level::Care, "Can every pixel be corrected?", answer);
    }
    // What needs thought comes first.
    list.sort_by_key(|c| std::cmp::Reverse(c.level));
    list
}

fn coverage(input: &ReportInput<'_>, image: &Image, add: &mut impl FnMut(Level, &'static str, String)) {
    let fitted = Pool::of(input, |r| r == Role::Fitted);
    let fitted = if fitted.frames.is_empty() { Pool::of(input, |_| true) } else { fitted };
    let (mut pixels, mut poses): (Vec<[f64; 2]>, Vec<_>) = fitted
        .frames
        .iter()
        .map(|f| (f.frame.reprojection.iter().map(|e| [e[0], e[1]]).collect::<Vec<_>>(), f.frame.camera_from_board))
        .fold((Vec::new(), Vec::new()), |(mut a, mut b), (p, pose)| {
            a.extend(p);
            b.push(pose);
            (a, b)
        });
    if let Some(c) = input.calibrated {
        pixels = c.capture.frames.iter().flat_map(|f| f.markers.iter().map(|m| m.pixel)).collect();
        poses = c.capture.poses().collect();
    }
    if pixels.is_empty() || poses.is_empty() {
        return;
    }
    let grid = [8, 6];
    let mut hit = [false; 48];
    pixels.iter().filter_map(|p| image.cell(grid, *p)).for_each(|c| hit[c] = true);
    let share = hit.iter().filter(|h| **h).count() as f64 / hit.len() as f64;
    let side = |name: &str, cells: &dyn Fn(usize) -> bool| {
        let (seen, all) = (0..48).filter(|c| cells(*c)).fold((0, 0), |(s, n), c| (s + usize::from(hit[c]), n + 1));
        (seen * 2 < all).then(|| name.to_owned())
    };
    let missing: Vec<String> = [
        side("left", &|c| c % 8 == 0),
        side("right", &|c| c % 8 == 7),
        side("upper", &|c| c / 8 == 0),
        side("lower", &|c| c / 8 == 5),
    ]
    .into_iter()
    .flatten()
    .collect();
    let level = if share >= COVERED { Level::Good } else { Level::Care };
    let mut answer = format!("Markers reached {} % of it", fixed(100.0 * share, 0));
    if !missing.is_empty() {
        let edge = if missing.len() == 1 { "edge" } else { "edges" };
        answer += &format!("; the {} {edge} of the image saw few: capture boards there", join(&missing));
    }
    add(level, "Is the image covered?", answer + ".");

    let depths: Vec<f64> = poses.iter().map(|p| p.translation.vector.z).filter(|z| z.is_finite() && *z > 0.0).collect();
    let (near, far) = depths.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), z| (a.min(*z), b.max(*z)));
    if far > 0.0 && fitted.has_depth() {
        let level = if far / near >= DEPTH_RATIO { Level::Good } else { Level::Care };
        let answer = format!("Boards stood between {} and {} mm", number(near), number(far));
        let more = if level == Level::Good { "." } else { ": too little to tell an offset from a scale of the depth." };
        add(level, "Is the range of distances covered?", answer + more);
    }
    let tilt = poses.iter().map(|p| (p.rotation * nalgebra::Vector3::z()).z.abs().min(1.0).acos().to_degrees());
    let steepest = tilt.filter(|t| t.is_finite()).fold(0.0, f64::max);
    let level = if steepest >= TILT { Level::Good } else { Level::Care };
    let answer = format!("Boards were tilted by up to {}°", fixed(steepest, 0));
    let more = if level == Level::Good { "." } else { ": too little to tell the focal length from the distance." };
    add(level, "Were the boards tilted?", answer + more);
}

/// What the frames do not cover and further captures would mend, in sentences.
pub(super) fn coverage_gaps(checks: &[Check]) -> Vec<String> {
    let questions = ["Is the image covered?", "Is the range of distances covered?", "Were the boards tilted?"];
    let gaps = checks.iter().filter(|c| c.level != Level::Good && questions.contains(&c.question));
    gaps.map(|c| c.answer.replace(" of it", " of the image")).collect()
}

/// The overall answer.
pub(super) fn overall(checks: &[Check]) -> (Level, String) {
    let level = checks.iter().map(|c| c.level).max().unwrap_or(Level::Care);
    let n = checks.iter().filter(|c| c.level == level).count();
    let text = match level {
        Level::Good => "May be trusted within the volume that it covers".to_owned(),
        Level::Care => format!("Use with care: {} to consider", count(n, "point")),
        Level::Bad => "Do not use it as it is".to_owned(),
    };
    (level, text)
}
