//! ChArUco corners by OpenCV's contrib module `aruco` with its default settings, to compare with.

use depthcal_io::GrayImage;
use depthcal_model::target::{Pattern, Target};
use opencv::aruco;
use opencv::core::{Mat, Point2f, Ptr, Vector, no_array};
use opencv::prelude::*;

/// The number of the board's corners that OpenCV finds in an image.
///
/// # Panics
/// When the board is no ChArUco board.
pub fn corners(image: &GrayImage, target: &Target) -> usize {
    let Pattern::Charuco { marker_mm, dictionary } = &target.pattern else { panic!("no ChArUco board") };
    let dictionary = aruco::get_predefined_dictionary_i32(number(dictionary)).expect("a dictionary");
    let bytes = super::measured::bytes(image);
    let mat = Mat::new_rows_cols_with_data(image.height as i32, image.width as i32, &bytes).expect("an image");
    let (mut tags, mut ids) = (Vector::<Vector<Point2f>>::new(), Vector::<i32>::new());
    let parameters = aruco::DetectorParameters::create().expect("parameters");
    aruco::detect_markers(&mat, &dictionary, &mut tags, &mut ids, &parameters, &mut no_array()).expect("a search");
    if ids.is_empty() {
        return 0;
    }
    let (columns, rows) = (target.columns as i32, target.rows as i32);
    let (square, marker) = (target.spacing_mm as f32, *marker_mm as f32);
    // Boards of an even number of rows that were drawn by OpenCV before 4.6 begin with a white square, those of 4.6
    // with a black one: a board with one more column on the left has the same squares, when its tags get the same
    // numbers.
    let plain = aruco::CharucoBoard::create(columns, rows, square, marker, &dictionary).expect("a board");
    let mut wider = aruco::CharucoBoard::create(columns + 1, rows, square, marker, &dictionary).expect("a board");
    let nobody = dictionary.bytes_list().rows();
    let mut next = 0..;
    let white = (0..rows).flat_map(|row| (0..=columns).filter(move |column| column % 2 != row % 2));
    let numbers = white.map(|column| if column == 0 { nobody } else { next.next().expect("a number") });
    wider.set_ids(numbers.collect());
    let count = |board: &Ptr<aruco::CharucoBoard>, on_board: &dyn Fn(i32) -> bool| {
        let (mut corners, mut numbers) = (Mat::default(), Mat::default());
        let (camera, lens) = (no_array(), no_array());
        let least_tags = 2;
        let count = aruco::interpolate_corners_charuco(
            &tags,
            &ids,
            &mat,
            board,
            &mut corners,
            &mut numbers,
            &camera,
            &lens,
            least_tags,
        )
        .expect("corners");
        (0..count).filter(|&i| on_board(*numbers.at::<i32>(i).expect("a number"))).count()
    };
    // The first column of the wider board's corners is the left border of the board.
    count(&plain, &|_| true).max(count(&wider, &|number| number % columns != 0))
}

/// OpenCV's number of a dictionary.
fn number(name: &str) -> i32 {
    let sizes = ["4X4", "5X5", "6X6", "7X7"].into_iter().flat_map(|bits| [50, 100, 250, 1000].map(|n| (bits, n)));
    let names = sizes.map(|(bits, n)| format!("DICT_{bits}_{n}")).chain(["DICT_ARUCO_ORIGINAL".to_owned()]);
    names.zip(0..).find(|(known, _)| known == name).expect("a dictionary").1
}
