use depthcal_model::{Pattern, Technology};
use proptest::prelude::*;

use super::super::camera_hint::IntrinsicNumbers;
use super::*;

const CHESSBOARD: &str = "[board]\nkind = \"chessboard\"\ncolumns = 9\nrows = 6\nspacing_mm = 25\n";
const DOTS: &str =
    "[board]\nkind = \"asymmetric-circles\"\ncolumns = 4\nrows = 11\nspacing_mm = 36.0\ncircle_diameter_mm = 20.0\n";
const FRAMES: &str = "[frames]\nimage = \"image/*.png\"\n";

fn parse(text: &str) -> Result<DatasetFile, DatasetError> {
    DatasetFile::parse(Path::new("set/dataset.toml"), text)
}

/// The camera of a file that declares one.
fn only(text: &str) -> CameraSection {
    let file = parse(text).unwrap();
    assert!(file.is_short());
    file.cameras.into_iter().next().unwrap()
}

/// The message of the error that `text` gives; it must name the file and every one of `parts`.
fn complains(text: &str, parts: &[&str]) {
    let message = parse(text).unwrap_err().to_string();
    assert!(message.contains("set/dataset.toml"), "{message}");
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
}

#[test]
fn disparities_take_the_place_of_a_unit() {
    let depth = format!("{CHESSBOARD}[frames]\nimage = \"i/*\"\ndepth = \"d/*\"\n[depth]\n");
    let pair = "disparity = [3.1365e-3, -2.8736e-6]\n";
    for kind in ["", "kind = \"disparity\"\n"] {
        let text = format!("{depth}{kind}{pair}");
        let camera = only(&text);
        assert_eq!((camera.unit_mm, camera.disparity), (None, Some(Disparity([3.1365e-3, -2.8736e-6]))));
        // As it was read, it is written.
        let file = parse(&text).unwrap();
        assert_eq!(parse(&file.to_toml().unwrap()).unwrap(), file);
    }
    let rig = format!("{CHESSBOARD}[cameras.a]\nimage = \"a/*\"\n[cameras.b]\ndepth = \"b/*\"\n{pair}");
    let rig = parse(&rig).unwrap();
    assert!(rig.cameras[1].disparity.is_some() && parse(&rig.to_toml().unwrap()).unwrap() == rig);
    assert_eq!(only(&format!("{depth}kind = \"depth\"\nunit_mm = 1\n")).unit_mm, Some(1.0));
    // The line to write; a kind that is none; two units; a function that is none.
    complains(&format!("{depth}kind = \"disparity\"\n"), &["depth.disparity", "[3.1365e-3, -2.8736e-6]"]);
    complains(&format!("{depth}kind = \"disparity\"\nunit_mm = 1\n"), &["depth.disparity", "[3.1365e-3, -2.8736e-6]"]);
    complains(&format!("{depth}kind = \"range\"\nunit_mm = 1\n"), &["depth.kind", "range"]);
    complains(&format!("{depth}unit_mm = 1\n{pair}"), &["depth.disparity", "too many"]);
    for wrong in ["[1.0]", "[1.0, 0.0]", "[1.0, 2.0, 3.0]"] {
        complains(&format!("{depth}disparity = {wrong}\n"), &["depth.disparity", "two numbers"]);
    }
}

#[test]
fn every_kind_of_board() {
    let board = |lines: &str| parse(&format!("[board]\ncolumns = 5\nrows = 7\nspacing_mm = 30\n{lines}\n{FRAMES}"));
    assert_eq!(board("kind = \"chessboard\"").unwrap().board.pattern, Pattern::Chessboard);
    assert_eq!(
        board("kind = \"symmetric-circles\"\ncircle_diameter_mm = 15").unwrap().board.pattern,
        Pattern::SymmetricCircles { circle_diameter_mm: 15.0 }
    );
    assert_eq!(
        board("kind = \"asymmetric-circles\"\ncircle_diameter_mm = 40.5").unwrap().board.pattern,
        Pattern::AsymmetricCircles { circle_diameter_mm: 40.5 }
    );
    assert_eq!(
        board("kind = \"charuco\"\nmarker_mm = 20\ndictionary = \"DICT_5X5_100\"").unwrap().board.pattern,
        Pattern::Charuco { marker_mm: 20.0, dictionary: "DICT_5X5_100".into() }
    );
    let april = board("kind = \"aprilgrid\"\nmarker_mm = 20\ndictionary = \"DICT_APRILTAG_36h11\"").unwrap();
    assert_eq!(april.board.pattern, Pattern::Aprilgrid { marker_mm: 20.0 });
    assert_eq!((april.board.columns, april.board.rows, april.board.spacing_mm), (5, 7, 30.0));
}

