//! Measured captures, which are not part of the repository: in the folder `DEPTHCAL_DATA`, or else in `../shared/data`
//! next to the workspace. Without them the tests print a line that begins with SKIPPED, and pass.

use std::io::Write as _;
use std::path::PathBuf;

use depthcal_io::{BalProblem, Dataset, check_same_size, read_depth, read_gray};
use depthcal_model::Pattern;

fn data(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("DEPTHCAL_DATA")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")), PathBuf::from);
    let folder = root.join(name);
    if !folder.exists() {
        // Past the test runner, which shows the output of failed tests only.
        let path = folder.display();
        let _ = write!(
            std::io::stderr(),
            "\nSKIPPED: no measured data in {path}; set DEPTHCAL_DATA to the folder of the datasets\n"
        );
    }
    folder.exists().then_some(folder)
}

#[test]
fn kinect2_has_51_pairs() {
    let Some(folder) = data("kinect2") else { return };
    let dataset = Dataset::open(folder).unwrap();
    assert_eq!((dataset.name.as_str(), dataset.frames.len(), dataset.depth_unit_mm), ("kinect2", 51, Some(1.0)));
    assert_eq!(dataset.target.pattern, Pattern::Chessboard);
    for frame in dataset.frames.iter().step_by(10) {
        let (image_path, depth_path) = (frame.image.as_ref().unwrap(), frame.depth.as_ref().unwrap());
        let (image, depth) = (read_gray(image_path).unwrap(), read_depth(depth_path).unwrap());
        check_same_size((image_path, &image), (depth_path, &depth)).unwrap();
        assert_eq!((image.width, image.height, image.bits), (512, 424, 16));
        let median = {
            let mut valid: Vec<_> = depth.data.iter().filter(|value| **value > 0).collect();
            valid.sort();
            *valid[valid.len() / 2]
        };
        assert!((300..5000).contains(&median), "median depth {median} mm");
    }
}

#[test]
fn chessboard_has_13_jpeg_images() {
    let Some(folder) = data("chessboard") else { return };
    let dataset = Dataset::open(folder).unwrap();
    assert_eq!((dataset.frames.len(), dataset.depth_unit_mm), (13, None));
    for frame in &dataset.frames {
        let image = read_gray(frame.image.as_ref().unwrap()).unwrap();
        assert_eq!((image.width, image.height, image.bits), (640, 480, 8));
        assert!(image.data.iter().max() > Some(&200));
    }
}

#[test]
fn a_bundle_adjustment_problem() {
    let Some(folder) = data("bal") else { return };
    let problem = BalProblem::read(folder.join("problem-16-22106-pre.txt.bz2")).unwrap();
    assert_eq!((problem.cameras.len(), problem.points.len(), problem.observations.len()), (16, 22106, 83718));
    assert!(problem.cameras.iter().all(|camera| (100.0..10_000.0).contains(&camera[6])), "focal lengths in px");
}
