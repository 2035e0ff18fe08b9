//! `ost.ini` and `ost.txt` of ROS' cameracalibrator (oST, Videre's format), as `camera_calibration_parsers` has them.
//!
//! Sections in brackets, `[image]` and one of each camera, such as `[narrow_stereo/left]`; in them lines with a name, and its
//! numbers on the lines below: `width`, `height`; `camera matrix`, `distortion` (k1 k2 p1 p2 k3, or OpenCV's eight),
//! `rectification`, `projection`.

use yaml_rust2::Yaml;
use yaml_rust2::yaml::Hash;

use super::capability::{HeldLens, nearest};
use super::export_camera::ExportCamera;
use super::outcome::Export;
use super::text::number;

const FORMAT: &str = "ost.ini";
const HELD: [HeldLens; 2] = [
    HeldLens { name: "lens of 5 coefficients", piece: "brown_conrady", count: 5 },
    HeldLens { name: "lens of 8 coefficients", piece: "opencv_lens", count: 8 },
];
const IMAGE: &str = "image";

/// Whether a text is of this format.
pub(super) fn is_one(text: &str) -> bool {
    text.lines().any(|line| line.trim() == "camera matrix") && text.lines().any(|line| line.trim().starts_with('['))
}

/// A mapping of a mapping for each camera, with the size of the image in it.
pub(super) fn parse(text: &str) -> Yaml {
    let (mut image, mut cameras) = (Hash::new(), Vec::<(String, Hash)>::new());
    let (mut section, mut key) = (String::new(), String::new());
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with(['#', ';'])) {
        if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
            section = name.to_owned();
            if name != IMAGE {
                cameras.push((section.clone(), Hash::new()));
            }
            continue;
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.iter().any(|word| word.parse::<f64>().is_err()) {
            key = line.to_owned();
            continue;
        }
        let numbers = words.into_iter().map(|word| Yaml::Real(word.to_owned()));
        let Some(fields) =
            (if section == IMAGE { Some(&mut image) } else { cameras.last_mut().map(|camera| &mut camera.1) })
        else {
            continue;
        };
        let field = fields.entry(Yaml::String(key.clone())).or_insert_with(|| Yaml::Array(Vec::new()));
        if let Yaml::Array(list) = field {
            list.extend(numbers);
        }
    }
    let single = |(key, value): (&Yaml, &Yaml)| Some((key.clone(), value.as_vec()?.first()?.clone()));
    let size: Vec<(Yaml, Yaml)> = image.iter().filter_map(single).collect();
    let camera = |(name, mut fields): (String, Hash)| {
        fields.extend(size.iter().cloned());
        (Yaml::String(name), Yaml::Hash(fields))
    };
    Yaml::Hash(cameras.into_iter().map(camera).collect())
}

pub(super) fn write(camera: &ExportCamera) -> Export {
    let mut written = nearest(&camera.camera, FORMAT, &HELD);
    let [fx, fy, cx, cy] = written.pinhole;
    let rows = |rows: &[&[f64]]| -> String {
        let row = |row: &&[f64]| row.iter().map(|value| number(*value)).collect::<Vec<_>>().join(" ") + "\n";
        rows.iter().map(row).collect()
    };
    let text = format!(
        "# oST version 5.0 parameters\n\n[{IMAGE}]\n\nwidth\n{}\n\nheight\n{}\n\n[depthcal]\n\ncamera matrix\n{}\ndistortion\n{}\n\
         rectification\n{}\nprojection\n{}",
        camera.camera.width,
        camera.camera.height,
        rows(&[&[fx, 0.0, cx], &[0.0, fy, cy], &[0.0, 0.0, 1.0]]),
        rows(&[&written.values]),
        rows(&[&[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0]]),
        rows(&[&[fx, 0.0, cx, 0.0], &[0.0, fy, cy, 0.0], &[0.0, 0.0, 1.0, 0.0]])
    );
    written.warnings.extend(camera.depth_loss(FORMAT));
    Export { text, warnings: written.warnings }
}
