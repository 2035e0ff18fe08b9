//! What to capture next: the frames that would tell apart what these captures cannot.

use depthcal_model::{Context, Covariate, Register, Role};
use nalgebra::{DVector, Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::Step;
use super::evidence::{Entry, effect_entry, linearize};
use super::sight::Sights;
use crate::calibrate::Calibrated;
use crate::observe::board_region::BoardRegion;
use crate::observe::{DepthSample, DetectedFrame, MarkerObservation, PosedFrame, RawFrame, SampledFrame};

/// Noncentrality (squared standard deviations) from which two effects count as told apart: found with 80 % at the 1 %
/// level, for one parameter.
const TOLD_APART: f64 = 11.7;
/// Depth samples of a frame that is not there yet, per side of the board.
const SIDE: usize = 20;

/// A frame that could be captured.
struct Proposal {
    words: String,
    frame: SampledFrame,
}

/// For every effect that was added and has rivals: the frame that would tell them apart best, in words.
pub fn capture_next(fit: &Calibrated, register: &Register, steps: &[Step]) -> Vec<String> {
    let mut words = Vec::new();
    for step in steps.iter().filter(|s| !s.indistinguishable.is_empty()) {
        for rival in &step.indistinguishable {
            words.extend(tell_apart(fit, register, step, rival));
        }
    }
    words
}

fn tell_apart(fit: &Calibrated, register: &Register, step: &Step, rival: &str) -> Option<String> {
    let name = step.effects.first()?;
    let fitted = fit.camera.block(name)?;
    let without = Calibrated { camera: fit.camera.filtered(|b| b.name() != name), ..fit.clone() };
    let entries: Vec<Entry> = [(name.as_str(), step.spec.clone()), (rival, rival.to_owned())]
        .into_iter()
        .filter_map(|(n, s)| effect_entry(register, n, s))
        .collect();
    let nominal = entries.first()?.block.theta.clone();
    let effect = DVector::from_iterator(nominal.len(), fitted.theta.iter().zip(&nominal).map(|(a, b)| a - b));
    let present = linearize(&without, &entries).ok()?;
    let now = present.noncentrality(0, &effect, &[1]);
    let proposals = proposals(fit);
    let imagined =
        Calibrated { capture: fit.capture.with_frames(proposals.iter().map(|p| p.frame.clone()).collect()), ..without };
    let further = linearize(&imagined, &entries).ok()?;
    let (best, then) = (0..proposals.len())
        .map(|i| (i, present.with_cluster(&further, i).noncentrality(0, &effect, &[1])))
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    let frames = ((TOLD_APART - now) / (then - now).max(1e-9)).ceil().max(1.0);
    let how_many = if frames > 100.0 {
        "even many frames like it would hardly do".to_owned()
    } else {
        format!("about {frames:.0} of them would do")
    };
    Some(format!(
        "to tell {name} from {rival}: {}; {how_many} (squared distance in standard deviations {now:.1} now, {then:.1} with one, {TOLD_APART} is enough)",
        proposals[best].words
    ))
}

/// Frames over distances, tilts, places in the image and temperatures, as far as they can be had.
fn proposals(fit: &Calibrated) -> Vec<Proposal> {
    let sights = Sights::of(fit);
    let Some(depth) = sights.range(|s, _| 1.0 / s[2]) else { return Vec::new() };
    let temperature = sights.range(|_, c| c.temperature_c);
    let amplitude = sights.range(|_, c| c.amplitude).map_or(f64::NAN, |r| r.middle);
    let time = sights.range(|_, c| c.time_s).map_or(0.0, |r| r.middle);
    let (w, h) = (fit.camera.width as f64, fit.camera.height as f64);
    let places = [
        ("in the middle", 0.5, 0.5),
        ("at the left edge", 0.2, 0.5),
        ("at the right edge", 0.8, 0.5),
        ("at the top", 0.5, 0.25),
        ("in the upper left corner", 0.2, 0.2),
        ("in the lower right corner", 0.8, 0.8),
    ];
    let tilts = [
        ("parallel to the image", 0.0, 0.0),
        ("turned by 45° about the vertical", 0.0, 45.0),
        ("turned by 45° about the horizontal", 45.0, 0.0),
    ];
    let mut list = Vec::new();
    for distance_mm in [depth.low, depth.middle, depth.high, 1.3 * depth.high] {
        for (place, u, v) in places {
            for (tilt, about_x, about_y) in tilts {
                let mut conditions = vec![(String::new(), temperature.map_or(f64::NAN, |t| t.middle))];
                if let Some(t) = temperature {
                    conditions.push((", 10 °C warmer than the warmest".to_owned(), t.high + 10.0));
                }
                for (warmth, temperature_c) in conditions {
                    let context = Context { amplitude, time_s: time, temperature_c, ..Context::default() };
                    let pose = pose(fit, distance_mm, [u * w, v * h], [about_x, about_y]);
                    if let Some(frame) = pose.and_then(|p| imagine(fit, &p, &context)) {
                        let words = format!("a frame {:.1} m away, {place}, {tilt}{warmth}", distance_mm / 1000.0);
                        list.push(Proposal { words, frame });
                    }
                }
            }
        }
    }
    list
}

/// The pose that shows the board's middle at a pixel and a depth, turned by angles (degrees) about x and y.
fn pose(fit: &Calibrated, depth_mm: f64, pixel: [f64; 2], turn_deg: [f64; 2]) -> Option<Isometry3<f64>> {
    let ray = fit.camera.ray(pixel, 1.0 / depth_mm).ok()?;
    let points = fit.capture.target.points();
    let n = points.len() as f64;
    let middle = points.iter().fold(Vector3::zeros(), |c, p| c + Vector3::new(p[0], p[1], 0.0) / n);
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), turn_deg[0].to_radians())
        * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), turn_deg[1].to_radians());
    let at = Vector3::new(ray[0], ray[1], 1.0) * depth_mm;
    Some(Isometry3::from_parts(Translation3::from(at - rotation * middle), rotation))
}