#[test]
fn camera_is_optional_and_has_defaults() {
    let text = format!("{CHESSBOARD}{FRAMES}[camera]\nfx = 500\nfy = 501.5\ncx = 320\ncy = 240\n");
    let numbers = IntrinsicNumbers { fx: 500.0, fy: 501.5, cx: 320.0, cy: 240.0, skew: 0.0, distortion: Vec::new() };
    let expected = CameraHint { numbers: Some(numbers), ..CameraHint::default() };
    assert_eq!(only(&text).camera, Some(expected));
    let text = format!("{text}distortion = [-0.1, 0.2, 0, 0]\nfixed = true\n");
    let camera = only(&text).camera.unwrap();
    assert!(camera.fixed);
    assert_eq!(camera.numbers.unwrap().distortion, [-0.1, 0.2, 0.0, 0.0]);
    complains(&format!("{text}skew = \"no\""), &["camera.skew", "not a number", ":15"]);
    complains(&text.replace("0.2, 0, 0]", "0.2, 0]"), &["camera.distortion", "3 numbers", "4, 5, 8, 12 or 14"]);
    complains(&format!("{text}intrinsics = \"a.yml\""), &["camera.intrinsics", "one of them is too many"]);
    let file = format!("{CHESSBOARD}{FRAMES}[camera]\nintrinsics = \"factory.yml\"\nlens = \"opencv8\"\n");
    let camera = only(&file).camera.unwrap();
    assert_eq!((camera.intrinsics.as_deref(), camera.lens.as_deref()), (Some("factory.yml"), Some("opencv8")));
    let lens = only(&format!("{CHESSBOARD}{FRAMES}[camera]\nlens = \"auto\"\n")).camera.unwrap();
    assert_eq!((lens.numbers, lens.lens.as_deref()), (None, Some("auto")));
    complains(&format!("{CHESSBOARD}{FRAMES}[camera]\nfixed = true\n"), &["camera.fx"]);
    let technology = |name: &str| format!("{CHESSBOARD}{FRAMES}[camera]\ntechnology = \"{name}\"\n");
    let declared = only(&technology("structured-light")).camera.unwrap();
    assert_eq!((declared.numbers, declared.technology), (None, Some(Technology::StructuredLight)));
    complains(&technology("lidar"), &["camera.technology", "'lidar'", "time-of-flight"]);
}

#[test]
fn bad_toml_names_the_line() {
    complains("[board]\nkind = \n", &["dataset.toml:2", "TOML"]);
}

#[test]
fn unknown_keys_come_with_a_suggestion() {
    complains(&format!("{CHESSBOARD}colums = 3\n{FRAMES}"), &[":6", "`board.colums`", "`board.columns`"]);
    complains(&format!("{CHESSBOARD}{FRAMES}unit_mm = 1.0\n"), &["`frames.unit_mm`", "`depth.unit_mm`"]);
    complains(&format!("{CHESSBOARD}{FRAMES}[dpeth]\nunit_mm = 1.0\n"), &["`dpeth`", "`depth`"]);
    complains(&format!("{CHESSBOARD}{FRAMES}zzz = 1.0\n"), &["`frames.zzz`", "\"metadata\""]);
}

#[test]
fn unknown_kinds_come_with_a_suggestion() {
    complains(&CHESSBOARD.replace("chessboard", "chess-board"), &["frames"]);
    complains(&format!("{}{FRAMES}", CHESSBOARD.replace("chessboard", "checkerboard")), &[":2", "\"chessboard\""]);
    complains(&format!("{}{FRAMES}", CHESSBOARD.replace("chessboard", "xyz")), &["xyz", "\"charuco\""]);
}

#[test]
fn missing_parts_come_with_a_remedy() {
    complains("", &["`board`", "[board]"]);
    complains(CHESSBOARD, &["`frames`", "[frames]"]);
    complains(&format!("{CHESSBOARD}[frames]\n"), &["`frames.image`", "glob"]);
    complains(&format!("{}{FRAMES}", CHESSBOARD.replace("spacing_mm = 25", "")), &["board.spacing_mm", "in mm"]);
}

