//! The figures: data and layout in the schema of plotly.js, with title, caption and a text for those who cannot see
//! them.
//!
//! Colours of text, axes and grid are set in the page, which knows whether it is light, dark or printed. What belongs
//! to
//! depth as measured is orange with open marks, what belongs to corrected depth blue with full marks, everywhere.

mod bars;
mod candidates;
mod correlation;
mod coverage;
mod curves;
mod differences;
mod field;
mod maps;
mod models;
mod noise;
mod per_frame;
mod poses;
mod ranking;
mod stages;
mod uncertain;

use serde_json::{Value, json};

use super::html::escape;

pub(super) use bars::{by_dataset, headline_bars};
pub(super) use candidates::{ranking, separability, sizes};
pub(super) use correlation::correlation;
pub(super) use coverage::{coverage, distance_and_tilt};
pub(super) use curves::{curve, image_trend};
pub(super) use differences::{differences, differences_by_model};
pub(super) use field::reprojection_field;
pub(super) use maps::{board_map, board_maps_by_model, image_maps, image_maps_by_model};
pub(super) use models::{Taken, frames_by_model, model_curve};
pub(super) use noise::noise;
pub(super) use per_frame::per_frame;
pub(super) use poses::poses;
pub(super) use ranking::{correction_maps, learning_curve, model_ranking};
pub(super) use stages::{stage_bars, step_gains};
pub(super) use uncertain::{uncertainty_curves, uncertainty_map};

/// Depth as measured.
pub(super) const BEFORE: &str = "#d9730d";
/// Corrected depth.
pub(super) const AFTER: &str = "#1f86c7";
/// What is neither.
pub(super) const NEUTRAL: &str = "#808793";
/// A second neutral thing.
pub(super) const OTHER: &str = "#a05fb4";

/// A figure.
#[derive(Debug, Clone)]
pub(super) struct Figure {
    /// Unique in the page.
    pub id: String,
    pub title: String,
    /// What is seen and how to read it; HTML.
    pub caption: String,
    /// What it shows, for those who cannot see it.
    pub alt: String,
    /// Width over height.
    pub aspect: f64,
    pub data: Vec<Value>,
    pub layout: Value,
    /// Other contents that a picker shows in place of the data.
    pub variants: Vec<Variant>,
}

/// What a picker can show.
#[derive(Debug, Clone)]
pub(super) struct Variant {
    /// Its name in the picker.
    pub label: String,
    /// What is said about it beside the picker.
    pub note: String,
    /// Replaces the first trace's fields.
    pub trace: Value,
}

impl Figure {
    pub(super) fn new(id: impl Into<String>, title: impl Into<String>, data: Vec<Value>, layout: Value) -> Self {
        Self {
            id: id.into(),
            title: title.into(),
            caption: String::new(),
            alt: String::new(),
            aspect: 1.5,
            data,
            layout,
            variants: Vec::new(),
        }
    }

    pub(super) fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    pub(super) fn alt(mut self, alt: impl Into<String>) -> Self {
        self.alt = alt.into();
        self
    }

    pub(super) fn aspect(mut self, aspect: f64) -> Self {
        self.aspect = aspect;
        self
    }

    /// The element that the script fills.
    pub(super) fn html(&self) -> String {
        format!(
            "<figure id=\"figure-{id}\"><h3>{title}</h3>\n<div class=\"plot\" id=\"{id}\" role=\"img\" \
             aria-label=\"{alt}\" \
             style=\"aspect-ratio:{aspect:.3}\"></div>\n<figcaption>{caption}</figcaption></figure>\n",
            id = self.id,
            title = escape(&self.title),
            alt = escape(&self.alt),
            aspect = self.aspect,
            caption = self.caption,
        )
    }

    /// What the script draws.
    pub(super) fn json(&self) -> Value {
        let mut value = json!({"id": self.id, "aspect": self.aspect, "data": self.data, "layout": self.layout});
        if !self.variants.is_empty() {
            let variant = |v: &Variant| json!({"label": v.label, "note": v.note, "trace": v.trace});
            value["variants"] = self.variants.iter().map(variant).collect();
        }
        value
    }
}

/// Whiskers that reach by `above` and `below` beyond their values.
pub(super) fn whiskers(above: Value, below: Value) -> Value {
    json!({"type": "data", "symmetric": false, "thickness": 1.5, "width": 4, "array": above, "arrayminus": below})
}

/// A number with a few significant digits, to keep the file small; null where there is none.
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

/// Many of them.
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

/// Text as plotly.js shows it, which understands some markup.
pub(super) fn plain(text: &str) -> String {
    escape(text)
}

/// An axis with a title.
pub(super) fn axis(title: &str) -> Value {
    json!({"title": {"text": title}})
}

/// Axes in pixels of an image, v downwards, with square pixels.
pub(super) fn image_axes(image: &super::covariates::Image) -> Value {
    json!({
        "xaxis": {"title": {"text": "u / px"}, "range": [-0.5, image.width - 0.5], "constrain": "domain", "showgrid":
         false},
        "yaxis": {"title": {"text": "v / px"}, "range": [image.height - 0.5, -0.5], "scaleanchor": "x",
                  "constrain": "domain", "showgrid": false},
    })
}

/// Blue (too near) over white to orange-red (too far): told apart by all common kinds of colour blindness, and darker
/// towards both ends.
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

/// A sequential scale that all can read.
pub(super) fn sequential() -> &'static str {
    "Cividis"
}

/// A colour bar with a unit on top.
pub(super) fn colour_bar(unit: &str) -> Value {
    json!({"title": {"text": unit, "side": "top"}, "thickness": 12, "outlinewidth": 0, "len": 1.0})
}
