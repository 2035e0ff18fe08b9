//! OpenCV's FileStorage: YAML 1.0, XML and JSON.
//!
//! | key | contents |
//! |---|---|
//! | `image_width`, `image_height` | px |
//! | `camera_matrix` | 3×3: fx, 0, cx; 0, fy, cy; 0, 0, 1 |
//! | `distortion_coefficients` | 5, 8, 12 or 14×1, or 4×1 for a fisheye lens |
//! | `fisheye_model` | 1 for a fisheye lens, as OpenCV's calibration sample writes it |
//! | `depth_pieces` | depthcal's own, where there are any |
//!
//! The pieces are sequences of name, options (a sequence of name and value) and parameters (a sequence of name, unit and value).
//! OpenCV's functions ignore them; XML and JSON are written without them. Such files are read by `matrix`, with the keys that
//! scripts use as well.

use std::fmt::Write as _;

use super::capability::{HeldLens, nearest};
use super::export_camera::ExportCamera;
use super::outcome::{Export, ExportWarning};
use super::text::{list, number, quoted};
use crate::record::PieceRecord;

const FORMAT: &str = "OpenCV";
const FISHEYE: HeldLens = HeldLens { name: "fisheye lens", piece: "kannala_brandt", count: 4 };
/// Lens models that OpenCV holds, the simplest first.
const HELD: [HeldLens; 5] = [
    HeldLens { name: "lens of 5 coefficients", piece: "brown_conrady", count: 5 },
    HeldLens { name: "lens of 8 coefficients", piece: "opencv_lens", count: 8 },
    HeldLens { name: "lens of 12 coefficients", piece: "opencv_lens", count: 12 },
    HeldLens { name: "lens of 14 coefficients", piece: "opencv_lens", count: 14 },
    FISHEYE,
];
pub(super) fn write(camera: &ExportCamera) -> Export {
    let written = nearest(&camera.camera, FORMAT, &HELD);
    let [fx, fy, cx, cy] = written.pinhole;
    let (width, height) = (camera.camera.width, camera.camera.height);
    let mut text = format!("%YAML:1.0\n---\nimage_width: {width}\nimage_height: {height}\n");
    if written.lens == FISHEYE {
        text += "fisheye_model: 1\n";
    }
    text += &matrix("camera_matrix", 3, 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]);
    text += &matrix("distortion_coefficients", written.values.len(), 1, &written.values);
    text += &pieces("depth_pieces", &camera.depth);
    Export { text, warnings: written.warnings }
}

fn matrix(key: &str, rows: usize, columns: usize, data: &[f64]) -> String {
    let data = list(data);
    format!("{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: {data}\n")
}

fn pieces(key: &str, pieces: &[PieceRecord]) -> String {
    if pieces.is_empty() {
        return String::new();
    }
    let mut text = format!("{key}:\n");
    for piece in pieces {
        // Writing to a string cannot fail.
        let _ = write!(text, "   -\n      name: {}\n", quoted(&piece.name));
        if !piece.options.is_empty() {
            text += "      options:\n";
            for (name, value) in &piece.options {
                let _ = writeln!(text, "         - {{ name: {}, value: {} }}", quoted(name), number(*value));
            }
        }
        text += "      parameters:\n";
        for parameter in &piece.parameters {
            let (name, unit) = (quoted(&parameter.name), quoted(&parameter.unit));
            let value = number(parameter.value);
            let _ = writeln!(text, "         - {{ name: {name}, unit: {unit}, value: {value} }}");
        }
    }
    text
}

/// Writes XML, without a depth model.
pub(super) fn write_xml(camera: &ExportCamera) -> Export {
    let field = |name: &str, value: String| format!("<{name}>{value}</{name}>\n");
    let matrix = |name: &str, [rows, cols]: [usize; 2], data: &[f64]| {
        let data = data.iter().map(|value| number(*value)).collect::<Vec<_>>().join(" ");
        format!(
            "<{name} type_id=\"opencv-matrix\">\n  <rows>{rows}</rows>\n  <cols>{cols}</cols>\n  <dt>d</dt>\n  <data>{data}</data></{name}>\n"
        )
    };
    let (fields, warnings) = fields(camera, field, matrix);
    Export {
        text: format!("<?xml version=\"1.0\"?>\n<opencv_storage>\n{}</opencv_storage>\n", fields.concat()),
        warnings,
    }
}

/// Writes JSON, without a depth model.
pub(super) fn write_json(camera: &ExportCamera) -> Export {
    let field = |name: &str, value: String| format!("  \"{name}\": {value}");
    let matrix = |name: &str, [rows, cols]: [usize; 2], data: &[f64]| {
        let data = list(data);
        format!(
            "  \"{name}\": {{ \"type_id\": \"opencv-matrix\", \"rows\": {rows}, \"cols\": {cols}, \"dt\": \"d\", \"data\": {data} }}"
        )
    };
    let (fields, warnings) = fields(camera, field, matrix);
    Export { text: format!("{{\n{}\n}}\n", fields.join(",\n")), warnings }
}

/// The fields of a file, with the warnings of what it does not hold.
fn fields(
    camera: &ExportCamera,
    field: impl Fn(&str, String) -> String,
    matrix: impl Fn(&str, [usize; 2], &[f64]) -> String,
) -> (Vec<String>, Vec<ExportWarning>) {
    let mut written = nearest(&camera.camera, FORMAT, &HELD);
    let [fx, fy, cx, cy] = written.pinhole;
    let mut fields = vec![
        field("image_width", camera.camera.width.to_string()),
        field("image_height", camera.camera.height.to_string()),
        matrix("camera_matrix", [3, 3], &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        matrix("distortion_coefficients", [written.values.len(), 1], &written.values),
    ];
    if written.lens == FISHEYE {
        fields.push(field("fisheye_model", "1".to_owned()));
    }
    written.warnings.extend(camera.depth_loss(FORMAT));
    (fields, written.warnings)
}
