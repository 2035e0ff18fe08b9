//! Checks whether a calibration may be trusted: the questions that an experienced engineer asks, one answer each.

use super::covariates::Image;
use super::format::join;
use super::format::{count, fixed, number};
use super::headline::{Direction, direction};
use super::input::{ReportCamera, Role};
use super::left_out::sentence;
use super::leftover::Leftover;
use super::pool::Pool;
use depthcal_calibration::judge::intervals::Change;

/// The outcome of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    /// As it should be.
    Good,
    /// Worth a thought before relying on the result.
    Care,
    /// A reason not to use the result.
    Bad,
}

impl Level {
    /// A word for people and for style sheets.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Level::Good => "good",
            Level::Care => "care",
            Level::Bad => "bad",
        }
    }
}

/// One question with its answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Check {
    /// The outcome.
    pub level: Level,
    /// The question.
    pub question: &'static str,
    /// The answer in a sentence.
    pub answer: String,
}

/// Held-out errors above this multiple of the fitted ones count as overfitting.
const OVERFIT: f64 = 1.3;
/// Fewer frames than this make an interval too narrow.
const FEW_FRAMES: usize = 8;
/// Share of the image that markers have to reach.
const COVERED: f64 = 0.7;
/// Ratio of farthest to nearest board below which offset and scale of depth are not separable.
const DEPTH_RATIO: f64 = 1.5;
/// Tilt of the board, degrees, below which focal length and distance are hardly separable.
const TILT: f64 = 20.0;
/// Share of a frame's board pixels above which their being left out is worth a look at the frame.
const MUCH_LEFT_OUT: f64 = 0.05;
/// Most frames that are named.
const MOST_NAMED: usize = 5;
const IMAGE_COVERED: &str = "Is the image covered?";
const RANGE_COVERED: &str = "Is the range of distances covered?";
const BOARDS_TILTED: &str = "Were the boards tilted?";

/// All checks that the camera allows, the worst first. `leftover` is absent where too few frames have depth.
pub(super) fn checks(camera: &ReportCamera<'_>, image: &Image, leftover: Option<&Leftover>) -> Vec<Check> {
    let mut list = Vec::new();
    let mut add = |level, question, answer: String| list.push(Check { level, question, answer });
    let depth = errors(camera, &mut add);
    match leftover {
        Some(l) => {
            let doubt = l.found().next().is_some() || l.could_hide_much();
            let level = if doubt { Level::Care } else { Level::Good };
            add(level, "Is the remaining error noise?", l.sentence());
        }
        None if depth.is_some() => {
            let answer = "Unknown: too few frames with depth to tell a systematic error from chance.".to_owned();
            add(Level::Care, "Is the remaining error noise?", answer);
        }
        None => {}
    }
    coverage(camera, image, &mut add);
    if let Some(c) = camera.calibrated {
        let samples: usize = c.capture.frames.iter().map(|f| f.samples.len()).sum();
        if c.with_depth && samples > 0 {
            let share = c.outliers as f64 / (samples + c.outliers) as f64;
            let level = if share < 0.02 { Level::Good } else { Level::Care };
            let answer = format!("{} of {} depth samples were excluded as outliers.", c.outliers, samples + c.outliers);
            add(level, "Were there many outliers?", answer);
        }
    }
    left_out(&Pool::of(camera, |_| true), &mut add);
    let dropped: usize = super::tables::dropped(camera).len();
    let used = camera.calibrated.map_or(0, |c| c.capture.frames.len()).max(Pool::of(camera, |_| true).frame_count());
    let share = dropped as f64 / (dropped + used).max(1) as f64;
    let level = if share <= 0.2 { Level::Good } else { Level::Care };
    let answer = match dropped {
        0 => "No.".to_owned(),
        n => format!("{} of {}; the reasons are listed below.", n, count(n + used, "frame")),
    };
    add(level, "Were frames excluded?", answer);
    let lost: usize = Pool::of(camera, |_| true).frames.iter().map(|f| f.frame.uncorrectable).sum();
    if lost > 0 {
        let answer = format!("No: the model cannot be inverted at {} of the board.", count(lost, "depth pixel"));
        add(Level::Care, "Can every pixel be corrected?", answer);
    }
    list.sort_by_key(|c| std::cmp::Reverse(c.level));
    list
}

