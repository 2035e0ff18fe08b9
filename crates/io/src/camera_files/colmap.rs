//! COLMAP's cameras.txt: a line `CAMERA_ID MODEL WIDTH HEIGHT PARAMS…` per camera.
//!
//! Written are `OPENCV`, `FULL_OPENCV` and `OPENCV_FISHEYE`; read are also `SIMPLE_PINHOLE`, `PINHOLE`, `SIMPLE_RADIAL`,
//! `RADIAL`, `SIMPLE_RADIAL_FISHEYE` and `RADIAL_FISHEYE`. COLMAP has the centre of the first pixel at (0.5, 0.5), which is
//! converted.

use std::path::Path;

use super::capability::{HeldLens, nearest};
use super::error::CameraFileError;
use super::export_camera::ExportCamera;
use super::intrinsics::{FileLens, Intrinsics, size_px};
use super::outcome::Export;
use super::text::number;

const FORMAT: &str = "COLMAP";
const HELD: [HeldLens; 3] = [
    HeldLens { name: "OPENCV", piece: "brown_conrady", count: 4 },
    HeldLens { name: "FULL_OPENCV", piece: "opencv_lens", count: 8 },
    HeldLens { name: "OPENCV_FISHEYE", piece: "kannala_brandt", count: 4 },
];
/// Position of the first pixel's centre, px.
const FIRST_PIXEL: f64 = 0.5;

/// The lines of cameras: their IDs and the words after these.
pub(super) fn cameras(text: &str) -> Vec<(&str, Vec<&str>)> {
    text.lines()
        .filter(|line| !line.trim_start().starts_with('#'))
        .filter_map(|l| {
            let mut words = l.split_whitespace();
            Some((words.next()?, words.collect()))
        })
        .collect()
}

/// Whether a text is of this format: every line begins with a number and a model in capitals.
pub(super) fn is_one(text: &str) -> bool {
    let lines = cameras(text);
    let is_camera = |(id, words): &(&str, Vec<&str>)| {
        let model = words.first().unwrap_or(&"");
        id.parse::<u64>().is_ok() && !model.is_empty() && model.chars().all(|c| c.is_ascii_uppercase() || c == '_')
    };
    !lines.is_empty() && lines.iter().all(is_camera)
}

pub(super) fn read(path: &Path, id: &str, words: &[&str]) -> Result<Intrinsics, CameraFileError> {
    let fault = |field: &str, problem: String| CameraFileError::Field {
        path: path.to_owned(),
        field: format!("camera {id}: {field}"),
        problem,
    };
    let [model, width, height, values @ ..] = words else {
        return Err(fault("line", "is too short, expected MODEL WIDTH HEIGHT PARAMS".to_owned()));
    };
    let px = |name: &str, text: &str| {
        text.parse::<u32>().map(f64::from).map_err(|_| fault(name, format!("is '{text}', expected px")))
    };
    let (w, h) = (px("WIDTH", width)?, px("HEIGHT", height)?);
    let size =
        size_px(w, h).ok_or_else(|| fault("WIDTH", format!("{w} and HEIGHT {h} are no size of an image in px")))?;
    let parsed: Option<Vec<f64>> = values.iter().map(|v| v.parse().ok().filter(|v: &f64| v.is_finite())).collect();
    let p = parsed.ok_or_else(|| fault("PARAMS", "are not all finite numbers".to_owned()))?;
    // Number of parameters, whether there is one focal length, the lens.
    let (expected, is_simple) = match *model {
        "SIMPLE_PINHOLE" => (3, true),
        "PINHOLE" => (4, false),
        "SIMPLE_RADIAL" | "SIMPLE_RADIAL_FISHEYE" => (4, true),
        "RADIAL" | "RADIAL_FISHEYE" => (5, true),
        "OPENCV" | "OPENCV_FISHEYE" => (8, false),
        "FULL_OPENCV" => (12, false),
        _ => {
            let known = "SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE and \
                         OPENCV_FISHEYE";
            return Err(CameraFileError::Model { path: path.to_owned(), model: (*model).to_owned(), known });
        }
    };
    if p.len() != expected {
        return Err(fault("PARAMS", format!("are {} numbers, expected {expected} for {model}", p.len())));
    }
    let (fx, fy, others) = if is_simple { (p[0], p[0], &p[1..]) } else { (p[0], p[1], &p[2..]) };
    let (cx, cy, k) = (others[0] - FIRST_PIXEL, others[1] - FIRST_PIXEL, &others[2..]);
    if !(fx > 0.0 && fy > 0.0) {
        return Err(fault("PARAMS", format!("have the focal lengths {fx} and {fy}, expected positive ones")));
    }
    let lens = match (*model, k) {
        (_, []) => None,
        ("SIMPLE_RADIAL" | "RADIAL", _) => Some(FileLens { piece: "brown_conrady", values: k.to_vec() }),
        ("OPENCV" | "FULL_OPENCV", _) => FileLens::opencv(k),
        _ => Some(FileLens { piece: "kannala_brandt", values: k.to_vec() }),
    };
    Ok(Intrinsics { size: Some(size), pinhole: [fx, fy, cx, cy, 0.0], lens })
}

pub(super) fn write(camera: &ExportCamera) -> Export {
    let mut written = nearest(&camera.camera, FORMAT, &HELD);
    let [fx, fy, cx, cy] = written.pinhole;
    let mut values = vec![fx, fy, cx + FIRST_PIXEL, cy + FIRST_PIXEL];
    values.extend(&written.values);
    let values: Vec<String> = values.into_iter().map(number).collect();
    let text = format!(
        "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n# Number of cameras: 1\n\
         1 {} {} {} {}\n",
        written.lens.name,
        camera.camera.width,
        camera.camera.height,
        values.join(" ")
    );
    written.warnings.extend(camera.depth_loss(FORMAT));
    Export { text, warnings: written.warnings }
}
