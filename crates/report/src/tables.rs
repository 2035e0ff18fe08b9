//! Tables: errors, parameters, noise, dropped frames.

use std::fmt::Write;

use super::format::{count, fixed, interval, measured, number, shown_unit, significant};
use super::headline::{Direction, direction, is_determined};
use super::html::{escape, tie};
use super::input::{ReportCamera, ReportDataset, Role};
use super::left_out;
use super::parameters::model_words;
use super::pool::Pool;
use super::uncertainty::{distances, typical};
use depthcal_calibration::calibrate::CalibratedCamera;
use depthcal_calibration::judge::intervals::Change;
use depthcal_model::hook::HookKind;
use depthcal_statistics::{Estimate, quantile};

fn cell(e: &Estimate) -> String {
    let interval = match (e.has_interval(), is_determined(e)) {
        (false, _) => String::new(),
        (true, true) => format!(" <span class=\"interval\">{}</span>", interval(e.low, e.high, "")),
        (true, false) => " <span class=\"interval words\">not determined by these frames</span>".to_owned(),
    };
    format!("<td><b>{}</b>{interval}</td>", number(e.value))
}

fn row(name: &str, hint: &str, unit: &str, change: Option<Change>) -> String {
    let Some(c) = change else { return String::new() };
    let percent = 100.0 * (c.after.value / c.before.value - 1.0);
    let (class, text) = match direction(&c) {
        Direction::Fell => ("good", format!("{} %", fixed(percent, 0))),
        Direction::Rose => ("bad", format!("+{} %", fixed(percent, 0))),
        Direction::Same if c.after.has_interval() => ("same", "not significant".to_owned()),
        Direction::Same => ("same", "too few frames".to_owned()),
    };
    format!(
        "<tr><th scope=\"row\">{name} <span class=\"unit\">{unit}</span><span class=\"hint\">{hint}</span></th>{}{}\
         <td class=\"change {class}\">{text}</td></tr>\n",
        cell(&c.before),
        cell(&c.after)
    )
}

/// Errors of the headline's frames, before and after correction.
pub(super) fn headline(camera: &ReportCamera<'_>) -> String {
    let (pool, role) = Pool::headline(camera);
    if pool.frames.is_empty() {
        return String::new();
    }
    let mut rows = String::new();
    rows += &row("Depth error, rms", "over all board pixels", "mm", pool.depth_rms());
    rows += &row("Plane error, mean", "absolute height of depth pixels above the board", "mm", pool.plane_error());
    rows += &row("Dot error, mean", "distance of markers from their places in space", "mm", pool.dot_error());
    if let Some((e, _)) = pool.reprojection() {
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\">Reprojection error, rms <span class=\"unit\">px</span><span class=\"hint\">markers in the \
             image</span></th><td>–</td>{}<td class=\"change same\">image only</td></tr>",
            cell(&e)
        );
    }
    let whose = match role {
        Role::HeldOut => "held-out frames",
        Role::Other => "captures that are not part of the fit",
        Role::Fitted => "the frames that the camera was fitted to",
    };
    let left_out = pool.outliers().map_or_else(String::new, |o| {
        format!("<p class=\"note left-out\">{}</p>\n", tie(&escape(&left_out::sentence(&o))))
    }) + &match pool.wrong_markers() {
        0 => String::new(),
        wrong => format!("<p class=\"note wrong-markers\">{}</p>\n", tie(&left_out::markers(wrong))),
    };
    format!(
        "<table class=\"numbers\"><caption>On {} ({whose}); in small type: 95 % interval. As measured: \
         depth of the camera, relative to the board's pose</caption><thead><tr><td></td>\
         <th scope=\"col\">as measured</th><th scope=\"col\">corrected</th><th scope=\"col\">change</th></tr></thead>\n\
         <tbody>{rows}</tbody></table>\n{left_out}",
        count(pool.frame_count(), "frame")
    )
}