/// Convergence of the fit, and the errors on held-out frames; returns the change of the depth error there.
fn errors(camera: &ReportCamera<'_>, add: &mut impl FnMut(Level, &'static str, String)) -> Option<Change> {
    let (pool, role) = Pool::headline(camera);
    let depth = pool.depth_rms();
    if let Some(c) = camera.calibrated {
        add(
            Level::Good,
            "Did the fit converge?",
            format!("Yes: {} ({}).", c.termination, count(c.iterations, "iteration")),
        );
    }
    let frames = pool.frame_count();
    if frames > 0 {
        let (level, answer) = match (role, frames) {
            (Role::Fitted, _) => (
                Level::Care,
                "No: all errors are those of fitted frames and are too small as an estimate for new ones. Calibrate with \
                 --cross-validate or --hold-out, or evaluate on another capture."
                    .to_owned(),
            ),
            (_, n) if n < FEW_FRAMES => {
                (Level::Care, format!("Yes, but on {} only: the interval is likely too narrow.", count(n, "frame")))
            }
            (_, n) => (Level::Good, format!("Yes, on {}.", count(n, "frame"))),
        };
        add(level, "Was it evaluated on held-out frames?", answer);
    }
    if let Some(change) = &depth {
        let (level, answer) = match direction(change) {
            Direction::Fell => (Level::Good, "Yes: the 95 % interval of the change in error lies below zero."),
            Direction::Same => {
                (Level::Care, "Not significantly: the 95 % interval of the change in error contains zero.")
            }
            Direction::Rose => (Level::Bad, "No: it makes depth worse."),
        };
        add(level, "Does the correction help?", answer.to_owned());
    }
    if let (Some(held_out), Role::HeldOut | Role::Other) = (&depth, role)
        && let Some(fitted_error) = Pool::of(camera, |r| r == Role::Fitted).depth_rms()
    {
        let ratio = held_out.after.value / fitted_error.after.value;
        let overfit = ratio > OVERFIT && held_out.after.low > fitted_error.after.value;
        let level = if overfit { Level::Care } else { Level::Good };
        let numbers = format!(
            "{} mm rms on held-out frames, {} mm on fitted ones",
            number(held_out.after.value),
            number(fitted_error.after.value)
        );
        let answer = if overfit { format!("No: {numbers}.") } else { format!("Yes: {numbers}.") };
        add(level, "Is it as accurate on held-out frames as on fitted ones?", answer);
    }
    depth
}

/// Frames of which a large part of the board was left out, the worst first, and what to look for there.
fn left_out(pool: &Pool<'_>, add: &mut impl FnMut(Level, &'static str, String)) {
    let Some(all) = pool.outliers() else { return };
    // Frames of a cross-validation are those of the fit once more.
    let mut frames: Vec<(&str, f64)> = Vec::new();
    for f in &pool.frames {
        let share = f.frame.outlier_share();
        match frames.iter_mut().find(|(name, _)| *name == f.frame.name) {
            Some((_, most)) => *most = most.max(share),
            None => frames.push((&f.frame.name, share)),
        }
    }
    frames.sort_by(|a, b| b.1.total_cmp(&a.1));
    let large = frames.iter().filter(|f| f.1 > MUCH_LEFT_OUT).count();
    if large == 0 {
        let worst = frames.first().filter(|f| f.1 > 0.0);
        let most = worst.map_or_else(String::new, |w| {
            format!(" At most {} of a frame's ({}).", super::left_out::share(Some(w.1)), w.0)
        });
        add(Level::Good, "Is all that was measured on the board the board?", sentence(&all) + &most);
        return;
    }
    let named =
        frames[..large.min(MOST_NAMED)].iter().map(|f| format!("{} ({})", f.0, super::left_out::share(Some(f.1))));
    let mut named: Vec<String> = named.collect();
    if large > MOST_NAMED {
        named.push(count(large - MOST_NAMED, "more frame"));
    }
    let answer = format!(
        "No: a large share of the board's pixels was left out in {}. Look there for something in front of the board, at the board's \
         edge, and for reflections.",
        join(&named)
    );
    add(Level::Care, "Is all that was measured on the board the board?", answer);
}

