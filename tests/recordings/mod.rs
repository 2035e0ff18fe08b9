//! Recordings of all containers and camera models: what `import` writes `calibrate` and `evaluate` take.

mod containers;
mod messages;

use std::path::Path;

use depthcal::io::{Calibration, Dataset, DepthValues, read_depth_frame, read_gray, read_json};
use depthcal_simulate::{Board, CameraTruth, Kind, Pattern, Rendering, Simulation};
use serde_json::Value;

use self::messages::{Body, Message};
use crate::support::{Folder, fails, stderr, stdout, succeeds};

const FOCAL_PX: f64 = 310.0;
const SIZE: [usize; 2] = [320, 240];
const PINHOLE: [f64; 4] = [FOCAL_PX, FOCAL_PX, 159.5, 119.5];
const IMAGE: &str = "/camera/infra1/image_rect_raw";
const DEPTH: &str = "/camera/depth/image_rect_raw";
const INFO: &str = "/camera/infra1/camera_info";
const FRAMES: usize = 9;

/// A rendered capture as messages: intrinsics, images and depth in steps of 1 mm, and its board in `board.toml`.
fn recorded(folder: &Folder) -> Vec<Message> {
    let board = Board::new(Pattern::Chessboard, 8, 5, 40.0);
    let rendering = Rendering { depth_unit_mm: 1.0, ..Rendering::default() };
    let camera = CameraTruth::ideal(SIZE[0], SIZE[1], FOCAL_PX);
    let simulation = Simulation::new(camera, Kind::Filling1, &[], 5).board(board).frames(FRAMES).rendering(rendering);
    simulation.write_dataset(folder.path("rendered")).unwrap();
    let declaration = std::fs::read_to_string(folder.path("rendered/dataset.toml")).unwrap();
    folder.write("board.toml", &declaration[..declaration.find("[frames]").unwrap()]);
    let dataset = Dataset::open(folder.path("rendered")).unwrap().into_only_camera().unwrap();
    let mut messages = Vec::new();
    for (k, frame) in dataset.frames.iter().enumerate() {
        let mut put = |topic: &str, delay_ms: u64, body: Body| {
            let time_ns = 1_700_000_000_000_000_000 + (500 * k as u64 + delay_ms) * 1_000_000;
            messages.push(Message { topic: topic.to_owned(), time_ns, body });
        };
        put(INFO, 0, info("plumb_bob", &[0.0; 5]));
        let image = read_gray(frame.image.as_ref().unwrap()).unwrap();
        put(IMAGE, 0, picture("mono16", &image.data));
        let DepthValues::Steps(steps) = read_depth_frame(frame.depth.as_ref().unwrap()).unwrap().values else {
            panic!()
        };
        put(DEPTH, 4, picture("16UC1", &steps));
    }
    messages
}

fn picture(encoding: &'static str, values: &[u16]) -> Body {
    let data = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    Body::Image { size: SIZE, encoding, step: 2 * SIZE[0], data }
}

fn info(model: &'static str, distortion: &[f64]) -> Body {
    Body::Info { size: SIZE, model, distortion: distortion.to_vec(), pinhole: PINHOLE }
}

/// Changes the contents of a topic's messages.
fn changed(messages: Vec<Message>, topic: &str, change: impl Fn(Message) -> Message) -> Vec<Message> {
    messages.into_iter().map(|m| if m.topic == topic { change(m) } else { m }).collect()
}

/// Imports, and gives the command's JSON and what it says.
fn import(folder: &Folder, recording: &str, out: &str, more: &[&str]) -> (Value, String) {
    let arguments =
        ["import", &folder.arg(recording), "--board", &folder.arg("board.toml"), "--out", &folder.arg(out), "--json"]
            .map(str::to_owned);
    let output = succeeds(arguments.into_iter().chain(more.iter().map(|text| (*text).to_owned())));
    (serde_json::from_str(&stdout(&output)).unwrap(), stderr(&output))
}

/// Calibrates and evaluates an imported dataset, whose true focal length is known.
fn calibrates(folder: &Folder, captures: &str, what: &str) {
    let (dataset, result) = (folder.arg(captures), folder.arg(&format!("{captures}-result")));
    // Nine small images leave some of eight coefficients open.
    let lens: &[&str] = if what == "rational_polynomial" { &["--lens", "brown-conrady"] } else { &[] };
    succeeds(["calibrate", &dataset, "--out", &result].iter().chain(lens));
    let calibration = Path::new(&result).join("calibration.json");
    succeeds([
        "evaluate",
        calibration.to_str().unwrap(),
        &dataset,
        "--out",
        &folder.arg(&format!("{captures}-judged")),
    ]);
    let read: Calibration = read_json(&calibration).unwrap();
    let fx = read.camera.pieces.iter().flat_map(|p| &p.parameters).find(|p| p.name == "fx").unwrap().value;
    // Nine frames leave it some tenths of a pixel.
    assert!((fx - FOCAL_PX).abs() < 0.01 * FOCAL_PX, "{what}: fx {fx}");
}

