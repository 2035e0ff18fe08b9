//! The declared model beside the last one: frame by frame, and against what errors may depend on.

use std::collections::HashMap;

use serde_json::{Value, json};

use super::curves::bins;
use super::{AFTER, BEFORE, Figure, NEUTRAL, OTHER, plain, short};
use crate::calibrate::Calibrated;
use crate::evaluate::PixelError;
use crate::report::ReportInput;
use crate::report::binned::{Axis, Binned, Cell};
use crate::report::covariates::{BINS, Covariate};
use crate::report::diagnosis::{ReportDiagnosis, last};
use crate::report::html::{count, escape, number};
use crate::report::leftover::noise_mm;
use crate::report::pool::usable;

/// Pixels that the fitted effects are evaluated at, at most.
const PIXELS: usize = 24_000;
/// Fewest of them in a bin.
const FEWEST: usize = 8;

/// What the added effects, with everything fitted anew beside them, take off the depth error of single pixels, mm: the error
/// under the declared model less that under the last one, both fitted to all frames. The board's depth is part of it: a
/// focal length that changes with the model moves the board as well.
pub(in crate::report) struct Taken<'a>(Vec<(&'a PixelError, f64)>);

impl<'a> Taken<'a> {
    /// Over the frames that the headline speaks of; `None` where nothing was added.
    pub(in crate::report) fn of(input: &ReportInput<'a>, d: &ReportDiagnosis<'a>) -> Option<Self> {
        let now = input.calibrated.filter(|_| !d.account.steps.is_empty())?;
        let pool = last(input);
        let step = pool.pixels().count().div_ceil(PIXELS).max(1);
        let key = |p: &PixelError| p.context.pixel.map(f64::to_bits);
        let mut list = Vec::new();
        for f in &pool.frames {
            let Some(declared) = d.before.frames.iter().find(|b| b.name == f.frame.name) else { continue };
            let boards: HashMap<[u64; 2], f64> = declared.pixels.iter().map(|p| (key(p), p.board_depth_mm)).collect();
            // A stride that shares factors with the rows would see some columns only.
            let chosen = f.frame.pixels.iter().enumerate().filter(|(i, _)| i.wrapping_mul(2_654_435_761) % step == 0);
            for (_, p) in chosen.filter(|(_, p)| usable(p)) {
                let Some(board) = boards.get(&key(p)) else { continue };
                let rho = 1.0 / (p.board_depth_mm + p.before_mm);
                let depth = |c: &Calibrated| Some(1.0 / c.camera.correct(&p.context, p.cos_incidence, rho).ok()?.1);
                let taken = depth(d.first).zip(depth(now)).map(|(a, b)| (a - board) - (b - p.board_depth_mm));
                list.extend(taken.filter(|t| t.is_finite()).map(|t| (p, t)));
            }
        }
        (!list.is_empty()).then_some(Self(list))
    }

    /// Mean in every bin of a covariate.
    fn line(&self, axis: &Axis, covariate: &Covariate) -> Value {
        let mut sums = vec![(0.0, 0_usize); axis.bins];
        for (p, mm) in &self.0 {
            if let Some(b) = axis.bin((covariate.value)(p)) {
                sums[b] = (sums[b].0 + mm, sums[b].1 + 1);
            }
        }
        let used: Vec<usize> = (0..axis.bins).filter(|b| sums[*b].1 >= FEWEST).collect();
        json!({
            "type": "scatter", "mode": "lines", "name": "what was added takes off", "line": {"color": OTHER, "width": 3, "dash": "dot"},
            "x": used.iter().map(|b| short(axis.middle(*b))).collect::<Value>(),
            "y": used.iter().map(|b| short(sums[*b].0 / sums[*b].1 as f64)).collect::<Value>(),
            "hovertemplate": "%{x:.4~g}: %{y:+.3~g} mm<extra>%{fullData.name}</extra>",
        })
    }
}