fn coverage(camera: &ReportCamera<'_>, image: &Image, add: &mut impl FnMut(Level, &'static str, String)) {
    let fitted = Pool::of(camera, |r| r == Role::Fitted);
    let fitted = if fitted.frames.is_empty() { Pool::of(camera, |_| true) } else { fitted };
    let (mut pixels, mut poses): (Vec<[f64; 2]>, Vec<_>) = fitted
        .frames
        .iter()
        .map(|f| (f.frame.reprojection.iter().map(|e| [e[0], e[1]]).collect::<Vec<_>>(), f.frame.camera_from_board))
        .fold((Vec::new(), Vec::new()), |(mut a, mut b), (p, pose)| {
            a.extend(p);
            b.push(pose);
            (a, b)
        });
    if let Some(c) = camera.calibrated {
        pixels = c.capture.frames.iter().flat_map(|f| f.markers.iter().map(|m| m.pixel)).collect();
        poses = c.capture.poses().collect();
    }
    // A camera without images has no markers.
    let mut covered = ["Markers", "few"];
    if pixels.is_empty() {
        covered = ["Depth of boards", "little"];
        pixels = fitted.pixels().map(|p| p.context.pixel).collect();
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
    let [by, few] = covered;
    let mut answer = format!("{by} reached {} % of the image", fixed(100.0 * share, 0));
    if !missing.is_empty() {
        let edge = if missing.len() == 1 { "edge" } else { "edges" };
        answer += &format!("; {few} at the {} {edge}: capture boards there", join(&missing));
    }
    add(level, IMAGE_COVERED, answer + ".");

    let depths: Vec<f64> = poses.iter().map(|p| p.translation.vector.z).filter(|z| z.is_finite() && *z > 0.0).collect();
    let (near, far) = depths.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), z| (a.min(*z), b.max(*z)));
    if far > 0.0 && fitted.has_depth() {
        let level = if far / near >= DEPTH_RATIO { Level::Good } else { Level::Care };
        let answer = format!("Boards stood between {} and {} mm", number(near), number(far));
        let more = if level == Level::Good {
            "."
        } else {
            ": too small a range to separate an offset of depth from a scale of depth."
        };
        add(level, RANGE_COVERED, answer + more);
    }
    let tilt = poses.iter().map(|p| (p.rotation * nalgebra::Vector3::z()).z.abs().min(1.0).acos().to_degrees());
    let steepest = tilt.filter(|t| t.is_finite()).fold(0.0, f64::max);
    let level = if steepest >= TILT { Level::Good } else { Level::Care };
    let answer = format!("Boards were tilted by up to {}°", fixed(steepest, 0));
    let more = if level == Level::Good { "." } else { ": too little to separate the focal length from the distance." };
    add(level, BOARDS_TILTED, answer + more);
}

/// Gaps in the coverage of image, distances and tilts that further captures would close, in sentences.
pub(super) fn coverage_gaps(checks: &[Check]) -> Vec<String> {
    let coverage = [IMAGE_COVERED, RANGE_COVERED, BOARDS_TILTED];
    let gaps = checks.iter().filter(|c| c.level != Level::Good && coverage.contains(&c.question));
    gaps.map(|c| c.answer.clone()).collect()
}

/// The outcome of all checks together: the worst of them.
pub(super) fn overall(checks: &[Check]) -> (Level, String) {
    let level = checks.iter().map(|c| c.level).max().unwrap_or(Level::Care);
    let n = checks.iter().filter(|c| c.level == level).count();
    let text = match level {
        Level::Good => "May be trusted within the measured volume".to_owned(),
        Level::Care => format!("Use with care: {} to consider", count(n, "point")),
        Level::Bad => "Do not use it as it is".to_owned(),
    };
    (level, text)
}
