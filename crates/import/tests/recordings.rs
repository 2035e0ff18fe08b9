//! Recordings written by other programs (`mcap-ros2-support`, `rosbags`) and by a camera's own recorder: what is imported is what
//! was written, bit by bit. Skipped where Python, a package or the measured recording is absent.

use std::path::{Path, PathBuf};

use crate::python;
use depthcal_import::{ImportOptions, Imported, import};
use depthcal_io::{Dataset, DepthValues, read_depth_frame, read_gray};

const WIDTH: usize = 64;
const HEIGHT: usize = 48;
const FRAMES: usize = 12;

/// Streams that every script writes: images and depth of one size (the depth 4 ms later), colour of another, intrinsics, and one
/// that is none of these. Image k is a shifted ramp of k-dependent contrast, so that all frames differ.
const SCENE: &str = "
import sys, numpy as np
W, H, N = 64, 48, 12
def grey(k): return ((np.arange(W)[None, :] * (k + 3) * 131 + np.arange(H)[:, None] * (977 + 501 * k)) % 60000).astype(np.uint16)
def depth(k): return (600 + 50 * k + np.arange(W * H).reshape(H, W) % 977).astype(np.uint16)
def colour(k): return np.full((24, 32, 3), 10 * k, np.uint8)
def stamp(k, d=0): return 1_700_000_000, 33_000_000 * k + d
K = [500.0, 0, 31.5, 0, 501.0, 23.5, 0, 0, 1]
D = [0.1, -0.2, 0.001, 0.002, 0.05]
";

fn grey(k: usize, i: usize) -> u16 {
    let (u, v) = (i % WIDTH, i / WIDTH);
    ((u * (k + 3) * 131 + v * (977 + 501 * k)) % 60000) as u16
}

fn depth(k: usize, i: usize) -> u16 {
    (600 + 50 * k + i % 977) as u16
}

fn imported(path: &Path, out: &Path, options: &ImportOptions) -> Imported {
    import(path, out, options).unwrap_or_else(|error| panic!("{error}"))
}

/// Every frame is one of the written ones, image and depth alike; `scale` is the depth's value per mm.
fn check(out: &Path, result: &Imported, floating: bool) {
    let written = std::fs::read_to_string(out.join("dataset.toml")).unwrap();
    let board = "[board]\nkind = \"chessboard\"\ncolumns = 8\nrows = 5\nspacing_mm = 20.0\n";
    std::fs::write(out.join("dataset.toml"), format!("{board}{written}")).unwrap();
    let dataset = Dataset::open(out).unwrap().into_only_camera().unwrap();
    assert_eq!((dataset.frames.len(), dataset.strays.len()), (result.frames, 0));
    assert_eq!((result.frames, result.of_images, result.without_depth), (FRAMES, FRAMES, 0), "{result:?}");
    let camera = dataset.camera.unwrap();
    let camera = camera.numbers.as_ref().unwrap();
    assert_eq!((camera.fx, camera.fy, camera.cx, camera.cy), (500.0, 501.0, 31.5, 23.5));
    assert_eq!(camera.distortion, [0.1, -0.2, 0.001, 0.002, 0.05]);
    assert_eq!(dataset.depth_unit_mm, Some(if floating { 1000.0 } else { 1.0 }));
    for (k, frame) in dataset.frames.iter().enumerate() {
        assert!((frame.metadata.timestamp_s.unwrap() - 0.033 * k as f64).abs() < 1e-6);
        let image = read_gray(frame.image.as_ref().unwrap()).unwrap();
        assert_eq!((image.width, image.height, image.bits), (WIDTH, HEIGHT, 16));
        assert!((0..WIDTH * HEIGHT).all(|i| image.data[i] == grey(k, i)), "image {k}");
        let read = read_depth_frame(frame.depth.as_ref().unwrap()).unwrap();
        match &read.values {
            DepthValues::Steps(values) => {
                assert!(!floating && (0..values.len()).all(|i| values[i] == depth(k, i)), "depth {k}")
            }
            DepthValues::Float(values) => {
                let expected = |i: usize| (f32::from(depth(k, i)) / 1000.0).to_bits();
                assert!(floating && (0..values.len()).all(|i| values[i].to_bits() == expected(i)), "depth {k}");
            }
        }
    }
}

