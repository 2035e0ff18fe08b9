//! The content of a page while it is put together: HTML, navigation and figures.

use rayon::prelude::*;
use serde_json::Value;

use super::figures::Figure;
use super::html::escape;
use super::scope::Scope;

/// Sections, navigation and figures of a page or of a part of it.
#[derive(Debug, Default)]
pub(super) struct Content {
    scope: Scope,
    pub body: String,
    pub navigation: String,
    pub figures: Vec<Value>,
}

/// Adds one or more sections to a page.
pub(super) type Section<'a> = Box<dyn Fn(&mut Content) + Send + Sync + 'a>;

impl Content {
    /// Content without sections.
    pub(super) fn within(scope: &Scope) -> Self {
        Self { scope: scope.clone(), ..Self::default() }
    }

    /// Sections in the given order, drawn on all threads of the current pool.
    pub(super) fn of(scope: &Scope, sections: &[Section<'_>]) -> Self {
        let drawn: Vec<Self> = sections
            .par_iter()
            .map(|section| {
                let mut content = Self::within(scope);
                section(&mut content);
                content
            })
            .collect();
        drawn.into_iter().fold(Self::within(scope), Self::followed_by)
    }

    /// The id of an element in the part of the page that this is.
    pub(super) fn id(&self, id: &str) -> String {
        self.scope.id(id)
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
        self.begin(id, short, title, "");
        if !intro.is_empty() {
            self.body += &format!("<p class=\"intro\">{intro}</p>\n");
        }
    }

    /// Begins the section of the verdict, whose heading is not seen, with a sentence in HTML.
    pub(super) fn open_verdict(&mut self, sentence: &str) {
        self.begin("verdict", "Verdict", "Verdict", " class=\"visually-hidden\"");
        self.body += &format!("<p class=\"verdict\" id=\"{}\">{sentence}</p>\n", self.id("verdict-sentence"));
    }

    fn begin(&mut self, id: &str, short: &str, title: &str, class: &str) {
        let (id, level) = (self.id(id), self.scope.level());
        self.navigation += &format!("<li><a href=\"#{id}\">{short}</a></li>\n");
        self.body += &format!(
            "<section id=\"{id}\" aria-labelledby=\"{id}-title\"><h{level} id=\"{id}-title\"{class}>{title}</h{level}>\n"
        );
    }

    /// The sections of a camera of several as one section, below the camera's name.
    pub(super) fn below(self, name: &str) -> Self {
        let (id, name) = (self.id("all"), escape(name));
        let navigation = format!("<li class=\"camera\"><a href=\"#{id}\">{name}</a></li>\n{}", self.navigation);
        let body = format!(
            "<section class=\"camera\" id=\"{id}\" aria-labelledby=\"{id}-title\"><h2 id=\"{id}-title\">Camera {name}</h2>\n{}</section>\n",
            self.body
        );
        Self { navigation, body, ..self }
    }

    /// Ends the section.
    pub(super) fn close(&mut self) {
        self.body += "</section>\n";
    }

    /// Adds one figure.
    pub(super) fn figure(&mut self, figure: &Figure) {
        self.body += &figure.html(&self.scope);
        self.figures.push(figure.json(&self.scope));
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
        let ids: Vec<String> = figures.iter().map(|f| self.id(&f.id)).collect();
        let id = self.id(id);
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
