//! The dictionaries against OpenCV's: every cell of every tag.

#![cfg(feature = "opencv")]

#[cfg(not(fiducials = "contrib"))]
#[test]
fn every_cell_is_opencv_s() {
    use std::io::Write as _;
    let _ = writeln!(std::io::stderr(), "\nSKIPPED: this OpenCV has no contrib module aruco, which draws tags");
}

#[cfg(fiducials = "contrib")]
#[test]
fn every_cell_is_opencv_s() {
    use depthcal_detect::tag_cells;
    use opencv::aruco;
    use opencv::core::{Mat, MatTraitConst};
    use opencv::prelude::*;

    let squares =
        ["4X4", "5X5", "6X6", "7X7"].into_iter().flat_map(|n| [50, 100, 250, 1000].map(|c| format!("{n}_{c}")));
    let others = ["ARUCO_ORIGINAL", "APRILTAG_16h5", "APRILTAG_25h9", "APRILTAG_36h10", "APRILTAG_36h11"];
    for (number, name) in squares.chain(others.map(str::to_owned)).enumerate() {
        let dictionary = aruco::get_predefined_dictionary_i32(number as i32).expect("a dictionary");
        let count = dictionary.bytes_list().rows() as usize;
        let side = dictionary.marker_size() + 2;
        assert!(tag_cells(&name, count).is_err(), "{name} has more than {count} tags");
        // All tags of small dictionaries, and some 100 of the others.
        for id in (0..count).step_by(count / 100 + 1).chain([count - 1]) {
            let mut drawn = Mat::default();
            aruco::draw_marker(&dictionary, id as i32, side, &mut drawn, 1).expect("a tag");
            let ours = tag_cells(&name, id).expect("a tag");
            for row in 0..side {
                for column in 0..side {
                    let white = *drawn.at_2d::<u8>(row, column).expect("a cell") > 127;
                    assert_eq!(
                        ours[row as usize][column as usize], white,
                        "{name}, tag {id}, row {row}, column {column}"
                    );
                }
            }
        }
    }
}