/// Errors of every dataset, in the columns of Sjöholm 2017.
pub(super) fn datasets(camera: &ReportCamera<'_>) -> String {
    let mut rows = String::new();
    for d in &camera.evaluations {
        let r = d.evaluated.record();
        for after in [false, true] {
            let pick = |b: Option<depthcal_io::BeforeAfter<depthcal_io::MeanStd>>| {
                b.map_or("<td>–</td><td>–</td>".to_owned(), |b| {
                    let m = if after { b.after } else { b.before };
                    format!("<td>{}</td><td>{}</td>", number(m.mean), number(m.std))
                })
            };
            let rms = r.depth_rms_mm.map_or(f64::NAN, |b| if after { b.after } else { b.before });
            let head = if after {
                String::new()
            } else {
                format!(
                    "<th scope=\"rowgroup\" rowspan=\"2\">{}<span class=\"hint\">{}</span></th><td \
                     rowspan=\"2\">{}</td>\
                     <td rowspan=\"2\">{}</td>",
                    escape(&r.name),
                    d.role.name(),
                    r.frames,
                    number(r.reprojection_px.map_or(f64::NAN, |error| error.rms))
                )
            };
            let left_out = if after {
                String::new()
            } else {
                format!("<td rowspan=\"2\">{}</td>", left_out::share(r.outliers.map(|o| o.share)))
            };
            let _ = writeln!(
                rows,
                "<tr>{head}<td class=\"text\">{}</td>{}{}<td>{}</td>{left_out}</tr>",
                if after { "corrected" } else { "as measured" },
                pick(r.dot_error_mm),
                pick(r.plane_error_mm),
                number(rms)
            );
        }
    }
    format!(
        "<div class=\"scroll\" tabindex=\"0\"><table><caption>Errors of every dataset, mm (reprojection: px), of depth as \
         measured and corrected, relative to the board's pose</caption>\
         <thead><tr><th scope=\"col\">dataset</th>\
         <th scope=\"col\">frames</th><th scope=\"col\">reprojection error, rms</th><th scope=\"col\" class=\"text\">depth</th>\
         <th scope=\"col\">dot error, mean</th><th scope=\"col\">std. dev.</th><th scope=\"col\">plane error, mean</th>\
         <th scope=\"col\">std. dev.</th><th scope=\"col\">depth error, rms</th><th scope=\"col\">left out</th></tr></thead><tbody>{rows}</tbody></table></div>\n"
    )
}

/// Errors of every frame of a dataset with depth; nothing without depth.
pub(super) fn frames(d: &ReportDataset<'_>) -> String {
    let mut rows = String::new();
    for frame in &d.evaluated.frames {
        let Some(rms) = frame.depth.rms_mm() else { continue };
        let plane = frame.depth.plane_error_mm().unwrap_or_default();
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&frame.name),
            frame.depth.pixels,
            number(rms.before),
            number(rms.after),
            left_out::share(frame.outlier_limit_mm.map(|_| frame.outlier_share())),
            number(plane.before.mean),
            number(plane.after.mean)
        );
    }
    if rows.is_empty() {
        return rows;
    }
    format!(
        "<details><summary>{} ({}): all frames</summary><div class=\"scroll\" tabindex=\"0\"><table><caption>Errors of every \
         frame, mm. Left out: share of the board's pixels that are no measurements of the board.</caption><thead><tr><th \
         scope=\"col\">frame</th><th scope=\"col\">depth pixels</th><th scope=\"col\">depth error, rms: as measured</th><th \
         scope=\"col\">corrected</th><th scope=\"col\">left out</th><th scope=\"col\">plane error, mean: as measured</th><th \
         scope=\"col\">corrected</th></tr></thead><tbody>{rows}</tbody></table></div></details>\n",
        escape(&d.evaluated.name),
        d.role.name()
    )
}