#[test]
fn the_diameter_of_dots_may_be_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dataset.toml");
    let file = parse(&format!("{}{FRAMES}", DOTS.replace("circle_diameter_mm = 20.0", ""))).unwrap();
    assert_eq!(file.board.circle_diameter_mm(), None);
    file.write(&path).unwrap();
    assert_eq!(DatasetFile::read(&path).unwrap(), file);
    complains(&format!("{}{FRAMES}", DOTS.replace("= 20.0", "= 0.0")), &["circle_diameter_mm", "leave it out"]);
}

#[test]
fn depth_needs_its_unit() {
    let depth = format!("{CHESSBOARD}{FRAMES}depth = \"depth/*.png\"\n");
    complains(&depth, &["depth.unit_mm", "never guessed"]);
    complains(&format!("{depth}[depth]\n"), &["depth.unit_mm", "never guessed"]);
    for unit in ["0", "-1", "nan", "inf", "0.001", "1001", "\"mm\""] {
        complains(&format!("{depth}[depth]\nunit_mm = {unit}\n"), &["depth.unit_mm", ":10", unit]);
    }
    assert_eq!(only(&format!("{depth}[depth]\nunit_mm = 0.1\n")).unit_mm, Some(0.1));
}

#[test]
fn numbers_out_of_range_name_the_field() {
    for spacing in ["0", "-25", "nan", "0.025", "1e9", "\"25\"", "[25]"] {
        let text = CHESSBOARD.replace("spacing_mm = 25", &format!("spacing_mm = {spacing}"));
        complains(&format!("{text}{FRAMES}"), &["board.spacing_mm", ":5", spacing]);
    }
    for columns in ["0", "-9", "9.5", "1", "100000", "99999999999999999999"] {
        let text = CHESSBOARD.replace("columns = 9", &format!("columns = {columns}"));
        complains(&format!("{text}{FRAMES}"), &["columns", columns]);
    }
    let text = DOTS.replace("circle_diameter_mm = 20.0", "circle_diameter_mm = 60.0");
    complains(&format!("{text}{FRAMES}"), &["circle_diameter_mm", "neighbouring dots"]);
}

#[test]
fn what_is_written_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set/dataset.toml");
    let mut file = DatasetFile {
        board: Target {
            pattern: Pattern::Charuco { marker_mm: 22.5, dictionary: "DICT_4X4_50".into() },
            columns: 7,
            rows: 5,
            spacing_mm: 30.0,
        },
        metadata: Some("frames.csv".into()),
        associations: None,
        within_s: Some(0.02),
        cameras: vec![CameraSection {
            name: CAMERA.to_owned(),
            image: Some("ir/*.png".into()),
            depth: Some("depth/*.png".into()),
            unit_mm: Some(0.1),
            disparity: None,
            camera_from_rig: None,
            expected_from_rig: None,
            camera: Some(CameraHint {
                numbers: Some(IntrinsicNumbers {
                    fx: 476.9,
                    fy: 476.9,
                    cx: 312.97,
                    cy: 242.49,
                    skew: 0.0,
                    distortion: vec![-0.1468, 0.0463, 0.0012, -0.0007, -0.0756],
                }),
                fixed: true,
                ..CameraHint::default()
            }),
        }],
    };
    file.write(&path).unwrap();
    assert_eq!(DatasetFile::read(&path).unwrap(), file);
    let text = std::fs::read_to_string(&path).unwrap();
    let sections: Vec<&str> = text.lines().filter(|line| line.starts_with('[')).collect();
    assert_eq!(sections, ["[board]", "[frames]", "[depth]", "[camera]"]);
    // With another camera every one has a section of its name.
    let colour = CameraSection { name: "colour".into(), image: Some("c/*.png".into()), ..CameraSection::default() };
    file.cameras.push(colour);
    file.cameras[0].name = "infrared".into();
    file.write(&path).unwrap();
    assert_eq!(DatasetFile::read(&path).unwrap(), file);
    file.cameras[0].unit_mm = None;
    assert!(file.write(&path).unwrap_err().to_string().contains("cameras.infrared.unit_mm"));
}

