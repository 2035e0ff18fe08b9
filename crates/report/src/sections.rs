//! The sections of one camera, from top to bottom.

use rayon::prelude::*;

use super::checks::{Check, Level};
use super::content::{Content, Section};
use super::covariates::{Image, all};
use super::diagnosis::sentences::left_over;
use super::figures::{self, Figure};
use super::fit_sentences::fit_sentences;
use super::format::{count, number, p_value};
use super::html::{escape, tie};
use super::input::{ReportCamera, ReportDiagnosis, Role};
use super::leftover::{Leftover, tested_frames};
use super::scope::Scope;
use super::uncertainty::Uncertainty;
use super::{checks, diagnosis, headline, pictures, tables};

/// Failed checks that the first screen shows.
const DOUBTS: usize = 3;

/// The verdict on one camera.
#[derive(Debug, Clone)]
pub(super) struct Summary {
    /// The outcome of its checks, of a diagnosis that of its verdict.
    pub level: Level,
    /// The outcome in a few words.
    pub outcome: String,
    /// Its errors in a sentence.
    pub sentence: String,
}

impl Summary {
    fn of(camera: &ReportCamera<'_>, checks: &[Check]) -> Self {
        let ((level, outcome), sentence) = match &camera.diagnosis {
            Some(d) => (diagnosis::pill(d), diagnosis::sentence(camera, d)),
            None => (checks::overall(checks), headline::sentence(camera)),
        };
        Self { level, outcome, sentence }
    }
}

/// Builds all sections of a camera, which `story` introduces. None needs what another one draws, so they are drawn side by side.
pub(super) fn content(scope: &Scope, camera: &ReportCamera<'_>, story: &[String]) -> (Summary, Content) {
    let image = &Image::of(camera);
    let ((summary, judged), others) =
        rayon::join(|| judged(scope, camera, image, story), || Content::of(scope, &others(camera, image)));
    (summary, judged.followed_by(others))
}

/// The sections that tell what is left after correction, and whether the result may be trusted.
fn judged(scope: &Scope, camera: &ReportCamera<'_>, image: &Image, story: &[String]) -> (Summary, Content) {
    let leftover = Leftover::of(camera, image);
    let checks = checks::checks(camera, image, leftover.as_ref());
    let summary = Summary::of(camera, &checks);
    let (leftover, checks) = (leftover.as_ref(), checks.as_slice());
    let coverage = checks::coverage_gaps(checks);
    let coverage = coverage.as_slice();
    let sections: Vec<Section<'_>> = match &camera.diagnosis {
        Some(d) => vec![
            Box::new(|page| diagnosis_screen(page, camera, d, coverage, &summary, story)),
            Box::new(|page| left_by_model(page, camera, d, image, leftover)),
            Box::new(|page| trends_by_model(page, camera, d, image)),
            Box::new(|page| single_frames(page, figures::differences_by_model(camera, d))),
            Box::new(|page| excluded(page, camera, d)),
            Box::new(|page| tested(page, d)),
            Box::new(|page| next(page, d, coverage)),
            Box::new(|page| trust(page, checks)),
        ],
        None => vec![
            Box::new(|page| first_screen(page, camera, checks, &summary, story)),
            Box::new(|page| trust(page, checks)),
            Box::new(|page| left(page, camera, image, leftover)),
        ],
    };
    let content = Content::of(scope, &sections);
    drop(sections);
    (summary, content)
}

/// All other sections.
fn others<'a>(camera: &'a ReportCamera<'a>, image: &'a Image) -> Vec<Section<'a>> {
    let mut sections: Vec<Section<'a>> = Vec::new();
    if camera.diagnosis.is_none() {
        sections.push(Box::new(|page| single_frames(page, figures::differences(camera))));
        sections.push(Box::new(|page| against(page, camera, image)));
    }
    sections.push(Box::new(|page| pictures(page, camera)));
    sections.push(Box::new(|page| per_frame(page, camera)));
    sections.push(Box::new(|page| volume(page, camera, image)));
    sections.push(Box::new(|page| parameters(page, camera)));
    sections.push(Box::new(|page| {
        page.open("dropped", ["Not used", "Frames that were not used"], "");
        page.body += &tables::dropped_table(camera);
        page.close();
    }));
    sections
}