#[test]
fn mcap_of_ros_2() {
    let Some(python) = python::with_modules(&["mcap_ros2", "numpy"]) else { return };
    let folder = python::folder("mcap");
    let code = format!(
        "{SCENE}
from mcap_ros2.writer import Writer
from mcap.writer import CompressionType
TIME = 'int32 sec\\nuint32 nanosec'
HEADER = 'builtin_interfaces/Time stamp\\nstring frame_id'
PARTS = '\\n' + '=' * 80 + '\\nMSG: std_msgs/Header\\n' + HEADER + '\\n' + '=' * 80 + '\\nMSG: builtin_interfaces/Time\\n' + TIME
IMAGE = 'std_msgs/Header header\\nuint32 height\\nuint32 width\\nstring encoding\\nuint8 is_bigendian\\nuint32 step\\nuint8[] data' + PARTS
ROI = '\\n' + '=' * 80 + '\\nMSG: sensor_msgs/RegionOfInterest\\nuint32 x_offset\\nuint32 y_offset\\nuint32 height\\nuint32 width\\nbool do_rectify'
INFO = 'std_msgs/Header header\\nuint32 height\\nuint32 width\\nstring distortion_model\\nfloat64[] d\\nfloat64[9] k\\nfloat64[9] r\\nfloat64[12] p\\nuint32 binning_x\\nuint32 binning_y\\nsensor_msgs/RegionOfInterest roi' + PARTS + ROI
for name, compression, metres in [('none', CompressionType.NONE, False), ('zstd', CompressionType.ZSTD, True), ('lz4', CompressionType.LZ4, False)]:
    with open(f'{{sys.argv[1]}}/{{name}}.mcap', 'wb') as f:
        w = Writer(f, compression=compression)
        image, info = w.register_msgdef('sensor_msgs/msg/Image', IMAGE), w.register_msgdef('sensor_msgs/msg/CameraInfo', INFO)
        text = w.register_msgdef('std_msgs/msg/String', 'string data')
        def head(k, d=0): s, n = stamp(k, d); return {{'stamp': {{'sec': s, 'nanosec': n}}, 'frame_id': 'cam'}}
        def put(topic, k, a, encoding, d=0):
            s, n = stamp(k, d)
            w.write_message(topic, image, {{'header': head(k, d), 'height': a.shape[0], 'width': a.shape[1], 'encoding': encoding,
                'is_bigendian': 0, 'step': a.strides[0], 'data': a.tobytes()}}, log_time=s * 10**9 + n)
        for k in range(N):
            w.write_message('/chatter', text, {{'data': 'x'}}, log_time=k)
            put('/camera/color/image_raw', k, colour(k), 'rgb8')
            w.write_message('/camera/infra1/camera_info', info, {{'header': head(k), 'height': H, 'width': W, 'distortion_model': 'plumb_bob',
                'd': D, 'k': K, 'r': [0.0] * 9, 'p': [0.0] * 12, 'binning_x': 0, 'binning_y': 0,
                'roi': {{'x_offset': 0, 'y_offset': 0, 'height': 0, 'width': 0, 'do_rectify': False}}}}, log_time=k)
            put('/camera/infra1/image_rect_raw', k, grey(k), 'mono16')
            d = (depth(k) / np.float32(1000)).astype(np.float32) if metres else depth(k)
            put('/camera/depth/image_rect_raw', k, d, '32FC1' if metres else '16UC1', 4_000_000)
        w.finish()
"
    );
    python.run(&code, &[&folder]);
    for (name, floating) in [("none", false), ("zstd", true), ("lz4", false)] {
        let out = folder.join(name);
        let result = imported(&folder.join(format!("{name}.mcap")), &out, &ImportOptions::default());
        assert_eq!(result.image.name, "/camera/infra1/image_rect_raw");
        assert_eq!(result.depth.as_ref().unwrap().name, "/camera/depth/image_rect_raw");
        assert_eq!(result.streams.len(), 3);
        check(&out, &result, floating);
    }
    // Streams by name; and the names are listed where there is none of it.
    let colour = ImportOptions { image: Some("/camera/color/image_raw".into()), ..ImportOptions::default() };
    let result = imported(&folder.join("none.mcap"), &folder.join("colour"), &colour);
    // Depth of another size is that of another camera.
    assert!(result.depth.is_some() && result.is_rig && result.camera.is_none());
    let wrong = ImportOptions { image: Some("/nowhere".into()), ..ImportOptions::default() };
    let message = import(&folder.join("none.mcap"), &folder.join("no"), &wrong).unwrap_err().to_string();
    assert!(message.contains("/nowhere") && message.contains("/camera/infra1/image_rect_raw"), "{message}");
    // Fewer frames: spread over the recording.
    let few = ImportOptions { frames: 3, ..ImportOptions::default() };
    assert_eq!(imported(&folder.join("none.mcap"), &folder.join("few"), &few).frames, 3);
    // Cut off and changed files are errors or fewer frames, never a panic.
    let bytes = std::fs::read(folder.join("lz4.mcap")).unwrap();
    for (i, length) in [20, 200, bytes.len() / 2, bytes.len() - 5].into_iter().enumerate() {
        let path = folder.join(format!("cut{i}.mcap"));
        std::fs::write(&path, &bytes[..length]).unwrap();
        let _ = import(&path, &folder.join(format!("cut{i}")), &ImportOptions::default());
        let mut changed = bytes.clone();
        changed[length] ^= 0x55;
        std::fs::write(&path, &changed).unwrap();
        let _ = import(&path, &folder.join(format!("changed{i}")), &ImportOptions::default());
    }
}

