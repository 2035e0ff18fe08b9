//! Reads measured captures, which are not part of the repository. Tests without their data print SKIPPED and pass.

use crate::python::measured;
use depthcal_io::{Dataset, check_same_size, read_depth, read_gray};
use depthcal_model::Pattern;

#[test]
fn kinect2_has_51_pairs() {
    let Some(folder) = measured("kinect2") else { return };
    let dataset = Dataset::open(folder).unwrap().into_only_camera().unwrap();
    assert_eq!((dataset.title.as_str(), dataset.frames.len(), dataset.depth_unit_mm), ("kinect2", 51, Some(1.0)));
    assert_eq!(dataset.target.pattern, Pattern::Chessboard);
    for frame in dataset.frames.iter().step_by(10) {
        let (image_path, depth_path) = (frame.image.as_ref().unwrap(), frame.depth.as_ref().unwrap());
        let (image, depth) = (read_gray(image_path).unwrap(), read_depth(depth_path).unwrap());
        check_same_size((image_path, [image.width, image.height]), (depth_path, [depth.width, depth.height])).unwrap();
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
    let Some(folder) = measured("chessboard") else { return };
    let dataset = Dataset::open(folder).unwrap().into_only_camera().unwrap();
    assert_eq!((dataset.frames.len(), dataset.depth_unit_mm), (13, None));
    for frame in &dataset.frames {
        let image = read_gray(frame.image.as_ref().unwrap()).unwrap();
        assert_eq!((image.width, image.height, image.bits), (640, 480, 8));
        assert!(image.data.iter().max() > Some(&200));
    }
}
