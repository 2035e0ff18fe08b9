//! The page of a comparison of depth models.

use std::fmt::Write;

use depthcal_io::Comparison;

use super::html::{escape, fixed};
use super::{ReportError, page};
use crate::compare::tables::Table;

/// Renders a comparison as one self-contained HTML file.
///
/// # Errors
///
/// [`ReportError::Nothing`] where no model was compared.
pub fn render_comparison(c: &Comparison, tables: &[Table], command: &str) -> Result<String, ReportError> {
    if c.models.is_empty() {
        return Err(ReportError::Nothing);
    }
    let mut body = String::from("<section id=\"models\"><h2>Which model</h2>\n");
    for sentence in &c.verdict {
        let _ = writeln!(body, "<p>{}</p>", escape(sentence));
    }
    body += "<table><thead><tr><th>model</th><th>effective parameters</th><th>dot error, mm</th><th>plane error, mm</th>\
             <th>depth rms, mm</th><th>worse than the best by, mm</th></tr></thead><tbody>\n";
    for m in c.models.iter().filter(|m| m.failed.is_none()) {
        let held = &m.held_out;
        let cells = [held.dot_error_mm, held.plane_error_mm, held.depth_rms_mm, m.worse_than_best_mm].map(|value| {
            value.map_or_else(
                || "–".to_owned(),
                |i| format!("{} ({} to {})", fixed(i.mean, 2), fixed(i.low, 2), fixed(i.high, 2)),
            )
        });
        let _ = writeln!(
            body,
            "<tr><th scope=\"row\"><code>{}</code></th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&m.model),
            fixed(m.effective_parameters, 1),
            cells[0],
            cells[1],
            cells[2],
            cells[3]
        );
    }
    body += "</tbody></table></section>\n";
    for (i, table) in tables.iter().enumerate().skip(1) {
        let (title, text) = (escape(&table.title), escape(&table.text));
        let _ = writeln!(body, "<section id=\"table{i}\"><h2>{title}</h2><pre>{text}</pre></section>");
    }
    page::shell(&format!("Depth models on {}", c.train), command, "", &body, &[])
}
