//! Colours, axes and numbers in plotly's JSON that figures share.
//!
//! Depth as measured is orange with open marks, corrected depth blue with full marks, in every figure.

use serde_json::{Value, json};

use crate::covariates::Image;
use crate::html::escape;

/// Depth as measured.
pub(super) const BEFORE: &str = "#d9730d";
/// Corrected depth.
pub(super) const AFTER: &str = "#1f86c7";
/// Anything that is neither measured nor corrected depth.
pub(super) const NEUTRAL: &str = "#808793";
/// A second colour for such things.
pub(super) const OTHER: &str = "#a05fb4";

/// Whiskers from `below` under each value to `above` over it.
pub(super) fn whiskers(above: Value, below: Value) -> Value {
    json!({"type": "data", "symmetric": false, "thickness": 1.5, "width": 4, "array": above, "arrayminus": below})
}

/// A number with four significant digits, to keep the file small; null for NaN and infinity.
pub(super) fn short(value: f64) -> Value {
    if !value.is_finite() {
        return Value::Null;
    }
    if value == 0.0 {
        return json!(0);
    }
    let digits = 10_f64.powf(3.0 - value.abs().log10().floor());
    let rounded = (value * digits).round() / digits;
    if rounded.fract() == 0.0 && rounded.abs() < 1e9 { json!(rounded as i64) } else { json!(rounded) }
}

/// Several numbers, as [`short`].
pub(super) fn shorts(values: impl IntoIterator<Item = f64>) -> Value {
    values.into_iter().map(short).collect()
}

/// A number with a fixed number of decimals.
pub(super) fn rounded(value: f64, decimals: i32) -> Value {
    let digits = 10_f64.powi(decimals);
    let value = (value * digits).round() / digits;
    match value.is_finite() {
        false => Value::Null,
        true if value.fract() == 0.0 && value.abs() < 1e9 => json!(value as i64),
        true => json!(value),
    }
}

/// Text that plotly.js, which understands some markup, shows as it is.
pub(super) fn plain(text: &str) -> String {
    escape(text)
}

/// An axis with a title.
pub(super) fn axis(title: &str) -> Value {
    json!({"title": {"text": title}})
}

/// Axes in pixels of an image, v downwards, with square pixels.
pub(super) fn image_axes(image: &Image) -> Value {
    json!({
        "xaxis": {"title": {"text": "u / px"}, "range": [-0.5, image.width - 0.5], "constrain": "domain", "showgrid":
         false},
        "yaxis": {"title": {"text": "v / px"}, "range": [image.height - 0.5, -0.5], "scaleanchor": "x",
                  "constrain": "domain", "showgrid": false},
    })
}

/// A grey band over the whole height of a plot.
pub(super) fn band(from: f64, to: f64) -> Value {
    json!({"type": "rect", "xref": "x", "yref": "paper", "x0": from, "x1": to, "y0": 0, "y1": 1, "line": {"width": 0},
           "fillcolor": NEUTRAL, "opacity": 0.13, "layer": "below"})
}

/// Axes of a map whose rows run downwards.
pub(super) fn map_axes([x, y]: [&str; 2]) -> Value {
    json!({
        "xaxis": {"title": {"text": x}, "constrain": "domain", "showgrid": false},
        "yaxis": {"title": {"text": y}, "autorange": "reversed", "scaleanchor": "x", "constrain": "domain",
                  "showgrid": false},
    })
}

/// Blue (too near) over white to orange-red (too far), darker towards both ends: readable with all common kinds of colour
/// blindness.
pub(super) fn diverging() -> Value {
    json!([
        [0.0, "#0b3c6f"],
        [0.2, "#2f79b5"],
        [0.4, "#a9cfe6"],
        [0.5, "#f7f7f7"],
        [0.6, "#fbc795"],
        [0.8, "#d9661f"],
        [1.0, "#7f2704"]
    ])
}

/// A sequential colour scale that is readable with all common kinds of colour blindness.
pub(super) fn sequential() -> &'static str {
    "Cividis"
}

/// A colour bar with a unit on top.
pub(super) fn colour_bar(unit: &str) -> Value {
    json!({"title": {"text": unit, "side": "top"}, "thickness": 12, "outlinewidth": 0, "len": 1.0})
}

/// The largest 1, 2 or 5 times a power of ten that is at most `wanted`: by which vectors are enlarged.
pub(crate) fn round_factor(wanted: f64) -> f64 {
    let decade = 10_f64.powf(wanted.log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|m| m * decade).find(|factor| *factor <= wanted).unwrap_or(decade)
}
