//! Camera files of other programs.

use std::path::Path;

use depthcal_io::camera_files::parse_camera;
use depthcal_io::{CameraFormat, ExportCamera};
use depthcal_model::{Block, Register};

/// Reads a camera, and writes it in the formats that hold its lens; what is written reads the same.
pub fn camera_file(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let path = Path::new("camera");
    let named = |name| parse_camera(path, text, name);
    let read = named(None).or_else(|_| named(Some("cam0"))).or_else(|_| named(Some("depth-640x576")));
    let Ok(read) = read else { return };
    let camera = read.camera([64, 48], &Register::builtin()).expect("lenses of files are pieces");
    let camera = ExportCamera { camera, depth: Vec::new() };
    // Lenses that a format does not hold are fitted, which is slow: one format for each text, in turn.
    let format = CameraFormat::ALL[text.len() % CameraFormat::ALL.len()];
    let Ok(export) = camera.export(format) else { return };
    let again = parse_camera(path, &export.text, None).expect("a camera that was written is read");
    let again = again.camera([64, 48], &Register::builtin()).expect("lenses of files are pieces");
    assert_eq!((again.width, again.height), (camera.camera.width, camera.camera.height));
    if export.warnings.is_empty() && !matches!(format, CameraFormat::Colmap | CameraFormat::Nerf) {
        // The principal points of these are half a pixel away, which rounds.
        let pinhole = |camera: &depthcal_model::Camera| -> Vec<f64> {
            let theta = |block: &Block| block.theta.clone();
            camera.blocks().iter().filter(|block| block.name() == "pinhole").flat_map(theta).collect()
        };
        assert_eq!(pinhole(&again)[..4], pinhole(&camera.camera)[..4], "{format:?}");
    }
}
