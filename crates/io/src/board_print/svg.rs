//! The page as SVG.

use std::fmt::Write;

use super::page::BoardPage;

/// The page as an SVG whose user unit is 1 mm.
pub fn board_svg(page: &BoardPage) -> String {
    let [w, h] = page.size_mm;
    let mut svg = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}mm\" height=\"{h}mm\" \
         viewBox=\"0 0 {w} {h}\">\n<rect width=\"{w}\" height=\"{h}\" fill=\"white\"/>\n"
    );
    // One path, so that no light shows between neighbouring cells. Writing to a string cannot fail.
    let path = |rectangles: &[[f64; 4]]| {
        let mut path = String::new();
        for [x, y, w, h] in rectangles {
            let _ = write!(path, "M{} {}h{}v{}h-{}z", short(*x), short(*y), short(*w), short(*h), short(*w));
        }
        path
    };
    for (name, rectangles) in [("board", &page.black), ("ruler", &page.ruler)] {
        if !rectangles.is_empty() {
            let _ = writeln!(svg, "<path id=\"{name}\" d=\"{}\"/>", path(rectangles));
        }
    }
    for [x, y, diameter] in &page.dots {
        let _ = writeln!(svg, "<circle cx=\"{}\" cy=\"{}\" r=\"{}\"/>", short(*x), short(*y), short(diameter / 2.0));
    }
    for text in &page.text {
        let [x, y] = text.at;
        let escaped = text.text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;");
        let size = short(page.font_size(text));
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"{size}\">{escaped}</text>",
            short(x),
            short(y)
        );
    }
    svg.push_str("</svg>\n");
    svg
}

/// A number of at most six decimals: a nanometre.
fn short(number: f64) -> String {
    let text = format!("{number:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
