//! The page's sections, from top to bottom.

use serde_json::Value;

use super::covariates::{Image, all};
use super::figures::{self, Figure};
use super::html::{count, escape, number};
use super::leftover::{Leftover, judged};
use super::uncertainty::Uncertainty;
use super::{ReportDiagnosis, ReportInput, Role, checks, diagnosis, headline, tables};

/// Doubts that the first screen repeats.
const DOUBTS: usize = 3;

/// Keeps numbers and units on one line.
fn tie(text: &str) -> String {
    [" mm", " px", " %"].iter().fold(text.to_owned(), |t, unit| t.replace(unit, &unit.replace(' ', "\u{a0}")))
}

/// What the page is filled with.
#[derive(Debug, Default)]
pub(super) struct Content {
    pub body: String,
    pub navigation: String,
    pub figures: Vec<Value>,
}

impl Content {
    pub(super) fn open(&mut self, id: &str, [short, title]: [&str; 2], intro: &str) {
        self.navigation += &format!("<li><a href=\"#{id}\">{short}</a></li>\n");
        self.body +=
            &format!("<section id=\"{id}\" aria-labelledby=\"{id}-title\"><h2 id=\"{id}-title\">{title}</h2>\n");
        if !intro.is_empty() {
            self.body += &format!("<p class=\"intro\">{intro}</p>\n");
        }
    }

    pub(super) fn close(&mut self) {
        self.body += "</section>\n";
    }