/// The verdict with its outcome, which links to a section, and sentences that introduce the camera.
fn open_verdict(page: &mut Content, camera: &ReportCamera<'_>, summary: &Summary, more: &str, story: &[String]) {
    page.open_verdict(&tie(&escape(&summary.sentence)));
    page.body += &format!(
        "<p class=\"trust {}\"><a href=\"#{}\"><span class=\"mark\" aria-hidden=\"true\"></span>{}</a></p>\n",
        summary.level.name(),
        page.id(more),
        escape(&summary.outcome),
    );
    let fitted = match (&camera.diagnosis, camera.calibrated) {
        (None, Some(calibrated)) => fit_sentences(calibrated),
        _ => Vec::new(),
    };
    let story: String = story.iter().chain(&fitted).map(|s| format!("<p>{}</p>\n", escape(s))).collect();
    if !story.is_empty() {
        page.body += &format!("<div class=\"story\">{story}</div>\n");
    }
}

fn first_screen(page: &mut Content, camera: &ReportCamera<'_>, checks: &[Check], summary: &Summary, story: &[String]) {
    open_verdict(page, camera, summary, "trust", story);
    page.body += "<div class=\"first\">\n<div class=\"panel\">";
    page.body += &tables::headline(camera);
    let doubts: String = checks
        .iter()
        .filter(|c| c.level != Level::Good)
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
    if let Some(figure) = figures::headline_bars(camera) {
        page.figure(&figure);
    }
    page.body += "</div>\n";
    page.close();
}

/// The first screen of a diagnosis: questions with answers, and the steps.
fn diagnosis_screen(
    page: &mut Content,
    camera: &ReportCamera<'_>,
    d: &ReportDiagnosis<'_>,
    coverage: &[String],
    summary: &Summary,
    story: &[String],
) {
    open_verdict(page, camera, summary, "where", story);
    let row = |a: &diagnosis::Answer| {
        let (more, answer) = (page.id(a.more), tie(&escape(&a.answer)));
        format!("<div><dt><a href=\"#{more}\">{}</a></dt><dd>{answer}</dd></div>\n", a.question)
    };
    let rows: String = diagnosis::answers(camera, d, coverage).iter().map(row).collect();
    page.body += &format!("<div class=\"first\">\n<div class=\"panel\"><dl class=\"answers\">{rows}</dl></div>\n");
    let list: Vec<Figure> = figures::stage_bars(camera, d).into_iter().chain(figures::step_gains(d)).collect();
    page.grid(&list, "stack");
    page.body += "</div>\n";
    page.close();
    page.open("steps", ["Steps", "What was added, and what it brought"], "");
    page.body += &diagnosis::steps(d);
    page.body += &format!("<div class=\"panel\">{}</div>\n", tables::headline(camera));
    page.close();
}

/// Errors under the declared and under the last model, as maps.
fn left_by_model(
    page: &mut Content,
    camera: &ReportCamera<'_>,
    d: &ReportDiagnosis<'_>,
    image: &Image,
    leftover: Option<&Leftover>,
) {
    let mut intro: Vec<String> =
        d.record.left_over.iter().map(|s| format!("Left: {}.", escape(&left_over(s)))).collect();
    intro.extend(leftover.map(|l| escape(&l.sentence())));
    page.open("where", ["What is left", "Where was it wrong, and what is left?"], &intro.join(" "));
    page.grid(&figures::image_maps_by_model(camera, d, image), "three");
    let mut over = figures::board_maps_by_model(camera, d);
    over.extend(figures::reprojection_field(camera, image));
    page.grid(&over, if over.len() == 3 { "three" } else { "two" });
    if let Some(l) = leftover {
        page.body += &leftover_table(l);
    }
    page.close();
}

