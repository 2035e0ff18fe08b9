//! Printed boards are what the detector finds: every kind, drawn as SVG and as PDF, rasterised and detected, with every marker
//! where the page says it is.

#[path = "../../../tests/support/python.rs"]
mod python;

use depthcal_detect::{DetectOptions, detect, tag_cells};
use depthcal_io::{BoardPage, GrayImage, board_pdf, board_svg, decode_gray};
use depthcal_model::target::{Pattern, Target};

/// Pixels per millimetre: 101.6 dots per inch.
const SCALE: usize = 4;
/// Samples per pixel and axis of the test's own rasteriser.
const FINE: usize = 4;

fn boards() -> Vec<(Target, &'static str)> {
    let board = |pattern, columns, rows, spacing_mm| Target { pattern, columns, rows, spacing_mm };
    let april = "DICT_APRILTAG_36H11";
    vec![
        (board(Pattern::AsymmetricCircles { circle_diameter_mm: 11.5 }, 4, 11, 17.0), ""),
        (board(Pattern::SymmetricCircles { circle_diameter_mm: 10.0 }, 8, 5, 20.0), ""),
        (board(Pattern::Chessboard, 8, 5, 20.0), ""),
        (board(Pattern::Charuco { marker_mm: 18.0, dictionary: "DICT_5X5_100".into() }, 9, 6, 24.0), "DICT_5X5_100"),
        (board(Pattern::Charuco { marker_mm: 15.0, dictionary: "DICT_4X4_50".into() }, 5, 7, 20.0), "DICT_4X4_50"),
        (board(Pattern::Aprilgrid { marker_mm: 24.0 }, 6, 5, 32.0), april),
    ]
}

fn page(target: &Target, dictionary: &str) -> BoardPage {
    let cells = |id| tag_cells(dictionary, id).map_err(|error| error.to_string());
    BoardPage::new(target, None, &cells).unwrap()
}

/// Numbers of an attribute or a path.
fn numbers(text: &str) -> Vec<f64> {
    let number = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
    text.split(|c| !number(c)).filter(|t| !t.is_empty()).map(|t| t.parse().unwrap()).collect()
}

fn attribute<'a>(line: &'a str, name: &str) -> &'a str {
    let start = line.find(&format!(" {name}=\"")).unwrap() + name.len() + 3;
    &line[start..start + line[start..].find('"').unwrap()]
}

/// Rasterises what the SVG of a board consists of: rectangles in paths, and circles.
fn rasterise(svg: &str, [width, height]: [usize; 2]) -> GrayImage {
    let (w, h) = (width * FINE, height * FINE);
    let fine = (SCALE * FINE) as f64;
    let mut dark = vec![false; w * h];
    let mut paint = |[x0, y0, x1, y1]: [f64; 4], inside: &dyn Fn(f64, f64) -> bool| {
        let range = |low: f64, high: f64, end: usize| {
            ((low * fine).floor().max(0.0) as usize, ((high * fine).ceil() as usize).min(end))
        };
        let ((u0, u1), (v0, v1)) = (range(x0, x1, w), range(y0, y1, h));
        for v in v0..v1 {
            for u in u0..u1 {
                let (x, y) = ((u as f64 + 0.5) / fine, (v as f64 + 0.5) / fine);
                dark[v * w + u] |= x >= x0 && x < x1 && y >= y0 && y < y1 && inside(x, y);
            }
        }
    };
    for line in svg.lines() {
        if line.starts_with("<path") {
            for part in attribute(line, "d").split('z').filter(|part| !part.is_empty()) {
                let [x, y, w, h, _] = numbers(part)[..] else { panic!("{part}") };
                paint([x, y, x + w, y + h], &|_, _| true);
            }
        } else if line.starts_with("<circle") {
            let [x, y, r] = ["cx", "cy", "r"].map(|name| attribute(line, name).parse::<f64>().unwrap());
            paint([x - r, y - r, x + r, y + r], &|px, py| (px - x).hypot(py - y) < r);
        }
    }
    let white = |u: usize, v: usize| {
        let block = (0..FINE * FINE).filter(|i| !dark[(v * FINE + i / FINE) * w + u * FINE + i % FINE]).count();
        (30 + 200 * block / (FINE * FINE)) as u16
    };
    let data = (0..width * height).map(|i| white(i % width, i / width)).collect();
    GrayImage { width, height, data, bits: 8 }
}

/// Every marker is found, within `tolerance` px of where the page has it.
fn check(image: &GrayImage, target: &Target, page: &BoardPage, tolerance: f64, what: &str) {
    let detection = detect(image, target, &DetectOptions::default()).unwrap();
    let detection = detection.unwrap_or_else(|| panic!("{what}: {:?} was not found", target.pattern));
    assert_eq!(detection.markers.len(), target.len(), "{what}: {:?}", target.pattern);
    for marker in &detection.markers {
        let point = target.point(marker.index);
        // Pixel centres at integers: the edge of the page lies at −½.
        let expected = [0, 1].map(|axis| (point[axis] + page.origin_mm[axis]) * SCALE as f64 - 0.5);
        let error = (marker.pixel[0] - expected[0]).hypot(marker.pixel[1] - expected[1]);
        assert!(error < tolerance, "{what}: {:?}, marker {}: {error:.3} px off", target.pattern, marker.index);
    }
}

#[test]
fn every_kind_as_svg() {
    for (target, dictionary) in boards() {
        let page = page(&target, dictionary);
        let size = page.size_mm.map(|side| side as usize * SCALE);
        let image = rasterise(&board_svg(&page), size);
        // Edges of this rasteriser are on a grid of 1/4 px, corners of tags without refinement to 0.1 px beyond that.
        check(&image, &target, &page, 0.3, "SVG");
    }
}

/// MuPDF is the oracle of the PDF: it rasterises the page at 101.6 dots per inch.
#[test]
fn every_kind_as_pdf() {
    let Some(python) = python::with_modules(&["pymupdf"]) else { return };
    let folder = python::folder("printed_boards");
    for (number, (target, dictionary)) in boards().into_iter().enumerate() {
        let page = page(&target, dictionary);
        let (pdf, png) = (folder.join(format!("{number}.pdf")), folder.join(format!("{number}.png")));
        std::fs::write(&pdf, board_pdf(&page)).unwrap();
        let code = "import sys, pymupdf; p = pymupdf.open(sys.argv[1])[0]; print(p.rect.width, p.rect.height); print(p.get_text()); \
                    p.get_pixmap(matrix=pymupdf.Matrix(4 * 25.4 / 72, 4 * 25.4 / 72), alpha=False).save(sys.argv[2])";
        let said = python.run(code, &[&pdf, &png]);
        // The page has its size in points, and the ruler's text.
        let size = numbers(said.split('\n').next().unwrap());
        assert!((size[0] - page.size_mm[0] * 72.0 / 25.4).abs() < 0.01, "{said}");
        assert!(said.contains("100 mm from the middle") && said.contains("spacing_mm"), "{said}");
        let image = decode_gray(&png, &std::fs::read(&png).unwrap()).unwrap();
        check(&image, &target, &page, 0.3, "PDF");
    }
}
