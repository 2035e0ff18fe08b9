//! The page: template, style sheet, scripts and content put together.

use serde_json::Value;

use super::content::Content;
use super::html::{escape, script_json};
use super::input::ReportError;

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// The script of plotly.js that the plotting library carries; its formula renderer, two megabytes more, is not needed.
fn library() -> Option<String> {
    let sources = plotly::Plot::offline_js_sources();
    let (first, _) = sources.split_once("</script>")?;
    let (_, script) = first.split_once('>')?;
    (!script.trim().is_empty()).then(|| script.to_owned())
}

/// The whole file: the template filled with a title, how the page was made (HTML), and content.
pub(super) fn render(title: &str, made: &str, content: &Content) -> Result<String, ReportError> {
    let library = library().ok_or(ReportError::NoScript)?;
    let title = if title.trim().is_empty() { "Calibration report" } else { title.trim() };
    let figures = script_json(&Value::Array(content.figures.clone()));
    let escaped = escape(title);
    // One pass over the template, so that nothing inside the content can be taken for a placeholder.
    let fill = |name: &str| -> &str {
        match name {
            "title" => &escaped,
            "style" => STYLE,
            "made" => made,
            "navigation" => &content.navigation,
            "body" => &content.body,
            "library" => &library,
            "figures" => &figures,
            "script" => SCRIPT,
            "version" => env!("CARGO_PKG_VERSION"),
            _ => "",
        }
    };
    let mut out = String::with_capacity(library.len() + figures.len() + content.body.len() + 64_000);
    let mut unfilled = TEMPLATE;
    while let Some((before, after)) = unfilled.split_once("{{") {
        out.push_str(before);
        let (name, after) = after.split_once("}}").unwrap_or((after, ""));
        out.push_str(fill(name.trim()));
        unfilled = after;
    }
    out.push_str(unfilled);
    Ok(out)
}