/// Errors under both models against what they may depend on.
fn trends_by_model(page: &mut Content, camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>, image: &Image) {
    let taken = figures::Taken::of(camera, d);
    let list: Vec<Figure> =
        all(camera, image).par_iter().filter_map(|c| figures::model_curve(camera, d, taken.as_ref(), c)).collect();
    if !list.is_empty() {
        let intro = "Points: mean over the frames of each frame's median error in the bin; whiskers: its 95 % interval. Dotted: \
                     change of the error from the declared to the last model. Where the added effects are the cause, the \
                     dotted line runs through the points of the declared model.";
        page.open("against", ["Trends", "What does the error depend on, and do the added effects explain it?"], intro);
        page.grid(&list, "two fill");
        page.close();
    }
}

/// Frames that were excluded.
fn excluded(page: &mut Content, camera: &ReportCamera<'_>, d: &ReportDiagnosis<'_>) {
    page.open("outliers", ["Excluded frames", "Frames that were excluded"], "");
    page.body += &diagnosis::frames(d);
    page.grid(&figures::frames_by_model(camera, d).into_iter().collect::<Vec<_>>(), "one");
    page.close();
}

/// Candidates, and which of them these captures can separate.
fn tested(page: &mut Content, d: &ReportDiagnosis<'_>) {
    let intro = "Each effect of the catalogue, and free functions of one quantity each, tested jointly with the model from one \
                 linearisation, without a new fit.";
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
        page.open("apart", ["Separability", "Which effects these captures cannot separate"], "");
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

fn trust(page: &mut Content, checks: &[Check]) {
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

fn left(page: &mut Content, camera: &ReportCamera<'_>, image: &Image, leftover: Option<&Leftover>) {
    let maps = figures::image_maps(camera, image);
    let field = figures::reprojection_field(camera, image);
    if maps.is_empty() && field.is_none() {
        return;
    }
    let intro = leftover.map_or(String::new(), |l| escape(&l.sentence()));
    page.open("where", ["What is left", "Where was it wrong, and what is left?"], &intro);
    page.grid(&maps, "three");
    if let Some(l) = leftover {
        page.body += &leftover_table(l);
    }
    let image_figures: Vec<Figure> = [field, figures::board_map(camera)].into_iter().flatten().collect();
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
                escape(&f.over.to_string()),
                number(f.structure.size_mm),
                number(f.structure.hidden_mm),
                escape(&p_value(f.structure.p_value)),
                escape(&f.worst)
            )
        })
        .collect();
    let whose = if l.with_fitted { "fitted ones among them" } else { "all of them held out" };
    format!(
        "<details><summary>The tests behind this sentence</summary><div class=\"scroll\" tabindex=\"0\"><table>\
         <caption>Systematic part of the corrected depth error, over {} ({whose}). Size: rms of a smooth function over the \
         bins, less what chance gives. Detection limit: 95 % of chance patterns are smaller. p: probability of such a pattern \
         if each frame's errors had a random sign; found where below {:.4}, which makes a false alarm of any of the {} tests \
         5 % likely.</caption><thead><tr><th scope=\"col\">over</th><th scope=\"col\">size / mm</th><th \
         scope=\"col\">detection limit / mm</th><th scope=\"col\">p</th><th scope=\"col\" class=\"text\">verdict</th><th \
         scope=\"col\" class=\"text\">largest</th></tr></thead>\
         <tbody>{rows}</tbody></table></div></details>\n",
        count(l.frames, "frame"),
        0.05 / l.findings.len().max(1) as f64,
        l.findings.len()
    )
}

fn single_frames(page: &mut Content, list: Vec<Figure>) {
    if list.is_empty() {
        return;
    }
    let intro = "Choose a frame from the list, or step through them with ‹ and › or the arrow keys.";
    page.open("frames", ["Frames", "Frame by frame"], intro);
    page.picker("frame-picker", "Frame", &list, 0);
    page.grid(&list, if list.len() == 3 { "three" } else { "two" });
    page.close();
}