/// Writes the scene with `rosbags`; `kind` is the writer's module, store and call.
fn with_rosbags(folder: &Path, python: &python::Python, ros1: bool) {
    let (open, store, serialize, extra) = if ros1 {
        (
            "from rosbags.rosbag1 import Writer\nw = Writer(f'{sys.argv[1]}/scene.bag')\nw.set_compression(Writer.CompressionFormat.LZ4)",
            "ROS1_NOETIC",
            "serialize_ros1",
            "{'seq': k}",
        )
    } else {
        (
            "from rosbags.rosbag2 import Writer\nw = Writer(f'{sys.argv[1]}/scene', version=9)",
            "ROS2_HUMBLE",
            "serialize_cdr",
            "{}",
        )
    };
    let code = format!(
        "{SCENE}
from rosbags.typesys import Stores, get_typestore
ts = get_typestore(Stores.{store})
T = ts.types
{open}
info_type = T['sensor_msgs/msg/CameraInfo']
roi = T['sensor_msgs/msg/RegionOfInterest'](0, 0, 0, 0, False)
def head(k, d=0): s, n = stamp(k, d); return T['std_msgs/msg/Header'](stamp=T['builtin_interfaces/msg/Time'](s, n), frame_id='cam', **{extra})
def image(k, a, encoding, d=0):
    return T['sensor_msgs/msg/Image'](head(k, d), a.shape[0], a.shape[1], encoding, 0, a.strides[0], np.frombuffer(a.tobytes(), np.uint8))
def info(k):
    a = [np.array(D), np.array(K), np.zeros(9), np.zeros(12)]
    return info_type(head(k), H, W, 'plumb_bob', *a, 0, 0, roi)
topics = {{'/camera/infra1/image_rect_raw': 'Image', '/camera/depth/image_rect_raw': 'Image', '/camera/infra1/camera_info': 'CameraInfo'}}
with w:
    c = {{t: w.add_connection(t, f'sensor_msgs/msg/{{n}}', typestore=ts) for t, n in topics.items()}}
    def put(topic, k, message, d=0):
        s, n = stamp(k, d)
        w.write(c[topic], s * 10**9 + n, ts.{serialize}(message, message.__msgtype__))
    for k in range(N):
        put('/camera/infra1/camera_info', k, info(k))
        put('/camera/infra1/image_rect_raw', k, image(k, grey(k), 'mono16'))
        put('/camera/depth/image_rect_raw', k, image(k, depth(k), '16UC1', 4_000_000), 4_000_000)
"
    );
    python.run(&code, &[folder]);
}