#[test]
fn every_container_is_imported_and_calibrated() {
    let folder = Folder::new();
    let messages = recorded(&folder);
    folder.write("plain.bag", containers::bag(&messages, false, false));
    folder.write("packed.bag", containers::bag(&messages, true, false));
    folder.write("plain.mcap", containers::mcap(&messages, false));
    folder.write("folder/packed_0.mcap", containers::mcap(&messages[..12], true));
    folder.write("folder/packed_1.mcap", containers::mcap(&messages[12..], true));
    folder.write("folder/metadata.yaml", "rosbag2_bagfile_information:\n  version: 8\n");
    folder.write("db3/metadata.yaml", "rosbag2_bagfile_information:\n  version: 8\n");
    containers::db3(&folder.path("plain.db3"), &messages, false);
    containers::db3(&folder.path("db3/packed_0.db3"), &messages, true);
    let whole = zstd::encode_all(&std::fs::read(folder.path("plain.db3")).unwrap()[..], 1).unwrap();
    // Of a compressed file and its decompressed copy in the same folder one is read.
    folder.write("both/whole_0.db3.zstd", &whole);
    std::fs::copy(folder.path("plain.db3"), folder.path("both/whole_0.db3")).unwrap();
    folder.write("file/whole_0.db3.zstd", whole);
    let names = |m: Message| Message { topic: if m.topic == IMAGE { "IR".into() } else { "DEPTH".into() }, ..m };
    let tracks: Vec<Message> = messages.into_iter().filter(|m| m.topic != INFO).map(names).collect();
    folder.write("tracks.mkv", containers::mkv(&tracks));
    for name in ["plain.bag", "packed.bag", "plain.mcap", "folder", "plain.db3", "db3", "file", "both", "tracks.mkv"] {
        let out = format!("of-{name}");
        let (json, _) = import(&folder, name, &out, &[]);
        assert_eq!((&json["of_images"], &json["is_rig"]), (&FRAMES.into(), &false.into()), "{name}: {json}");
        calibrates(&folder, &out, name);
    }
}