#[test]
fn a_camera_by_its_name_is_what_the_short_form_declares() {
    let short = format!(
        "{CHESSBOARD}[frames]\nimage = \"i/*\"\ndepth = \"d/*\"\n[depth]\nunit_mm = 1\n[camera]\nlens = \"auto\"\n"
    );
    let long =
        format!("{CHESSBOARD}[cameras.camera]\nimage = \"i/*\"\ndepth = \"d/*\"\nunit_mm = 1\nlens = \"auto\"\n");
    assert_eq!(parse(&short).unwrap(), parse(&long).unwrap());
}

#[test]
fn the_first_camera_of_the_file_is_the_reference() {
    let rig = parse(&format!(
        "{CHESSBOARD}[cameras.zed]\nimage = \"z/*.png\"\n[cameras.azure]\ndepth = \"a/*.png\"\nunit_mm = 0.5\nfx = 500\nfy = 500\ncx = 1\n\
         cy = 2\n[frames]\nwithin_s = 0.02\n"
    ))
    .unwrap();
    let names: Vec<&str> = rig.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["zed", "azure"]);
    assert_eq!((rig.within_s, rig.cameras[1].unit_mm), (Some(0.02), Some(0.5)));
    assert!(rig.cameras[0].camera.is_none() && rig.cameras[1].camera.as_ref().unwrap().numbers.is_some());
}

#[test]
fn faults_of_cameras_have_their_names() {
    let complaint = |rest: &str| parse(&format!("{CHESSBOARD}{rest}")).unwrap_err().to_string();
    let unit = complaint("[cameras.a]\ndepth = \"a/*.png\"\n");
    assert!(unit.contains("cameras.a.unit_mm") && unit.contains("never guessed"), "{unit}");
    assert!(complaint("[cameras.a]\nlens = \"none\"\n").contains("cameras.a.image"));
    let key = complaint("[cameras.a]\nimages = \"a/*.png\"\n");
    assert!(key.contains(":7") && key.contains("cameras.a.image"), "{key}");
    let focal_length = complaint("[cameras.a]\nimage = \"a/*\"\nfx = -1\nfy = 1\ncx = 1\ncy = 1\n");
    assert!(focal_length.contains(":8: `cameras.a.fx`"), "{focal_length}");
    assert!(complaint("").contains("[cameras.NAME]") && complaint("[cameras]\n").contains("[cameras.NAME]"));
    assert!(complaint("[depth]\nunit_mm = 1\n[cameras.a]\nimage = \"*\"\n").contains("`cameras.NAME.depth`"));
    assert!(complaint("[frames]\nimage = \"*\"\n[cameras.a]\nimage = \"*\"\n").contains("`cameras.NAME.image`"));
}

#[test]
fn known_extrinsics_are_a_rigid_motion_of_another_camera_than_the_first() {
    let rig = |first: &str, second: &str| {
        let camera = |name: &str, rest: &str| format!("[cameras.{name}]\nimage = \"*\"\n{rest}\n");
        parse(&(CHESSBOARD.to_owned() + &camera("a", first) + &camera("b", second)))
    };
    let known = "camera_from_rig = [0, -1, 0, 52.3, 1, 0, 0, -1.4, 0, 0, 1, 3.2";
    let rows = [0.0, -1.0, 0.0, 52.3, 1.0, 0.0, 0.0, -1.4, 0.0, 0.0, 1.0, 3.2];
    for text in [format!("{known}]"), format!("{known}, 0, 0, 0, 1]")] {
        let file = rig("", &text).unwrap();
        assert_eq!(file.cameras[1].camera_from_rig, Some(rows));
        assert_eq!(parse(&file.to_toml().unwrap()).unwrap(), file);
    }
    let expected = rig("", &known.replace("camera_from", "expected_from").replace("3.2", "3.2]")).unwrap();
    assert_eq!((expected.cameras[1].camera_from_rig, expected.cameras[1].expected_from_rig), (None, Some(rows)));
    assert_eq!(parse(&expected.to_toml().unwrap()).unwrap(), expected);
    let refused = |first: &str, second: &str| rig(first, second).unwrap_err().to_string();
    assert!(refused(&format!("{known}]"), "").contains("first camera"));
    let mirrored = known.replace("3.2", "3.2]").replace("1, 3.2", "-1, 3.2");
    for wrong in [&mirrored, "camera_from_rig = [1, 0, 0]", &known.replace("-1,", "-1.1,").replace("3.2", "3.2]")] {
        let message = refused("", wrong);
        assert!(message.contains("`cameras.b.camera_from_rig`") && message.contains("[R t]"), "{message}");
    }
}