/// Parameters with standard deviations, units, effect on depth, and meaning.
pub(super) fn parameters(c: &CalibratedCamera) -> String {
    let stds = c.std_devs();
    let theta = c.camera.theta();
    let mut rows = String::new();
    for (block, range) in c.camera.blocks_with_ranges() {
        let source = block.piece().map_or("", |p| p.source());
        let constants = block.constants_in_words();
        let constants =
            if constants.is_empty() { String::new() } else { format!(" · {}", escape(&constants.join(", "))) };
        let _ = writeln!(
            rows,
            "<tr class=\"piece\"><th colspan=\"5\" scope=\"rowgroup\">{} <span \
             class=\"hint\">{}{constants}</span></th></tr>",
            escape(&block.title()),
            escape(source)
        );
        let parameters = block.parameters().iter().zip(&block.theta).zip(&block.free).zip(range);
        for (((parameter, value), free), index) in parameters {
            let std = stds[index];
            let held = if *free { "" } else { " <span class=\"hint\">fixed</span>" };
            let unit = shown_unit(parameter.unit);
            let effect = (block.hook() == HookKind::Depth && *free)
                .then(|| shift(c, &theta, index, parameter.nominal))
                .flatten()
                .map_or("–".to_owned(), |mm| format!("{} mm", number(mm)));
            let _ = writeln!(
                rows,
                "<tr><th scope=\"row\"><code>{}</code></th><td>{}{held}</td><td class=\"text\">{}</td><td>{effect}</td>\
                 <td class=\"text\">{}</td></tr>",
                escape(&parameter.name),
                measured(*value, std),
                escape(unit),
                if parameter.meaning.is_empty() { "–".to_owned() } else { escape(parameter.meaning) }
            );
        }
    }
    let z = number(quantile(distances(c), 0.5));
    format!(
        "<div class=\"scroll\" tabindex=\"0\"><table class=\"parameters\"><caption>Values ± one standard deviation. \
         Effect on depth: \
         largest change of corrected depth over the image, at {z} mm, if the parameter is set to its neutral value.</caption><thead><tr>\
         <th scope=\"col\">name</th><th scope=\"col\">value</th><th scope=\"col\">unit</th>\
         <th scope=\"col\">effect on depth</th><th \
         scope=\"col\">meaning</th></tr></thead><tbody>{rows}</tbody></table></div>\n"
    )
}

/// The largest change of corrected depth over the image, mm, between a parameter's fitted and its nominal value, at the
/// median of the fitted distances. `None` where depth cannot be corrected.
fn shift(c: &CalibratedCamera, theta: &[f64], index: usize, nominal: f64) -> Option<f64> {
    let z = quantile(distances(c), 0.5);
    let mut without = theta.to_vec();
    *without.get_mut(index)? = nominal;
    let without = c.camera.with_theta(&without);
    let (w, h) = (c.camera.width as f64 - 1.0, c.camera.height as f64 - 1.0);
    let base = typical(c, [0.0; 2]);
    let mut largest: Option<f64> = None;
    for i in 0..25 {
        let pixel = [w * f64::from(i % 5) / 4.0, h * f64::from(i / 5) / 4.0];
        let context = depthcal_model::Context { pixel, ..base };
        let depth = |camera: &depthcal_model::Camera| camera.correct(&context, 1.0, 1.0 / z).ok().map(|r| 1.0 / r.1);
        if let (Some(a), Some(b)) = (depth(&c.camera), depth(&without)) {
            let d = (a - b).abs();
            if d.is_finite() {
                largest = Some(largest.map_or(d, |l| l.max(d)));
            }
        }
    }
    largest
}

