//! The content of a page while it is put together: HTML, navigation and figures.

use rayon::prelude::*;
use serde_json::Value;

use super::figures::Figure;
use super::html::escape;

/// Sections, navigation and figures of a page.
#[derive(Debug, Default)]
pub(super) struct Content {
    pub body: String,
    pub navigation: String,
    pub figures: Vec<Value>,
}

/// What adds one or more sections to a page.
pub(super) type Section<'a> = Box<dyn Fn(&mut Content) + Send + Sync + 'a>;

impl Content {
    /// Sections in the given order, drawn on all threads of the current pool.
    pub(super) fn of(sections: &[Section<'_>]) -> Self {
        let drawn: Vec<Self> = sections
            .par_iter()
            .map(|section| {
                let mut content = Self::default();
                section(&mut content);
                content
            })
            .collect();
        drawn.into_iter().fold(Self::default(), Self::followed_by)
    }

    /// This content and then another.
    pub(super) fn followed_by(mut self, other: Self) -> Self {
        self.body += &other.body;
        self.navigation += &other.navigation;
        self.figures.extend(other.figures);
        self
    }

    /// Begins a section with its entry in the navigation; `intro` is HTML.
    pub(super) fn open(&mut self, id: &str, [short, title]: [&str; 2], intro: &str) {
        self.navigation += &format!("<li><a href=\"#{id}\">{short}</a></li>\n");
        self.body +=
            &format!("<section id=\"{id}\" aria-labelledby=\"{id}-title\"><h2 id=\"{id}-title\">{title}</h2>\n");
        if !intro.is_empty() {
            self.body += &format!("<p class=\"intro\">{intro}</p>\n");
        }
    }

    /// Ends the section.
    pub(super) fn close(&mut self) {
        self.body += "</section>\n";
    }

    /// Adds one figure.
    pub(super) fn figure(&mut self, figure: &Figure) {
        self.body += &figure.html();
        self.figures.push(figure.json());
    }

    /// Adds figures side by side; `class` is the number of columns in words, for the style sheet.
    pub(super) fn grid(&mut self, list: &[Figure], class: &str) {
        if list.is_empty() {
            return;
        }
        self.body += &format!("<div class=\"grid {class}\">\n");
        list.iter().for_each(|f| self.figure(f));
        self.body += "</div>\n";
    }

    /// A picker that switches figures to their variants, beginning with one of them.
    pub(super) fn picker(&mut self, id: &str, label: &str, figures: &[Figure], start: usize) {
        let Some(first) = figures.first().filter(|f| f.variants.len() > 1) else { return };
        let options: String = first
            .variants
            .iter()
            .enumerate()
            .map(|(i, v)| format!("<option value=\"{i}\">{}</option>", escape(&v.label)))
            .collect();
        let ids: Vec<&str> = figures.iter().map(|f| f.id.as_str()).collect();
        self.body += &format!(
            "<div class=\"picker\" data-figures=\"{ids}\" data-start=\"{start}\"><label for=\"{id}\">{label}</label>\
             <button type=\"button\" data-step=\"-1\" aria-label=\"Previous\">‹</button>\
             <select id=\"{id}\">{options}</select>\
             <button type=\"button\" data-step=\"1\" aria-label=\"Next\">›</button>\
             <output for=\"{id}\" aria-live=\"polite\">{note}</output></div>\n",
            ids = ids.join(" "),
            note = escape(&first.variants[start.min(first.variants.len() - 1)].note),
        );
    }
}