fn tags(name: &str, first_tag: usize) -> String {
    format!(
        "[boards.{name}]\nkind = \"aprilgrid\"\ncolumns = 6\nrows = 5\nspacing_mm = 39\nmarker_mm = 30\nfirst_tag = {first_tag}\n"
    )
}

#[test]
fn several_boards_are_told_apart_by_the_numbers_of_their_tags() {
    for cameras in [FRAMES, "[cameras.a]\nimage = \"*.png\"\n"] {
        let file = parse(&(tags("wall", 0) + &tags("floor", 30) + cameras)).unwrap();
        let parts = file.board.parts();
        let names: Vec<_> = parts.iter().map(|p| (p.name, p.first_tag, p.markers.clone())).collect();
        assert_eq!(names, [("wall", 0, 0..120), ("floor", 30, 120..240)]);
        assert_eq!(parse(&file.to_toml().unwrap()).unwrap(), file);
    }
}

#[test]
fn one_board_may_begin_with_another_tag() {
    let one = |first_tag: usize| tags("wall", first_tag).replace("[boards.wall]", "[board]") + FRAMES;
    let file = parse(&one(100)).unwrap();
    let parts = file.board.parts();
    assert_eq!((parts.len(), parts[0].first_tag, parts[0].frame_name("0007")), (1, 100, "0007".to_owned()));
    assert_eq!(parse(&file.to_toml().unwrap()).unwrap().board.parts()[0].first_tag, 100);
    // The first of its dictionary is no other.
    let plain = parse(&one(0).replace("first_tag = 0\n", "")).unwrap();
    assert_eq!((parse(&one(0)).unwrap(), plain.board.columns), (plain.clone(), 6));
    complains(&one(0).replace("first_tag = 0", "first_tag = -1"), &["board.first_tag"]);
    assert_eq!(parse(&format!("{CHESSBOARD}first_tag = 3\n{FRAMES}")).unwrap().board.parts()[0].first_tag, 0);
}

#[test]
fn the_tags_of_a_charuco_board_are_as_many_as_its_white_squares() {
    let board = |name: &str, rows: usize, first_tag: usize| {
        format!(
            "[boards.{name}]\nkind = \"charuco\"\ncolumns = 9\nrows = {rows}\nspacing_mm = 40\nmarker_mm = 30\n\
             dictionary = \"DICT_5X5_250\"\nfirst_tag = {first_tag}\n"
        )
    };
    // 63 squares, of which the first is black, and 54.
    for (rows, tags) in [(7, 31), (6, 27)] {
        parse(&(board("wall", rows, 0) + &board("floor", rows, tags) + FRAMES)).unwrap();
        complains(
            &(board("wall", rows, 0) + &board("floor", rows, tags - 1) + FRAMES),
            &["floor", "wall", "first_tag"],
        );
    }
}

#[test]
fn boards_that_look_alike_are_refused() {
    complains(&(tags("wall", 0) + &tags("floor", 29) + FRAMES), &["floor", "wall", "first_tag"]);
    let plain = CHESSBOARD.replace("[board]", "[boards.wall]");
    complains(&(plain + FRAMES), &["without tags"]);
    complains(&(CHESSBOARD.to_owned() + &tags("wall", 0) + FRAMES), &["and so is board"]);
    complains(&("[boards]\n".to_owned() + FRAMES), &["no section"]);
    complains(&(tags("wall", 0).replace("columns = 6", "columns = 0") + FRAMES), &["boards.wall.columns"]);
}

proptest! {
    #[test]
    fn any_text_is_an_error_and_no_panic(text in "(?s).{0,200}") {
        prop_assert!(parse(&text).is_err());
    }

    #[test]
    fn any_value_is_no_panic(key in "[a-z_]{1,12}", value in "[-+0-9.eE_xnaif\"\\[\\],]{0,12}") {
        let _ = parse(&format!("{CHESSBOARD}{FRAMES}{key} = {value}\n[camera]\nfx = {value}\n"));
    }
}