fn against(page: &mut Content, camera: &ReportCamera<'_>, image: &Image) {
    let mut list = figures::curves(camera, &all(camera, image));
    let with_depth = !list.is_empty();
    list.extend(figures::image_trend(camera, image));
    if list.is_empty() {
        return;
    }
    let intro = if with_depth {
        format!(
            "Points: mean over {} of each frame's median error in the bin; whiskers: its 95 % interval. Small dots: single \
             pixels. Under a complete model the blue points agree with zero within their whiskers.",
            count(tested_frames(camera).frame_count(), "frame")
        )
    } else {
        String::new()
    };
    page.open("against", ["Trends", "What does the error depend on?"], &intro);
    page.grid(&list, "two fill");
    page.close();
}

fn pictures(page: &mut Content, camera: &ReportCamera<'_>) {
    let shown = pictures::pictures(camera);
    let histogram = figures::residual_histogram(camera);
    if shown.is_none() && histogram.is_none() {
        return;
    }
    let (html, intro) = shown.unwrap_or_default();
    page.open("pictures", ["Pictures", "Markers in the worst frames"], &intro);
    page.body += &html;
    page.grid(&histogram.into_iter().collect::<Vec<_>>(), "two fill");
    page.close();
}

fn per_frame(page: &mut Content, camera: &ReportCamera<'_>) {
    let list: Vec<Figure> =
        camera.evaluations.iter().enumerate().filter_map(|(i, d)| figures::per_frame(d, i)).collect();
    let datasets = figures::by_dataset(camera);
    if list.is_empty() && datasets.is_empty() && camera.evaluations.is_empty() {
        return;
    }
    page.open("datasets", ["Datasets", "Errors of every dataset and frame"], "");
    page.body += &tables::datasets(camera);
    page.body += &camera.evaluations.iter().map(tables::frames).collect::<String>();
    page.grid(&datasets, "two");
    page.grid(&list, "one");
    page.close();
}

fn volume(page: &mut Content, camera: &ReportCamera<'_>, image: &Image) {
    let list: Vec<Figure> =
        [figures::poses(camera), figures::coverage(camera, image), figures::distance_and_tilt(camera)]
            .into_iter()
            .flatten()
            .collect();
    if list.is_empty() {
        return;
    }
    page.open("volume", ["Volume", "The measured volume"], "");
    page.grid(&list, "two fill");
    page.close();
}

fn parameters(page: &mut Content, camera: &ReportCamera<'_>) {
    let Some(c) = camera.calibrated else { return };
    if let Some(u) = Uncertainty::of(c) {
        let has_held_out = camera.evaluations.iter().any(|d| d.role != Role::Fitted);
        let intro = if has_held_out {
            "Standard deviation of corrected depth, propagated from the covariance of the parameters. It assumes that the \
             model is complete: any systematic error that is left (above) comes on top of it."
        } else {
            "Standard deviation of corrected depth, propagated from the covariance of the parameters. It assumes that the \
             model is complete."
        };
        page.open("uncertainty", ["Uncertainty", "How certain is corrected depth?"], intro);
        let map = [figures::uncertainty_map(c, &u)];
        page.picker("distance-picker", "Distance", &map, 1);
        let [map] = map;
        let list = [Some(figures::uncertainty_curves(c, &u)), Some(map), figures::projection_uncertainty(c)];
        page.grid(&list.into_iter().flatten().collect::<Vec<_>>(), "two fill");
        page.close();
    } else if let Some(figure) = figures::projection_uncertainty(c) {
        let intro = "Propagated from the covariance of the parameters, as if the model were complete.";
        page.open("uncertainty", ["Uncertainty", "How certain is the projection?"], intro);
        page.grid(&[figure], "two");
        page.close();
    }
    page.open("parameters", ["Parameters", "The camera"], "");
    page.body += &tables::parameters(c);
    for confounded in c.camera.blocks().iter().filter_map(|block| block.piece()?.confounded()) {
        page.body += &format!("<p class=\"note\">{}</p>\n", escape(confounded));
    }
    page.body += &tables::fit(c);
    let list: Vec<Figure> = [figures::noise(camera), figures::correlation(c)].into_iter().flatten().collect();
    page.grid(&list, "two");
    page.close();
}

/// Definitions of the numbers.
pub(super) fn reading(page: &mut Content) {
    page.open("reading", ["Definitions", "How the numbers are defined"], "");
    page.body += include_str!("reading.html");
    page.close();
}
