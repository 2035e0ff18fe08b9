//! Errors under the declared and under the last model: frame by frame, and against what they may depend on.

use std::collections::HashMap;

use serde_json::{Value, json};

use super::curves::bins;
use super::figure::Figure;
use super::plotly::{AFTER, BEFORE, NEUTRAL, OTHER, plain, short};
use crate::binned::{Axis, Binned, Cell};
use crate::covariates::{BINS, Covariate};
use crate::format::{count, number};
use crate::html::escape;
use crate::input::ReportCamera;
use crate::input::ReportDiagnosis;
use crate::leftover::noise_mm;
use crate::pool::Pool;
use crate::statistics::rms;
use depthcal_calibration::judge::camera::EvaluatedFrame;
use depthcal_calibration::judge::depth_errors::PixelError;
use depthcal_statistics::median;

/// Most pixels of the line of the added effects.
const PIXELS: usize = 60_000;
/// Fewest pixels of a frame in a bin.
const FEWEST: usize = 5;

/// Change of the depth error of single pixels from the declared to the last model, mm, frame by frame: the error under the
/// declared model minus that under the last one. The measured depth cancels, so that the difference has no noise.
pub(crate) struct Taken<'a>(Vec<Vec<(&'a PixelError, f64)>>);

impl<'a> Taken<'a> {
    /// Over the frames that the headline speaks of, each by a fit without them; `None` where nothing was added.
    pub(crate) fn of(camera: &ReportCamera<'a>, d: &ReportDiagnosis<'a>) -> Option<Self> {
        if d.record.steps.is_empty() {
            return None;
        }
        let pool = Pool::last(camera);
        let step = pool.pixels().count().div_ceil(PIXELS).max(1);
        let key = |p: &PixelError| p.context.pixel.map(f64::to_bits);
        let taken = pool.frames.iter().map(|f| {
            let declared = d.before.frames.iter().find(|b| b.name == f.frame.name);
            let errors: HashMap<[u64; 2], f64> =
                declared.iter().flat_map(|f| f.pixels.iter()).map(|p| (key(p), p.after_mm)).collect();
            // A stride that shares factors with the rows would see some columns only.
            let chosen = f.frame.pixels.iter().enumerate().filter(|(i, _)| i.wrapping_mul(2_654_435_761) % step == 0);
            let difference = |p: &'a PixelError| Some((p, errors.get(&key(p))? - p.after_mm));
            chosen.filter_map(|(_, p)| difference(p)).filter(|(p, t)| p.is_usable() && t.is_finite()).collect()
        });
        Some(Self(taken.collect()))
    }

    /// In every bin of a covariate the mean over the frames of each frame's median, as errors are binned.
    fn line(&self, axis: &Axis, covariate: &Covariate) -> Value {
        let mut medians = vec![Vec::new(); axis.bins];
        for frame in &self.0 {
            let mut lists = vec![Vec::new(); axis.bins];
            for (p, mm) in frame {
                if let Some(bin) = axis.bin((covariate.value)(p)) {
                    lists[bin].push(*mm);
                }
            }
            let known = lists.iter_mut().enumerate().filter(|(_, list)| list.len() >= FEWEST);
            known.for_each(|(bin, list)| medians[bin].push(median(list)));
        }
        let mean = |list: &[f64]| list.iter().sum::<f64>() / list.len() as f64;
        let used: Vec<usize> = (0..axis.bins).filter(|b| !medians[*b].is_empty()).collect();
        json!({
            "type": "scatter", "mode": "lines", "name": "change by the added effects",
            "line": {"color": OTHER, "width": 3, "dash": "dot"},
            "x": used.iter().map(|b| short(axis.middle(*b))).collect::<Value>(),
            "y": used.iter().map(|b| short(mean(&medians[*b]))).collect::<Value>(),
            "hovertemplate": "%{x:.4~g}: %{y:+.3~g} mm<extra>%{fullData.name}</extra>",
        })
    }
}

