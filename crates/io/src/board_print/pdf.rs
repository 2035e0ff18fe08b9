//! The page as PDF, by the `pdf-writer` crate.

use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref, Str, TextStr};

use super::page::{BoardPage, Rectangle};

/// Points per millimetre: 72 to an inch.
const POINTS: f64 = 72.0 / 25.4;
/// Distance of the control points of a quarter circle from its ends, in radii, which is off by 0.02 % of the radius at most.
const QUARTER: f64 = 0.551_784_777_7;

/// The bytes of a PDF with the page, in its true size.
pub fn board_pdf(page: &BoardPage) -> Vec<u8> {
    let [catalog, pages, sheet, font, contents, info] = [1, 2, 3, 4, 5, 6].map(Ref::new);
    let font_name = Name(b"F1");
    let [width, height] = page.size_mm;
    let mut pdf = Pdf::new();
    let mut of_catalog = pdf.catalog(catalog);
    of_catalog.pages(pages);
    // Asks printing programs not to scale the page.
    of_catalog.viewer_preferences().insert(Name(b"PrintScaling")).primitive(Name(b"None"));
    of_catalog.finish();
    pdf.document_info(info).title(TextStr("Calibration board")).producer(TextStr("depthcal"));
    pdf.pages(pages).kids([sheet]).count(1);
    let mut of_page = pdf.page(sheet);
    of_page.media_box(Rect::new(0.0, 0.0, (width * POINTS) as f32, (height * POINTS) as f32));
    of_page.parent(pages);
    of_page.contents(contents);
    of_page.resources().fonts().pair(font_name, font);
    of_page.finish();
    pdf.type1_font(font).base_font(Name(b"Helvetica"));

    let mut content = Content::new();
    // Millimetres from the top left corner from here on; numbers keep four decimals of them.
    content.transform([POINTS as f32, 0.0, 0.0, -POINTS as f32, 0.0, (height * POINTS) as f32]);
    content.set_fill_gray(0.0);
    // All rectangles in one path, so that no light shows between neighbouring cells.
    let fill = |content: &mut Content, rectangles: &[Rectangle]| {
        for rectangle in rectangles {
            let [x, y, w, h] = rectangle.map(|v| v as f32);
            content.rect(x, y, w, h);
        }
        if !rectangles.is_empty() {
            content.fill_nonzero();
        }
    };
    fill(&mut content, &page.black);
    fill(&mut content, &page.ruler);
    for [x, y, diameter] in &page.dots {
        circle(&mut content, [*x, *y], diameter / 2.0);
        content.fill_nonzero();
    }
    for text in &page.text {
        let [x, y] = text.at.map(|v| v as f32);
        content.begin_text();
        content.set_font(font_name, page.font_size(text) as f32);
        // Letters stand upright although y points down.
        content.set_text_matrix([1.0, 0.0, 0.0, -1.0, x, y]);
        // The standard encoding has ASCII; nothing else is written.
        let ascii: Vec<u8> = text.text.bytes().map(|byte| if byte.is_ascii() { byte } else { b'?' }).collect();
        content.show(Str(&ascii));
        content.end_text();
    }
    pdf.stream(contents, &content.finish());
    pdf.finish()
}

/// A circle of four cubic Bézier curves.
fn circle(content: &mut Content, [x, y]: [f64; 2], r: f64) {
    let point = |dx: f64, dy: f64| [(x + r * dx) as f32, (y + r * dy) as f32];
    let [sx, sy] = point(1.0, 0.0);
    content.move_to(sx, sy);
    let ends = [(0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0)];
    let mut from = (1.0, 0.0);
    for to in ends {
        let first = point(from.0 + QUARTER * to.0, from.1 + QUARTER * to.1);
        let second = point(to.0 + QUARTER * from.0, to.1 + QUARTER * from.1);
        let [ex, ey] = point(to.0, to.1);
        content.cubic_to(first[0], first[1], second[0], second[1], ex, ey);
        from = to;
    }
    content.close_path();
}