/// Errors of both models against a covariate, with what was added drawn through; `None` where it does not vary.
pub(in crate::report) fn model_curve(
    input: &ReportInput<'_>,
    d: &ReportDiagnosis<'_>,
    taken: Option<&Taken<'_>>,
    covariate: &Covariate,
) -> Option<Figure> {
    let (declared, now) = (d.declared(), last(input));
    let axis = Axis::over(now.pixels().map(&covariate.value), BINS)?;
    let cells = |pool: &crate::report::pool::Pool<'_>| {
        Binned::new(pool, BINS, |p| axis.bin((covariate.value)(p)), |p| p.after_mm, noise_mm(input)).cells()
    };
    let (before, after) = (cells(&declared), cells(&now));
    let mut data = vec![
        bins(&before, &axis, -0.08, "declared model", BEFORE, "circle-open"),
        bins(&after, &axis, 0.08, "last model", AFTER, "circle"),
    ];
    data.extend(taken.map(|t| t.line(&axis, covariate)));
    let rms = |cells: &[Cell]| {
        let used: Vec<f64> = cells.iter().map(|c| c.value).filter(|v| v.is_finite()).collect();
        (used.iter().map(|v| v * v).sum::<f64>() / used.len().max(1) as f64).sqrt()
    };
    let told = format!(
        "Bins: {} mm rms under the declared model, {} mm under the last one",
        number(rms(&before)),
        number(rms(&after))
    );
    let layout = json!({
        "xaxis": {"title": {"text": format!("{} / {}", covariate.name, covariate.unit)}},
        "yaxis": {"title": {"text": "what is left / mm"}, "zeroline": true},
    });
    Some(
        Figure::new(format!("against-{}", covariate.id), format!("Against the {}", covariate.name), data, layout)
            .caption(format!("{} {told}.", escape(covariate.hint)))
            .alt(format!("What both models leave against the {}. {told}.", covariate.name))
            .aspect(1.45),
    )
}

/// Depth error of every frame under both models, and the plane that the frame has for itself.
pub(in crate::report) fn frames_by_model(input: &ReportInput<'_>, d: &ReportDiagnosis<'_>) -> Option<Figure> {
    let rms = |f: &crate::evaluate::EvaluatedFrame| {
        let (sum, n) =
            f.pixels.iter().filter(|p| usable(p)).fold((0.0, 0_usize), |(s, n), p| (s + p.after_mm.powi(2), n + 1));
        (n > 0).then(|| (sum / n as f64).sqrt())
    };
    let of = |frames: &[crate::evaluate::EvaluatedFrame]| -> Vec<(String, f64)> {
        frames.iter().filter_map(|f| Some((plain(&f.name), rms(f)?))).collect()
    };
    let before = of(&d.before.frames);
    let now: Vec<(String, f64)> =
        last(input).frames.iter().filter_map(|f| Some((plain(&f.frame.name), rms(f.frame)?))).collect();
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
    let planes: Vec<(String, f64)> = d.account.frame_planes.iter().map(|p| (plain(&p.name), p.rms_mm)).collect();
    let mut data = Vec::new();
    if !planes.is_empty() {
        data.push(json!({
            "type": "bar", "name": "plane of the frame's own, beside the last model", "marker": {"color": NEUTRAL, "opacity": 0.45},
            "x": planes.iter().map(|f| f.0.clone()).collect::<Value>(), "y": planes.iter().map(|f| short(f.1)).collect::<Value>(),
            "hovertemplate": "%{x}: %{y:.3~g} mm<extra>%{fullData.name}</extra>",
        }));
    }
    data.push(side(&before, "declared model", BEFORE, "circle-open"));
    data.push(side(&now, "last model", AFTER, "circle"));
    let better = now.iter().filter(|f| before.iter().any(|b| b.0 == f.0 && f.1 < b.1)).count();
    let worst = now.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    let worst = worst.map_or(String::new(), |w| format!(" Worst now: {} with {} mm.", w.0, number(w.1)));
    let layout = json!({
        "xaxis": {"type": "category", "title": {"text": "frame"}, "nticks": 20},
        "yaxis": {"title": {"text": "depth error, rms / mm"}, "rangemode": "tozero"},
    });
    Some(
        Figure::new("frames-by-model", "Every frame, by a fit that did not see it", data, layout)
            .caption(format!(
                "{better} of {} are better than under the declared model.{worst} Grey: how far the frame's depth as a whole \
                 deviates from the pose that its image shows; high bars in many frames are something that changes from frame \
                 to frame.",
                count(now.len(), "frame")
            ))
            .alt(format!("Depth error of {} under the declared and the last model.", count(now.len(), "frame")))
            .aspect(2.6),
    )
}
