//! Pictures of the worst frames: images with detected and projected markers, and residual vectors.

use std::collections::BTreeMap;
use std::fmt::Write;

use depthcal_io::GrayImage;
use depthcal_statistics::quantile;

use super::figures::round_factor;
use super::format::{number, quantity, significant};
use super::grey_png::Picture;
use super::html::escape;
use super::input::ReportCamera;
use super::page::base64;
use super::pool::{Pool, Pooled};

/// Most frames that are shown.
const MOST: usize = 6;
/// Widest picture, px: more would not be seen, and make the file large.
const WIDEST: usize = 320;
/// Part of the board's extent that is shown on every side of it.
const MARGIN: f64 = 0.25;
/// Length of a typical residual vector, as a share of the image's width.
const LENGTH: f64 = 0.015;

/// Corrected depth error of a frame, mm, or its reprojection error, px, where there is no depth.
fn error(frame: &Pooled<'_>) -> f64 {
    let record = frame.frame.record();
    let reprojection = record.reprojection_px.map_or(f64::NAN, |error| error.rms);
    record.depth_rms_mm.map_or(reprojection, |depth| depth.after)
}

/// The worst frames with images as HTML, the worst first, and a sentence about how to read them; `None` where no frame has an
/// image.
pub(super) fn pictures(camera: &ReportCamera<'_>) -> Option<(String, String)> {
    let capture = &camera.calibrated?.capture;
    let images: BTreeMap<&str, _> =
        capture.frames.iter().filter_map(|f| Some((f.name.as_str(), f.raw.image.as_ref()?))).collect();
    let mut frames = Pool::headline(camera).0.frames;
    frames.retain(|f| images.contains_key(f.frame.name.as_str()) && !f.frame.reprojection.is_empty());
    frames.sort_by(|a, b| error(b).total_cmp(&error(a)).then(a.frame.name.cmp(&b.frame.name)));
    let all = frames.len();
    frames.truncate(MOST);
    let lengths = frames.iter().flat_map(|f| f.frame.reprojection.iter().map(|e| e[2].hypot(e[3])));
    let factor = round_factor(LENGTH * capture.width as f64 / quantile(lengths, 0.75).max(1e-6));
    let mut html = String::new();
    for frame in &frames {
        // An image that has become unreadable is no reason to have no report.
        if let Ok(image) = images[frame.frame.name.as_str()].get() {
            html += &picture(frame, &image, factor).unwrap_or_default();
        }
    }
    let with_depth = frames.iter().any(|f| f.frame.record().depth_rms_mm.is_some());
    let order = if with_depth { "corrected depth error" } else { "reprojection error" };
    let intro = format!(
        "The {} of {all} frames with the largest {order}. Yellow rings: detected markers; blue crosses: where the model projects \
         them; pink: detected minus projected, enlarged {} ×. A click enlarges a picture.",
        frames.len(),
        significant(factor, 1)
    );
    (!html.is_empty()).then(|| (format!("<div class=\"grid three\">\n{html}</div>\n"), intro))
}

/// The part of an image with the markers and some of what surrounds them: first column, first row, width, height, px.
fn around_markers(frame: &Pooled<'_>, image: &GrayImage) -> [usize; 4] {
    let along = |axis: usize, size: usize| {
        let places = || frame.frame.reprojection.iter().map(|e| e[axis]).filter(|place| place.is_finite());
        let (low, high) = (places().fold(f64::INFINITY, f64::min), places().fold(0.0, f64::max));
        let margin = MARGIN * (high - low).max(1.0);
        let first = (low - margin).clamp(0.0, size as f64 - 1.0) as usize;
        let last = (high + margin).clamp(first as f64 + 1.0, size as f64) as usize;
        [first, last - first]
    };
    let ([u, width], [v, height]) = (along(0, image.width), along(1, image.height));
    [u, v, width, height]
}

fn picture(frame: &Pooled<'_>, image: &GrayImage, factor: f64) -> Option<String> {
    let [left, top, w, h] = around_markers(frame, image);
    let rows = image.data.chunks(image.width).skip(top).take(h);
    let data: Vec<u16> = rows.flat_map(|row| &row[left..left + w]).copied().collect();
    let png = base64(&Picture::of(&GrayImage { width: w, height: h, data, bits: image.bits }, WIDEST).png()?);
    let [x, y] = [left, top].map(|first| first as f64 - 0.5);
    // Marks are as large in every picture, whatever the resolution.
    let unit = w as f64 / WIDEST as f64;
    let (mut rings, mut crosses, mut vectors) = (String::new(), String::new(), String::new());
    let arm = 3.0 * unit;
    for [u, v, du, dv] in frame.frame.reprojection.iter().filter(|e| e.iter().all(|x| x.is_finite())) {
        let (x, y) = (u - du, v - dv);
        let _ = write!(
            rings,
            "M{:.2} {v:.2}a{arm:.2} {arm:.2} 0 1 0 {:.2} 0a{arm:.2} {arm:.2} 0 1 0 {:.2} 0",
            u - arm,
            2.0 * arm,
            -2.0 * arm
        );
        let _ = write!(crosses, "M{:.2} {y:.2}h{:.2}M{x:.2} {:.2}v{:.2}", x - arm, 2.0 * arm, y - arm, 2.0 * arm);
        let _ = write!(vectors, "M{x:.2} {y:.2}l{:.2} {:.2}", factor * du, factor * dv);
    }
    let record = frame.frame.record();
    let depth = record
        .depth_rms_mm
        .map_or_else(String::new, |d| format!("; depth error {} → {} mm rms", number(d.before), number(d.after)));
    let name = escape(&frame.frame.name);
    let errors = format!("{} rms in the image{depth}", quantity(record.reprojection_px?.rms, "px"));
    Some(format!(
        "<figure class=\"picture\" tabindex=\"0\"><svg viewBox=\"{x} {y} {w} {h}\" role=\"img\" aria-label=\"Frame {name}: {errors}\" \
         fill=\"none\" stroke-width=\"{:.2}\"><image x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" preserveAspectRatio=\"none\" \
         href=\"data:image/png;base64,{png}\"/><path stroke=\"#ffc000\" d=\"{rings}\"/><path stroke=\"#19b5ff\" d=\"{crosses}\"/>\
         <path stroke=\"#ff4fa0\" stroke-width=\"{:.2}\" d=\"{vectors}\"/></svg>\
         <figcaption><b>{name}</b> ({}): {errors}.</figcaption></figure>\n",
        0.8 * unit,
        1.4 * unit,
        frame.role.name(),
    ))
}