#[test]
fn bags_of_ros_1() {
    let Some(python) = python::with_modules(&["rosbags", "numpy"]) else { return };
    let folder = python::folder("bag1");
    with_rosbags(&folder, &python, true);
    let out = folder.join("out");
    let result = imported(&folder.join("scene.bag"), &out, &ImportOptions::default());
    check(&out, &result, false);
    let bytes = std::fs::read(folder.join("scene.bag")).unwrap();
    for (i, length) in [20, 5000, bytes.len() / 2].into_iter().enumerate() {
        let path = folder.join(format!("cut{i}.bag"));
        std::fs::write(&path, &bytes[..length]).unwrap();
        let _ = import(&path, &folder.join(format!("cut{i}")), &ImportOptions::default());
    }
}

#[test]
fn bags_of_ros_2() {
    let Some(python) = python::with_modules(&["rosbags", "numpy"]) else { return };
    let folder = python::folder("bag2");
    with_rosbags(&folder, &python, false);
    let bags: Vec<PathBuf> = std::fs::read_dir(folder.join("scene")).unwrap().map(|e| e.unwrap().path()).collect();
    let bag = bags.iter().find(|path| path.extension().is_some_and(|e| e == "db3")).unwrap();
    let out = folder.join("out");
    let result = imported(bag, &out, &ImportOptions::default());
    check(&out, &result, false);
}

/// A recording of an Azure Kinect, from the tests of pyk4a.
#[test]
fn matroska_of_an_azure_kinect() {
    let Some(recording) = python::measured("azure_kinect/recording.mkv") else { return };
    let folder = python::folder("mkv");
    let result = imported(&recording, &folder, &ImportOptions { frames: 5, ..ImportOptions::default() });
    assert_eq!(result.image.name, "IR");
    assert_eq!(result.depth.as_ref().unwrap().name, "DEPTH");
    assert!(result.frames >= 1, "{result:?}");
    let camera = result.camera.unwrap();
    assert_eq!(camera.distortion.len(), 8);
    let size = result.streams.iter().find(|(stream, _)| stream.name == "IR").unwrap().1;
    assert_eq!([camera.width, camera.height], size);
    // The narrow mode at full resolution: a focal length of some 500 px, in a window that is not cut around the axis.
    let [fx, fy, cx, cy] = camera.pinhole;
    assert!(
        (fx - fy).abs() < 2.0
            && (450.0..550.0).contains(&fx)
            && (cx / size[0] as f64 - 0.5).abs() < 0.05
            && (cy / size[1] as f64 - 0.5).abs() < 0.12
    );
    assert!(folder.join("factory_calibration.json").is_file() && folder.join("camera_info.yaml").is_file());
    let depth = read_depth_frame(folder.join("depth/0001.png")).unwrap();
    assert_eq!([depth.width, depth.height], size);
    // 16 bits, big-endian in the file: read the other way round, depth would be noise over the whole range.
    let mut valid: Vec<f64> = (0..depth.len()).filter_map(|i| depth.measurement(i)).collect();
    valid.sort_by(f64::total_cmp);
    assert!(valid.len() > 1000 && valid[valid.len() / 2] > 100.0 && valid[valid.len() * 99 / 100] < 12_000.0);
    let image = read_gray(folder.join("image/0001.png")).unwrap();
    assert_eq!(([image.width, image.height], image.bits), (size, 16));
}

#[test]
fn what_is_no_recording() {
    let folder = python::folder("no-recording");
    std::fs::write(folder.join("a.txt"), "hello").unwrap();
    let message = |name: &str| import(&folder.join(name), &folder, &ImportOptions::default()).unwrap_err().to_string();
    assert!(message("a.txt").contains("MCAP") && message("a.txt").contains("a.txt"));
    assert!(message("none").contains("cannot read"));
    std::fs::write(folder.join("a.mkv"), b"\x1a\x45\xdf\xa3 and nothing else").unwrap();
    assert!(message("a.mkv").contains("damaged"));
    std::fs::write(folder.join("a.db3"), b"SQLite format 3\0 and nothing else").unwrap();
    assert!(message("a.db3").contains("damaged"));
}
