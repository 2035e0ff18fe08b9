//! The page of two calibrations that are compared.

use std::fmt::Write;

use depthcal_io::{CameraDifference, Difference, DifferenceSide, ParameterDifference};

use super::sentences::{difference_sentences, distance, notes};
use crate::content::Content;
use crate::format::{join, measured, number, percent, shown_unit};
use crate::html::{escape, tie};
use crate::input::{Made, ReportError};
use crate::made::made;
use crate::scope::Scope;
use crate::{figures, page};

/// Renders the difference of two calibrations as one self-contained HTML file.
///
/// # Errors
///
/// [`ReportError::Nothing`] without cameras.
pub fn render_difference(d: &Difference, how: &Made) -> Result<String, ReportError> {
    if d.cameras.is_empty() {
        return Err(ReportError::Nothing);
    }
    let mut content = Content::default();
    first_screen(&mut content, d);
    if let [camera] = d.cameras.as_slice() {
        sections(&mut content, d, camera);
    } else {
        for (i, camera) in d.cameras.iter().enumerate() {
            let mut part = Content::within(&Scope::camera(i + 1));
            sections(&mut part, d, camera);
            content = content.followed_by(part.below(&camera.name));
        }
    }
    page::render(&format!("{} and {}", d.first, d.second), &made(how), &content)
}

fn first_screen(content: &mut Content, d: &Difference) {
    let mut sentences = difference_sentences(d).into_iter();
    let first = sentences.next().unwrap_or_default();
    let others: String = sentences.map(|s| format!("<p>{}</p>\n", tie(&escape(&s)))).collect();
    let notes: String = notes(d).into_iter().map(|s| format!("<p>{}</p>\n", escape(&s))).collect();
    content.open_verdict(&tie(&escape(&first)));
    let _ = writeln!(
        content.body,
        "<div class=\"story\">{others}<p>Differences are <code>{}</code> minus <code>{}</code>, each tested at a level of {}.</p>\n\
         {notes}</div>",
        escape(&d.second),
        escape(&d.first),
        percent(100.0 * d.level)
    );
    content.close();
}

fn sections(content: &mut Content, d: &Difference, camera: &CameraDifference) {
    if !camera.depth.is_empty() {
        let intro = "Depth that two pixels of the same reading have after either correction, for a flat wall at right angles. \
                     Beside it, the root mean square that both covariances give for calibrations that differ by noise alone.";
        content.open("depth", ["Depth", "Corrected depth"], intro);
        content.grid(&[figures::difference_by_distance(camera)], "one");
        let maps = figures::depth_difference_maps(camera);
        content.picker("depth-picker", "Distance", &maps, middle(camera));
        content.grid(&maps, "two");
        content.close();
    }
    let intro = "Where the second camera sees the points that the first camera sees in a pixel. Two calibrations have no common \
                 frame: the rotation that maps the rays of the first to those of the second best is removed, in weighted least \
                 squares over the whole image, as mrcal does it at infinity.";
    content.open("projection", ["Projection", "Projection"], intro);
    let maps = figures::projection_maps(camera);
    content.picker("projection-picker", "Distance", &maps, camera.projection.len() / 2);
    content.grid(&maps, "two");
    content.close();
    parameters(content, camera);
    sides(content, d, camera);
}

/// The distance that the maps show first: the clearest of those that both cover.
fn middle(camera: &CameraDifference) -> usize {
    let inside = |mm: f64| camera.covered_by_both_mm().is_none_or(|[near, far]| (near..=far).contains(&mm));
    let order = |i: &usize| {
        let size = &camera.depth[*i].size;
        size.rms / size.expected_rms.unwrap_or(1.0)
    };
    let candidates = (0..camera.depth.len()).filter(|i| inside(camera.depth[*i].distance_mm));
    candidates.max_by(|a, b| order(a).total_cmp(&order(b))).unwrap_or(camera.depth.len() / 2)
}

fn parameters(content: &mut Content, camera: &CameraDifference) {
    if camera.parameters.is_empty() {
        return;
    }
    let intro = "Parameters compensate each other, so that calibrations that agree may have parameters that differ: the sections \
                 above count.";
    content.open("parameters", ["Parameters", "Parameters of both"], intro);
    let mut rows = String::new();
    let held = |p: &&ParameterDifference| p.std_dev.is_none() && p.first == p.second;
    for p in camera.parameters.iter().filter(|p| !held(p)) {
        let difference = p.second - p.first;
        let deviations = p.std_dev.filter(|s| *s > 0.0).map_or_else(|| "–".to_owned(), |s| number(difference / s));
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\"><code>{}</code></th><td>{}</td><td>{}</td><td>{}</td><td>{deviations}</td><td>{}</td></tr>",
            escape(&p.name),
            measured(p.first, p.std_dev).value,
            measured(p.second, p.std_dev).value,
            measured(difference, p.std_dev),
            escape(shown_unit(&p.unit)),
        );
    }
    table(content, &["parameter", "first", "second", "difference", "in standard deviations", "unit"], &rows);
    content.close();
}

fn sides(content: &mut Content, d: &Difference, camera: &CameraDifference) {
    content.open("compared", ["Compared", "The two calibrations"], "");
    let mut rows = String::new();
    for (name, side) in [(&d.first, &camera.first), (&d.second, &camera.second)] {
        let _ = writeln!(rows, "<tr><th scope=\"row\">{}</th>{}</tr>", escape(name), side_cells(side));
    }
    table(content, &["calibration", "pieces", "frames", "distances of the boards", "covariance"], &rows);
    content.close();
}

fn side_cells(side: &DifferenceSide) -> String {
    let pieces = if side.pieces.is_empty() { "pinhole alone".to_owned() } else { join(&side.pieces) };
    let frames = if side.frames == 0 { "–".to_owned() } else { side.frames.to_string() };
    let covered = side
        .covered_mm
        .map_or_else(|| "–".to_owned(), |[near, far]| format!("{} to {}", distance(near), distance(far)));
    let covariance = if side.has_covariance { "yes" } else { "none: taken as exact" };
    format!("<td class=\"text\">{}</td><td>{frames}</td><td>{covered}</td><td>{covariance}</td>", escape(&pieces))
}

fn table(content: &mut Content, head: &[&str], rows: &str) {
    let head = head.iter().map(|h| match *h {
        "pieces" => format!("<th scope=\"col\" class=\"text\">{h}</th>"),
        h => format!("<th scope=\"col\">{h}</th>"),
    });
    let head: String = head.collect();
    let _ = writeln!(
        content.body,
        "<div class=\"scroll\" tabindex=\"0\"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
    );
}