    pub(super) fn figure(&mut self, figure: &Figure) {
        self.body += &figure.html();
        self.figures.push(figure.json());
    }

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

/// Builds all sections.
pub(super) fn content(input: &ReportInput<'_>) -> Content {
    let image = Image::of(input);
    let leftover = Leftover::of(input, &image);
    let checks = checks::checks(input, &image, leftover.as_ref());
    let mut page = Content::default();
    if let Some(d) = &input.diagnosis {
        let coverage = checks::coverage_gaps(&checks);
        account(&mut page, input, d, &coverage);
        left_by_model(&mut page, input, d, &image, leftover.as_ref());
        tested(&mut page, d);
        next(&mut page, d, &coverage);
        trust(&mut page, &checks);
    } else {
        first_screen(&mut page, input, &checks);
        trust(&mut page, &checks);
        left(&mut page, input, &image, leftover.as_ref());
        single_frames(&mut page, figures::differences(input));
        against(&mut page, input, &image);
    }
    per_frame(&mut page, input);
    volume(&mut page, input, &image);
    camera(&mut page, input);
    page.open("dropped", ["Not used", "Frames that were not used"], "");
    page.body += &tables::dropped_table(input);
    page.close();
    reading(&mut page);
    page
}

/// Sentences that introduce the report.
fn story(input: &ReportInput<'_>) -> String {
    let story: String = input.story.iter().map(|s| format!("<p>{}</p>\n", escape(s))).collect();
    if story.is_empty() { story } else { format!("<div class=\"story\">{story}</div>\n") }
}

fn first_screen(page: &mut Content, input: &ReportInput<'_>, checks: &[checks::Check]) {
    let (level, text) = checks::overall(checks);
    let story = story(input);
    page.navigation += "<li><a href=\"#verdict\">Verdict</a></li>\n";
    page.body += &format!(
        "<section id=\"verdict\" aria-labelledby=\"verdict-title\"><h2 id=\"verdict-title\" class=\"visually-hidden\">\
         Verdict</h2>\n<p class=\"verdict\" id=\"verdict-sentence\">{}</p>\n<p class=\"trust {level}\">\
         <a href=\"#trust\"><span class=\"mark\" aria-hidden=\"true\"></span>{}</a></p>\n{story}<div \
         class=\"first\">\n",
        tie(&escape(&headline::sentence(input))),
        escape(&text),
        level = level.name(),
    );
    page.body += "<div class=\"panel\">";
    page.body += &tables::headline(input);
    let doubts: String = checks
        .iter()
        .filter(|c| c.level != checks::Level::Good)
        .take(DOUBTS)
        .map(|c| {
            format!(
                "<li class=\"{}\"><span class=\"mark\" aria-hidden=\"true\"></span>{}</li>\n",
                c.level.name(),
                tie(&escape(&c.answer))
            )
        })
        .collect();
    if !doubts.is_empty() {
        page.body += &format!("<ul class=\"checks doubts\" aria-label=\"To consider\">{doubts}</ul>\n");
    }
    page.body += "</div>\n";
    if let Some(figure) = figures::headline_bars(input) {
        page.figure(&figure);
    }
    page.body += "</div>\n";
    page.close();
}

/// The first screen of a diagnosis: the questions that a reader has, and the steps.
fn account(page: &mut Content, input: &ReportInput<'_>, d: &ReportDiagnosis<'_>, coverage: &[String]) {
    let (level, text) = diagnosis::pill(d);
    let story = story(input);
    page.navigation += "<li><a href=\"#verdict\">Verdict</a></li>\n";
    let rows: String = diagnosis::answers(input, d, coverage)
        .iter()
        .map(|a| {
            format!(
                "<div><dt><a href=\"#{}\">{}</a></dt><dd>{}</dd></div>\n",
                a.more,
                a.question,
                tie(&escape(&a.answer))
            )
        })
        .collect();
    page.body += &format!(
        "<section id=\"verdict\" aria-labelledby=\"verdict-title\"><h2 id=\"verdict-title\" class=\"visually-hidden\">\
         Verdict</h2>\n<p class=\"verdict\" id=\"verdict-sentence\">{}</p>\n<p class=\"trust {level}\">\
         <a href=\"#where\"><span class=\"mark\" aria-hidden=\"true\"></span>{}</a></p>\n{story}<div class=\"first\">\n\
         <div class=\"panel\"><dl class=\"answers\">{rows}</dl></div>\n",
        tie(&escape(&diagnosis::sentence(input, d))),
        escape(&text),
        level = level.name(),
    );
    let list: Vec<Figure> = figures::stage_bars(input, d).into_iter().chain(figures::step_gains(d)).collect();
    page.grid(&list, "stack");
    page.body += "</div>\n";
    page.close();
    page.open("steps", ["Steps", "What was added, and what it brought"], "");
    page.body += &diagnosis::steps(d);
    page.body += &format!("<div class=\"panel\">{}</div>\n", tables::headline(input));
    page.close();
}

/// What the declared and the last model leave: maps, trends with what was added drawn through, frames.
fn left_by_model(
    page: &mut Content,
    input: &ReportInput<'_>,
    d: &ReportDiagnosis<'_>,
    image: &Image,
    leftover: Option<&Leftover>,
) {
    let mut intro: Vec<String> = d.account.left_over.iter().map(|s| format!("Left: {}.", escape(s))).collect();
    intro.extend(leftover.map(|l| escape(&l.sentence())));
    page.open("where", ["What is left", "Where was it wrong, and what is left?"], &intro.join(" "));
    page.grid(&figures::image_maps_by_model(input, d, image), "three");
    let mut over = figures::board_maps_by_model(input, d);
    over.extend(figures::reprojection_field(input, image));
    page.grid(&over, if over.len() == 3 { "three" } else { "two" });
    if let Some(l) = leftover {
        page.body += &leftover_table(l);
    }
    page.close();

    let taken = figures::Taken::of(input, d);
    let list: Vec<Figure> =
        all(image).iter().filter_map(|c| figures::model_curve(input, d, taken.as_ref(), c)).collect();
    if !list.is_empty() {
        let intro = "Points with whiskers: mean over the frames of each frame's median in the bin, with its 95 % interval. \
                     Dotted: what the added effects, with everything fitted anew beside them, take off there: where they are \
                     the cause, it runs through the points of the declared model.";
        page.open("against", ["Trends", "What did the error depend on, and does the added effect follow?"], intro);
        page.grid(&list, "two fill");
        page.close();
    }
    single_frames(page, figures::differences_by_model(input, d));
    page.open("outliers", ["Odd frames", "Frames that do not belong"], "");
    page.body += &diagnosis::frames(d);
    page.grid(&figures::frames_by_model(input, d).into_iter().collect::<Vec<_>>(), "one");
    page.close();
}

/// Candidates, and which of them these captures can tell apart.
fn tested(page: &mut Content, d: &ReportDiagnosis<'_>) {
    let intro = "Every effect of the catalogue, and free functions that take up anything along one quantity, tested beside the \
                 model without fitting them.";
    page.open("candidates", ["Candidates", "What was tested"], intro);
    if let Some(ranking) = figures::ranking(d) {
        let list = [ranking];
        page.picker("round-picker", "Round", &list, 0);
        let [ranking] = list;
        let both: Vec<Figure> = std::iter::once(ranking).chain(figures::sizes(d)).collect();
        page.grid(&both, "two");
    }
    page.body += &diagnosis::candidates(d);
    page.close();
    if let Some(figure) = figures::separability(d) {
        page.open("apart", ["Told apart", "What these captures cannot tell apart"], "");
        page.body += &diagnosis::apart(d);
        page.grid(&[figure], "two fill");
        page.close();
    }
}

fn next(page: &mut Content, d: &ReportDiagnosis<'_>, coverage: &[String]) {
    page.open("next", ["Next", "What to capture next"], "");
    page.body += &diagnosis::next(d, coverage);
    page.close();
}

fn trust(page: &mut Content, checks: &[checks::Check]) {
    page.open("trust", ["Trust", "May I trust it?"], "");
    let rows: String = checks
        .iter()
        .map(|c| {
            format!(
                "<li class=\"{}\"><span class=\"mark\" aria-hidden=\"true\"></span><span class=\"visually-hidden\">{}: \
                 </span><b>{}</b> {}</li>\n",
                c.level.name(),
                c.level.name(),
                escape(c.question),
                escape(&c.answer)
            )
        })
        .collect();
    page.body += &format!("<ul class=\"checks\">{rows}</ul>\n");
    page.close();
}

fn left(page: &mut Content, input: &ReportInput<'_>, image: &Image, leftover: Option<&Leftover>) {
    let maps = figures::image_maps(input, image);
    let field = figures::reprojection_field(input, image);
    if maps.is_empty() && field.is_none() {
        return;
    }
    let intro = leftover.map_or(String::new(), |l| escape(&l.sentence()));
    page.open("where", ["What is left", "Where was it wrong, and what is left?"], &intro);
    page.grid(&maps, "three");
    if let Some(l) = leftover {
        page.body += &leftover_table(l);
    }
    let image_figures: Vec<Figure> = [field, figures::board_map(input)].into_iter().flatten().collect();
    page.grid(&image_figures, "two");
    page.close();
}

fn leftover_table(l: &Leftover) -> String {
    let rows: String = l
        .findings
        .iter()
        .map(|f| {
            let (class, verdict) = if f.found { ("care", "more than noise") } else { ("good", "within noise") };
            format!(
                "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td class=\"text \
                 {class}\">{verdict}</td>\
                 <td class=\"text\">{}</td></tr>\n",
                escape(&f.over),
                number(f.structure.size_mm),
                number(f.structure.hidden_mm),
                p_value(f.structure.p_value),
                escape(&f.worst)
            )
        })
        .collect();
    let whose = if l.with_fitted { "fitted ones among them" } else { "none of them seen by the fit" };
    format!(
        "<details><summary>The tests behind this sentence</summary><div class=\"scroll\" \
         tabindex=\"0\"><table><caption>Corrected depth \
         error in bins, over {} ({whose}). Size: rms of a smooth pattern beyond what chance gives. Hidden: what chance \
         would hide. p: chance of as much when every frame's errors were as likely negative as positive; it must stay \
         below {:.4} here, since {} tests are made.</caption><thead><tr><th scope=\"col\">pattern over</th><th \
         scope=\"col\">size / mm</th>\
         <th scope=\"col\">hidden / mm</th><th scope=\"col\">p</th><th scope=\"col\" class=\"text\">verdict</th><th \
         scope=\"col\" class=\"text\">largest</th></tr></thead>\
         <tbody>{rows}</tbody></table></div></details>\n",
        count(l.frames, "frame"),
        0.05 / l.findings.len().max(1) as f64,
        l.findings.len()
    )
}

fn p_value(p: f64) -> String {
    if p <= 0.0005 { "≤ 0.0005".to_owned() } else { format!("{p:.4}") }
}

fn single_frames(page: &mut Content, list: Vec<Figure>) {
    if list.is_empty() {
        return;
    }
    let intro = "Choose a frame; ‹ and › step through them, and so do the arrow keys on the list.";
    page.open("frames", ["Frames", "Frame by frame"], intro);
    page.picker("frame-picker", "Frame", &list, 0);
    page.grid(&list, if list.len() == 3 { "three" } else { "two" });
    page.close();
}

fn against(page: &mut Content, input: &ReportInput<'_>, image: &Image) {
    let mut list: Vec<Figure> = all(image).iter().filter_map(|c| figures::curve(input, c)).collect();
    let with_depth = !list.is_empty();
    list.extend(figures::image_trend(input, image));
    if list.is_empty() {
        return;
    }
    let intro = if with_depth {
        format!(
            "Points with whiskers: mean over the {} of each frame's median in the bin, with its 95 % interval. Small \
             dots: single pixels. A correct model leaves the blue points on zero within their whiskers.",
            count(judged(input).frames.len(), "frame")
        )
    } else {
        String::new()
    };
    page.open("against", ["Trends", "What does the error depend on?"], &intro);
    page.grid(&list, "two fill");
    page.close();
}

fn per_frame(page: &mut Content, input: &ReportInput<'_>) {
    let list: Vec<Figure> =
        input.evaluations.iter().enumerate().filter_map(|(i, d)| figures::per_frame(d, i)).collect();
    let datasets = figures::by_dataset(input);
    if list.is_empty() && datasets.is_empty() && input.evaluations.is_empty() {
        return;
    }
    page.open("datasets", ["Datasets", "Errors of every dataset and frame"], "");
    page.body += &tables::datasets(input);
    page.grid(&datasets, "two");
    page.grid(&list, "one");
    page.close();
}

fn volume(page: &mut Content, input: &ReportInput<'_>, image: &Image) {
    let list: Vec<Figure> = [figures::poses(input), figures::coverage(input, image), figures::distance_and_tilt(input)]
        .into_iter()
        .flatten()
        .collect();
    if list.is_empty() {
        return;
    }
    page.open("volume", ["Volume", "The volume that was measured"], "");
    page.grid(&list, "two fill");
    page.close();
}

fn camera(page: &mut Content, input: &ReportInput<'_>) {
    let Some(c) = input.calibrated else { return };
    if let Some(u) = Uncertainty::of(c) {
        let unseen = input.evaluations.iter().any(|d| d.role != Role::Fitted);
        let intro = if unseen {
            "The parameters' covariance, carried through the correction. It holds if the model is right: what is left \
             above comes on top of it."
        } else {
            "The parameters' covariance, carried through the correction. It holds if the model is right."
        };
        page.open("uncertainty", ["Uncertainty", "How sure is corrected depth?"], intro);
        let map = [figures::uncertainty_map(c, &u)];
        page.picker("distance-picker", "Distance of the map", &map, 1);
        let [map] = map;
        page.grid(&[figures::uncertainty_curves(c, &u), map], "two");
        page.close();
    }
    page.open("parameters", ["Parameters", "The camera"], "");
    page.body += &tables::parameters(c);
    for confounded in c.camera.blocks().iter().filter_map(|block| block.piece()?.confounded()) {
        page.body += &format!("<p class=\"note\">{}</p>\n", escape(confounded));
    }
    page.body += &tables::fit(c);
    let list: Vec<Figure> = [figures::noise(input), figures::correlation(c)].into_iter().flatten().collect();
    page.grid(&list, "two");
    page.close();
}

fn reading(page: &mut Content) {
    page.open("reading", ["Definitions", "How the numbers are made"], "");
    page.body += include_str!("reading.html");
    page.close();
}
