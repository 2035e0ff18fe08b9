//! Several boards in one image, told apart by the numbers of their tags.

use crate::common::{self, Camera, Pose, Scene, Style, Texture};
use depthcal_detect::{DetectOptions, Detector, detect};
use depthcal_io::GrayImage;
use depthcal_model::target::{NumberedBoard, Target};

const DICTIONARY: &str = "DICT_5X5_250";
/// Tags of the first board.
const TAGS: usize = 17;

fn board() -> Target {
    common::charuco(7, 5, 28.0, 21.0, DICTIONARY)
}

/// A board in the left or the right half of the image.
fn scene(texture: &Texture, right: bool) -> Scene<'_> {
    let camera = Camera { lens: [-0.05, 0.01, 0.0005, -0.0005, 0.0], ..Camera::thesis() };
    // A marker next to the middle would do for an odd number of columns only: the board would leave its half of the image.
    let (first, last) = (texture.target.point(0), texture.target.point(texture.target.len() - 1));
    let middle = [(first[0] + last[0]) / 2.0, (first[1] + last[1]) / 2.0];
    let centre = [if right { 480.0 } else { 160.0 }, 240.0];
    let z = camera.f * 196.0 / 250.0;
    let pose = Pose::looking(&camera, middle, centre, z, 0.15, 1.0, if right { 0.1 } else { -0.1 });
    Scene::new(camera, pose, texture, u64::from(right))
}

#[test]
fn two_boards_of_one_dictionary_are_told_apart() {
    let texture = |first_tag| Texture::with_tags(board(), 8.0, Style { first_tag, ..Style::default() });
    let (first, second) = (texture(0), texture(TAGS));
    let (left, right) = (scene(&first, false), scene(&second, true));
    let (mut image, of_right): (GrayImage, GrayImage) = (left.render(), right.render());
    let middle = image.width / 2;
    for (index, value) in of_right.data.iter().enumerate().filter(|(index, _)| index % of_right.width >= middle) {
        image.data[index] = *value;
    }
    let numbered = |name: &str, first_tag| NumberedBoard { name: name.into(), first_tag, board: board() };
    // Named in the other order: the numbers of the tags decide, not the place.
    let both = Target::several(vec![numbered("right", TAGS), numbered("left", 0)]);
    let options = DetectOptions { detector: Detector::BuiltIn, ..DetectOptions::default() };
    let detection = detect(&image, &both, &options).expect("no error").expect("both boards");
    for (part, scene) in both.parts().iter().zip([&right, &left]) {
        let markers: Vec<_> = detection.markers.iter().filter(|m| part.markers.contains(&m.index)).collect();
        // Both boards are in sight as a whole: the share at which a search is content.
        assert!(10 * markers.len() >= 9 * board().len(), "{}: {} markers", part.name, markers.len());
        for marker in markers {
            let truth = scene.truth(both.point(marker.index));
            let error = (marker.pixel[0] - truth[0]).hypot(marker.pixel[1] - truth[1]);
            assert!(error < 0.4, "{} {}: {error} px", part.name, marker.index);
        }
    }
    // One board alone is not taken for the other.
    let alone = detect(&left.render(), &both, &options).expect("no error").expect("a board");
    assert!(alone.markers.iter().all(|m| both.parts()[1].markers.contains(&m.index)));
}