#[test]
fn every_camera_model_is_imported_and_calibrated() {
    let folder = Folder::new();
    let mut messages = recorded(&folder);
    let models: [(&'static str, &[f64]); 11] = [
        ("", &[]),
        ("none", &[]),
        ("None", &[0.0; 5]),
        ("plumb_bob", &[0.01, -0.02, 1e-4, 2e-4, 0.01]),
        ("rational_polynomial", &[0.1, 0.02, 1e-4, 2e-4, 0.0, 0.1, 0.02, 0.0]),
        ("equidistant", &[0.33, 0.13, 0.05, 0.02]),
        ("Brown Conrady", &[0.01, -0.02, 1e-4, 2e-4, 0.01]),
        ("Inverse Brown Conrady", &[0.0; 5]),
        ("Modified Brown Conrady", &[0.0; 5]),
        ("Kannala Brandt4", &[0.33, 0.13, 0.05, 0.02, 0.0]),
        // Not read, and said.
        ("Ftheta", &[0.9, 0.0, 0.0, 0.0, 0.0]),
    ];
    for (number, (model, distortion)) in models.into_iter().enumerate() {
        messages = changed(messages, INFO, |m| Message { body: info(model, distortion), ..m });
        folder.write("a.mcap", containers::mcap(&messages, false));
        let out = format!("of-{number}");
        let (_, said) = import(&folder, "a.mcap", &out, &[]);
        assert_eq!(said.contains("the lens is left out"), model == "Ftheta", "{model}: {said}");
        assert!(said.contains("f 310.0, 310.0 px"), "{model}: {said}");
        calibrates(&folder, &out, model);
    }
}

/// As the RealSense SDK records: an option says the unit, and intrinsics tell which streams share a pixel grid.
#[test]
fn what_a_recording_says_of_its_cameras_is_used() {
    let folder = Folder::new();
    let renamed = |m: Message| {
        let topic = match m.topic.as_str() {
            IMAGE => "/device_0/sensor_1/Color_0/image/data",
            DEPTH => "/device_0/sensor_0/Depth_0/image/data",
            _ => "/device_0/sensor_1/Color_0/info/camera_info",
        };
        Message { topic: topic.into(), ..m }
    };
    let mut messages: Vec<Message> = recorded(&folder).into_iter().map(renamed).collect();
    let quarter = |body: Body| match body {
        Body::Image { data, .. } => {
            let steps: Vec<u16> =
                data.as_chunks::<2>().0.iter().map(|b| u16::from_le_bytes(*b).saturating_mul(4)).collect();
            picture("mono16", &steps)
        }
        other => other,
    };
    messages = changed(messages, "/device_0/sensor_0/Depth_0/image/data", |m| Message { body: quarter(m.body), ..m });
    let first = messages[0].time_ns;
    let at_first = |topic: &str, body| Message { topic: topic.to_owned(), time_ns: first, body };
    messages.insert(0, at_first("/device_0/sensor_0/option/Depth Units/value", Body::Number(0.000_25)));
    const OF_DEPTH: &str = "/device_0/sensor_0/Depth_0/info/camera_info";
    messages.insert(0, at_first(OF_DEPTH, info("Brown Conrady", &[0.0; 5])));
    folder.write("one.bag", containers::bag(&messages, false, false));
    let (json, _) = import(&folder, "one.bag", "one", &[]);
    assert_eq!((&json["unit_mm"], &json["is_rig"]), (&0.25.into(), &false.into()), "{json}");
    calibrates(&folder, "one", "one grid");

    // The same size, other intrinsics: no pixel grid in common.
    let other = Body::Info {
        size: SIZE,
        model: "Brown Conrady",
        distortion: vec![0.0; 5],
        pinhole: [290.0, 290.0, 160.0, 120.0],
    };
    messages = changed(messages, OF_DEPTH, |m| Message { body: other.clone(), ..m });
    folder.write("two.bag", containers::bag(&messages, false, false));
    let (json, said) = import(&folder, "two.bag", "two", &[]);
    assert!(
        json["is_rig"] == true && said.contains("two cameras of a rig"),
        "{json}
{said}"
    );
    let dataset = Dataset::open(folder.path("two")).unwrap();
    let names: Vec<_> = dataset.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["image", "depth"]);

    // Without intrinsics nothing tells; it is said.
    messages.retain(|m| !m.topic.ends_with("camera_info"));
    folder.write("none.bag", containers::bag(&messages, false, false));
    let (json, said) = import(&folder, "none.bag", "none", &[]);
    assert!(
        json["is_rig"] == false && said.contains("nothing in the recording says"),
        "{json}
{said}"
    );
}

#[test]
fn what_is_complete_of_a_cut_file_is_read_and_said() {
    let folder = Folder::new();
    let messages = recorded(&folder);
    let tracks = |m: &Message| match m.topic.as_str() {
        IMAGE => Some(Message { topic: "IR".into(), time_ns: m.time_ns, body: m.body.clone() }),
        DEPTH => Some(Message { topic: "DEPTH".into(), time_ns: m.time_ns, body: m.body.clone() }),
        _ => None,
    };
    let tracks: Vec<Message> = messages.iter().filter_map(tracks).collect();
    containers::db3(&folder.path("whole.db3"), &messages, false);
    let whole = [
        ("cut.mcap", containers::mcap(&messages, false)),
        ("cut.bag", containers::bag(&messages, false, false)),
        ("cut.db3", std::fs::read(folder.path("whole.db3")).unwrap()),
        ("cut.mkv", containers::mkv(&tracks)),
        ("cut.mcap.zstd", zstd::encode_all(&containers::mcap(&messages, false)[..], 1).unwrap()),
    ];
    for (name, bytes) in whole {
        folder.write(name, &bytes[..bytes.len() * 7 / 10]);
        let (json, said) = import(&folder, name, &format!("of-{name}"), &[]);
        let images = json["of_images"].as_u64().unwrap() as usize;
        assert!((FRAMES / 2..FRAMES).contains(&images), "{name}: {json}");
        assert!(said.contains("is cut off: read up to its last complete message"), "{name}: {said}");
        assert_eq!(json["cut_off"][0], folder.arg(name));
    }
    // All of a recording that was interrupted is there, but for the index.
    folder.write("interrupted.bag", containers::bag(&messages, false, true));
    let (json, said) = import(&folder, "interrupted.bag", "interrupted", &[]);
    assert!(
        json["of_images"] == FRAMES && said.contains("is cut off"),
        "{json}
{said}"
    );
}