/// Data, residuals, noise and termination of the fit.
pub(super) fn fit(c: &CalibratedCamera) -> String {
    let markers = {
        let used: usize = c.capture.frames.iter().map(|f| f.markers.len()).sum();
        match c.capture.frames.iter().map(|f| f.wrong_markers.len()).sum() {
            0 => used.to_string(),
            wrong => format!("{used}; {wrong} left out, over a pixel from the fit"),
        }
    };
    let mut items: Vec<(String, String)> = vec![
        ("Model".into(), escape(&model_words(c))),
        ("Estimator".into(), c.estimator.name().to_owned()),
        ("Frames".into(), c.capture.frames.len().to_string()),
        ("Markers".into(), markers),
        ("Reprojection error".into(), format!("{} px rms", number(c.reprojection_rms_px))),
        ("Marker noise".into(), format!("{} px per coordinate (standard deviation)", number(c.noise.pixel_sigma))),
    ];
    if let Some(choice) = &c.lens_choice {
        items.push(("Terms of the lens".into(), escape(&choice.to_string())));
    }
    if let Some(comparison) = &c.lens_comparison {
        let error = |lens: &depthcal_io::ComparedLens| match lens.held_out_px {
            Some(px) => format!("{} {} px", lens.lens, significant(px, 3)),
            None => format!("{} not fitted", lens.lens),
        };
        let errors: Vec<String> = comparison.lenses.iter().map(error).collect();
        let words = format!(
            "{} is the simplest within one standard error of the best; left-out frames: {}",
            comparison.chosen,
            errors.join(", ")
        );
        items.push(("Lens".into(), escape(&words)));
    }
    if c.with_depth {
        let samples: usize = c.capture.frames.iter().map(|f| f.samples.len()).sum();
        let apart = c.correlation_length_px.map_or(String::new(), |n| format!(", at least {n} px apart"));
        items.push(("Depth samples".into(), format!("{samples}{apart}, {} outliers excluded", c.outliers)));
        if let Some(rms) = c.depth_rms_mm {
            items.push(("Depth error at the samples".into(), format!("{} mm rms", number(rms))));
        }
        let d = c.noise.depth;
        items.push((
            "Noise of inverse depth".into(),
            format!("σ² = ({} / mm)² + ({} mm · ρ²)²", significant(d.a_per_mm, 3), significant(d.b_mm, 3)),
        ));
        if c.noise.planes.of_noise > 0.0 {
            items.push((
                "Planes of the frames' own".into(),
                format!(
                    "{} times a pixel's noise; the standard deviations of the parameters cover them",
                    number(c.noise.planes.of_noise)
                ),
            ));
        }
    }
    items
        .push(("Termination".into(), format!("{} after {}", escape(&c.termination), count(c.iterations, "iteration"))));
    let items: String = items.iter().map(|(k, v)| format!("<div><dt>{k}</dt><dd>{v}</dd></div>\n")).collect();
    format!("<dl class=\"facts\">{items}</dl>\n")
}

/// Frames that were not used: dataset, name, reason.
pub(super) fn dropped(camera: &ReportCamera<'_>) -> Vec<[String; 3]> {
    let mut list: Vec<[String; 3]> = Vec::new();
    let mut add = |dataset: &str, name: &str, reason: &str| {
        let row = [dataset.to_owned(), name.to_owned(), reason.to_owned()];
        // The evaluation of the fitted dataset lists the same frames again.
        if !list.contains(&row) {
            list.push(row);
        }
    };
    if let Some(c) = camera.calibrated {
        c.capture.dropped.iter().for_each(|d| add(&c.capture.name, &d.name, &d.reason));
    }
    for d in &camera.evaluations {
        d.evaluated.dropped.iter().for_each(|f| add(&d.evaluated.name, &f.name, &f.reason));
    }
    list
}

/// Frames that were not used, as a table.
pub(super) fn dropped_table(camera: &ReportCamera<'_>) -> String {
    let list = dropped(camera);
    if list.is_empty() {
        return "<p>All frames were used.</p>\n".to_owned();
    }
    let rows: String = list
        .iter()
        .map(|[dataset, name, reason]| {
            format!(
                "<tr><td class=\"text\">{}</td><th scope=\"row\">{}</th><td class=\"text\">{}</td></tr>\n",
                escape(dataset),
                escape(name),
                escape(reason)
            )
        })
        .collect();
    format!(
        "<div class=\"scroll\" tabindex=\"0\"><table><caption>{} not used</caption><thead><tr><th \
         scope=\"col\">dataset</th>\
         <th scope=\"col\" class=\"text\">frame</th><th scope=\"col\" \
         class=\"text\">reason</th></tr></thead><tbody>{rows}</tbody></table></div>\n",
        count(list.len(), "frame")
    )
}
