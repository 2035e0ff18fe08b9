//! A figure of the page.

use serde_json::{Value, json};

use crate::html::escape;
use crate::scope::Scope;

/// A figure.
#[derive(Debug, Clone)]
pub(crate) struct Figure {
    /// Unique in its part of the page.
    pub id: String,
    pub title: String,
    /// How to read it, with its main numbers; HTML.
    pub caption: String,
    /// Description of what it shows, for readers who cannot see it.
    pub alt: String,
    /// Width over height.
    pub aspect: f64,
    pub data: Vec<Value>,
    pub layout: Value,
    /// Other contents that a picker shows in place of the data.
    pub variants: Vec<Variant>,
}

/// One choice of a picker.
#[derive(Debug, Clone)]
pub(crate) struct Variant {
    /// Its name in the picker.
    pub label: String,
    /// The sentence next to the picker.
    pub note: String,
    /// Fields that replace those of the first trace.
    pub trace: Value,
}

impl Figure {
    pub(crate) fn new(id: impl Into<String>, title: impl Into<String>, data: Vec<Value>, layout: Value) -> Self {
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

    pub(crate) fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    pub(crate) fn alt(mut self, alt: impl Into<String>) -> Self {
        self.alt = alt.into();
        self
    }

    pub(crate) fn aspect(mut self, aspect: f64) -> Self {
        self.aspect = aspect;
        self
    }

    /// The HTML element that the script draws into, in a part of the page.
    pub(crate) fn html(&self, scope: &Scope) -> String {
        format!(
            "<figure id=\"{around}\"><h{level}>{title}</h{level}>\n<div class=\"plot\" id=\"{id}\" role=\"img\" \
             aria-label=\"{alt}\" \
             style=\"aspect-ratio:{aspect:.3}\"></div>\n<figcaption>{caption}</figcaption></figure>\n",
            around = scope.id(&format!("figure-{}", self.id)),
            level = scope.level() + 1,
            id = scope.id(&self.id),
            title = escape(&self.title),
            alt = escape(&self.alt),
            aspect = self.aspect,
            caption = self.caption,
        )
    }

    /// The figure as the page's script reads it.
    pub(crate) fn json(&self, scope: &Scope) -> Value {
        let id = scope.id(&self.id);
        let mut value = json!({"id": id, "aspect": self.aspect, "data": self.data, "layout": self.layout});
        if !self.variants.is_empty() {
            let variant = |v: &Variant| json!({"label": v.label, "note": v.note, "trace": v.trace});
            value["variants"] = self.variants.iter().map(variant).collect();
        }
        value
    }
}