#[test]
fn streams_of_two_clocks_are_paired_only_as_asked() {
    let folder = Folder::new();
    let messages =
        changed(recorded(&folder), DEPTH, |m| Message { time_ns: m.time_ns - 1_699_999_000_000_000_000, ..m });
    folder.write("a.bag", containers::bag(&messages, false, false));
    let (recording, board) = (folder.arg("a.bag"), folder.arg("board.toml"));
    let ranges =
        ["1700000000.000 s to 1700000004.000 s", "1000.004 s to 1004.004 s", "--pair 1699998999.996", "--pair order"];
    fails(["import", &recording, "--board", &board, "--out", &folder.arg("none")], &ranges);
    assert!(!folder.path("none/dataset.toml").exists());
    for (pair, words) in [("order", "by their order, as asked"), ("1699998999.996", "1699998999.996 s were added")] {
        let out = format!("by-{pair}");
        let (json, said) = import(&folder, "a.bag", &out, &["--pair", pair]);
        assert!(
            json["frames"].as_u64() > Some(5) && said.contains(words),
            "{json}
{said}"
        );
        calibrates(&folder, &out, pair);
    }
    // One depth image fewer has no order.
    let last = messages.len() - 1;
    folder.write("b.bag", containers::bag(&messages[..last], false, false));
    let arguments = ["import", &folder.arg("b.bag"), "--out", &folder.arg("no"), "--pair", "order"];
    fails(arguments, &["9 images and 8 depth images"]);
    fails(
        ["import", &recording, "--out", &folder.arg("no"), "--pair", "names"],
        &["time, order, or a number of seconds"],
    );
}

#[test]
fn a_warm_up_is_left_out() {
    let folder = Folder::new();
    folder.write("a.bag", containers::bag(&recorded(&folder), false, false));
    let (json, said) = import(&folder, "a.bag", "late", &["--skip-s", "2"]);
    assert!(
        json["frames"] == 5 && said.contains("the first 2 s are left out"),
        "{json}
{said}"
    );
    let arguments = ["import", &folder.arg("a.bag"), "--out", &folder.arg("none"), "--skip-s", "100"];
    fails(arguments, &["none of the 9 images", "100 s"]);
}

#[test]
fn a_camera_without_a_calibration_says_so() {
    let folder = Folder::new();
    let zero = Body::Info { size: SIZE, model: "plumb_bob", distortion: vec![0.0; 5], pinhole: [0.0; 4] };
    let messages = changed(recorded(&folder), INFO, |m| Message { body: zero.clone(), ..m });
    folder.write("a.mcap", containers::mcap(&messages, false));
    let (_, said) = import(&folder, "a.mcap", "zero", &[]);
    assert!(said.contains("its focal lengths are zero: the driver has no calibration"), "{said}");
    assert_eq!(said.matches("focal lengths are zero").count(), 1, "{said}");
}

/// Bayer patterns and packed grey values show the board.
#[test]
fn images_of_other_encodings_are_calibrated() {
    let folder = Folder::new();
    let messages = recorded(&folder);
    let packed = |data: &[u8]| -> Vec<u8> {
        let twelve = |b: &[u8; 2]| u16::from_le_bytes(*b) >> 4;
        let pair = |p: &[[u8; 2]; 2]| {
            let [a, b] = [twelve(&p[0]), twelve(&p[1])];
            [a as u8, (a >> 8 | b << 4) as u8, (b >> 4) as u8]
        };
        data.as_chunks::<2>().0.as_chunks::<2>().0.iter().flat_map(pair).collect()
    };
    let encoded = |m: &Message, encoding: &'static str| {
        let body = match (&m.body, encoding) {
            (Body::Image { data, .. }, "mono12p") => {
                Body::Image { size: SIZE, encoding, step: SIZE[0] * 3 / 2, data: packed(data) }
            }
            (Body::Image { data, .. }, _) => {
                Body::Image { size: SIZE, encoding, step: 2 * SIZE[0], data: data.clone() }
            }
            (other, _) => other.clone(),
        };
        Message { topic: m.topic.clone(), time_ns: m.time_ns, body }
    };
    for encoding in ["mono12p", "bayer_rggb16", "bayer_gbrg16"] {
        let in_encoding = |m: &Message| encoded(m, if m.topic == IMAGE { encoding } else { "16UC1" });
        let of_encoding: Vec<Message> = messages.iter().map(in_encoding).collect();
        folder.write("a.mcap", containers::mcap(&of_encoding, false));
        import(&folder, "a.mcap", encoding, &[]);
        calibrates(&folder, encoding, encoding);
    }
}