/// Markers and depth samples that the fitted camera would see in a pose; `None` where the board leaves the image.
fn imagine(fit: &Calibrated, pose: &Isometry3<f64>, context: &Context) -> Option<SampledFrame> {
    let (w, h) = (fit.camera.width as f64, fit.camera.height as f64);
    let inside = |p: &[f64; 2]| p[0] > 0.0 && p[1] > 0.0 && p[0] < w - 1.0 && p[1] < h - 1.0;
    let see = |p: [f64; 2]| fit.camera.project(&(pose * Point3::from(fit.camera.board_point(p))).coords).filter(inside);
    let target = &fit.capture.target;
    let mut markers = Vec::new();
    for (index, point) in target.points().into_iter().enumerate() {
        markers.push(MarkerObservation { index, pixel: see(point)?, std_px: 1.0 });
    }
    let hull = BoardRegion::new(target).hull().to_vec();
    let span = |i: usize| hull.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, u), p| (l.min(p[i]), u.max(p[i])));
    let (x, y) = (span(0), span(1));
    let at = |range: (f64, f64), i: usize| range.0 + (range.1 - range.0) * (i as f64 + 0.5) / SIDE as f64;
    let mut samples = Vec::new();
    for i in 0..SIDE {
        for k in 0..SIDE {
            let board_seed = [at(x, i), at(y, k)];
            let Some(pixel) = see(board_seed) else { continue };
            let depth_mm = (pose * Point3::new(board_seed[0], board_seed[1], 0.0)).z;
            samples.push(DepthSample { context: Context { pixel, ..*context }, depth_mm, board_seed });
        }
    }
    let raw = RawFrame { name: "imagined".to_owned(), ..RawFrame::default() };
    let detected = DetectedFrame { raw, markers };
    Some(SampledFrame { posed: PosedFrame { detected, camera_from_board: *pose }, samples })
}

/// Effects of which these captures can say nothing at all, why, and what to record, in words.
pub fn invisible(register: &Register, fit: &Calibrated) -> Vec<String> {
    let sights = Sights::of(fit);
    let is_unseen = |c: &Covariate| {
        c.is_recorded()
            && sights.range(|state, context| c.value(state, context)).is_none_or(|r| r.span() < least_span(*c))
    };
    let lacking =
        register.names().filter(|name| fit.camera.block(name).is_none()).filter_map(|name| register.find(name));
    let lacking: Vec<_> = lacking.filter(|piece| piece.role() == Role::Effect).collect();
    let words = |covariate: &Covariate| {
        // An effect is named with the first covariate that it lacks.
        let names = lacking.iter().filter(|p| p.needs().iter().find(|c| is_unseen(c)) == Some(covariate));
        let names: Vec<&str> = names.map(|piece| piece.name()).collect();
        let (missing, how) = (covariate.missing(), covariate.how_to_record());
        (!names.is_empty()).then(|| format!("{}: {missing}; {how}", names.join(", ")))
    };
    Covariate::ALL.iter().filter(|c| is_unseen(c)).filter_map(words).collect()
}

/// Smallest range of a covariate over the depth samples in which an effect of it can show.
fn least_span(covariate: Covariate) -> f64 {
    match covariate {
        Covariate::Temperature => 0.5,
        Covariate::Time => f64::MIN_POSITIVE,
        _ => 0.0,
    }
}