/// Errors under both models against a covariate, with the change by the added effects; `None` where the covariate does not
/// vary.
pub(crate) fn model_curve(
    camera: &ReportCamera<'_>,
    d: &ReportDiagnosis<'_>,
    taken: Option<&Taken<'_>>,
    covariate: &Covariate,
) -> Option<Figure> {
    let (declared, now) = (Pool::declared(d), Pool::last(camera));
    let axis = Axis::over(now.pixels().map(&covariate.value), BINS)?;
    let cells = |pool: &Pool<'_>| {
        Binned::new(pool, BINS, |p| axis.bin((covariate.value)(p)), |p| p.after_mm, noise_mm(camera)).cells()
    };
    let (before, after) = (cells(&declared), cells(&now));
    let mut data = vec![
        bins(&before, &axis, -0.08, "declared model", BEFORE, "circle-open"),
        bins(&after, &axis, 0.08, "last model", AFTER, "circle"),
    ];
    data.extend(taken.map(|t| t.line(&axis, covariate)));
    let rms = |cells: &[Cell]| rms(cells.iter().map(|c| c.value));
    let told = format!(
        "Rms over the bins: {} mm under the declared model, {} mm under the last one",
        number(rms(&before)),
        number(rms(&after))
    );
    let layout = json!({
        "xaxis": {"title": {"text": format!("{} / {}", covariate.name, covariate.unit)}},
        "yaxis": {"title": {"text": "depth error / mm"}, "zeroline": true},
    });
    Some(
        Figure::new(format!("against-{}", covariate.id), format!("Against the {}", covariate.name), data, layout)
            .caption(format!("{} {told}.", escape(covariate.hint)))
            .alt(format!("Depth error under both models against the {}. {told}.", covariate.name))
            .aspect(1.45),
    )
}

/// Depth error of every frame under both models, and the size of the frame's own plane.
pub(crate) fn frames_by_model(camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>) -> Option<Figure> {
    let rms = |f: &EvaluatedFrame| f.depth.rms_mm().map(|rms| rms.after);
    let errors = |frames: &[EvaluatedFrame]| -> Vec<(String, f64)> {
        frames.iter().filter_map(|f| Some((plain(&f.name), rms(f)?))).collect()
    };
    let before = errors(&d.before.frames);
    let now: Vec<(String, f64)> =
        Pool::last(camera).frames.iter().filter_map(|f| Some((plain(&f.frame.name), rms(f.frame)?))).collect();
    if now.is_empty() {
        return None;
    }
    let side = |list: &[(String, f64)], name: &str, colour: &str, symbol: &str| {
        json!({
            "type": "scatter", "mode": "markers", "name": name,
            "x": list.iter().map(|f| f.0.clone()).collect::<Value>(), "y": list.iter().map(|f| short(f.1)).collect::<Value>(),
            "marker": {"color": colour, "size": 8, "symbol": symbol, "line": {"width": 2, "color": colour}},
            "hovertemplate": "%{x}: %{y:.3~g} mm<extra>%{fullData.name}</extra>",
        })
    };
    let planes: Vec<(String, f64)> = d.record.frame_planes.iter().map(|p| (plain(&p.name), p.rms_mm)).collect();
    let mut data = Vec::new();
    if !planes.is_empty() {
        data.push(json!({
            "type": "bar", "name": "the frame's own plane, given the last model", "marker": {"color": NEUTRAL, "opacity": 0.45},
            "x": planes.iter().map(|f| f.0.clone()).collect::<Value>(), "y": planes.iter().map(|f| short(f.1)).collect::<Value>(),
            "hovertemplate": "%{x}: %{y:.3~g} mm<extra>%{fullData.name}</extra>",
        }));
    }
    data.push(side(&before, "declared model", BEFORE, "circle-open"));
    data.push(side(&now, "last model", AFTER, "circle"));
    let better = now.iter().filter(|f| before.iter().any(|b| b.0 == f.0 && f.1 < b.1)).count();
    let worst = now.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    let worst =
        worst.map_or(String::new(), |w| format!(" Largest under the last model: {} with {} mm.", w.0, number(w.1)));
    let layout = json!({
        "xaxis": {"type": "category", "title": {"text": "frame"}, "nticks": 20},
        "yaxis": {"title": {"text": "depth error, rms / mm"}, "rangemode": "tozero"},
    });
    Some(
        Figure::new("frames-by-model", "Held-out error of every frame", data, layout)
            .caption(format!(
                "{better} of {} have a smaller error than under the declared model.{worst} Grey: the part of the error that is \
                 a plane of the frame's own, that is, an error of its pose or of its depth as a whole. High bars in many \
                 frames mean that something changes from frame to frame.",
                count(now.len(), "frame")
            ))
            .alt(format!("Depth error of {} under the declared and the last model.", count(now.len(), "frame")))
            .aspect(2.6),
    )
}
