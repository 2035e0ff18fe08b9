//! Folders of image files: every frame is imported with the depth of its time, in the folder's unit; what cannot be read is
//! refused with its cause and what to do.

use std::fs;
use std::path::Path;

use depthcal_import::{ImportOptions, Imported, import};
use depthcal_io::{
    Dataset, DatasetCamera, DepthFrame, DepthImage, DepthValues, GrayImage, read_depth_frame, write_depth, write_gray,
};
use tempfile::TempDir;

const FRAMES: usize = 6;

/// Images of a bright bar whose place depends on the number, so that all frames differ.
fn image(folder: &Path, name: &str, [width, height]: [usize; 2], k: usize) {
    let data = (0..width * height).map(|i| if 8 * (i % width) / width == k { 200 } else { 40 }).collect();
    write_gray(folder.join(name), &GrayImage { width, height, data, bits: 8 }).unwrap();
}

fn steps(size: [usize; 2], k: usize) -> Vec<u16> {
    (0..size[0] * size[1]).map(|i| (3000 + 100 * k + i % 977) as u16).collect()
}

fn depth(folder: &Path, name: &str, [width, height]: [usize; 2], k: usize) {
    write_depth(folder.join(name), &DepthImage { width, height, data: steps([width, height], k) }).unwrap();
}

fn folders(root: &Path, names: &[&str]) {
    names.iter().for_each(|name| fs::create_dir_all(root.join(name)).unwrap());
}

fn imported(folder: &Path, out: &Path) -> (Imported, Vec<DatasetCamera>) {
    let imported = import(folder, out, &ImportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let path = out.join("dataset.toml");
    let board = "[board]\nkind = \"chessboard\"\ncolumns = 8\nrows = 5\nspacing_mm = 20.0\n";
    fs::write(&path, format!("{board}{}", fs::read_to_string(&path).unwrap())).unwrap();
    (imported, Dataset::open(out).unwrap().cameras)
}

fn complaint(folder: &Path) -> String {
    let out = TempDir::new().unwrap();
    import(folder, out.path(), &ImportOptions::default()).unwrap_err().to_string()
}

/// The depth of every frame is that of its image.
fn check_depth(camera: &DatasetCamera, size: [usize; 2], expected: impl Fn(usize) -> Vec<u16>) {
    assert_eq!(camera.frames.len(), FRAMES);
    for (k, frame) in camera.frames.iter().enumerate() {
        let depth = read_depth_frame(frame.depth.as_ref().unwrap()).unwrap();
        assert_eq!([depth.width, depth.height], size);
        assert_eq!(depth.values, DepthValues::Steps(expected(k)), "frame {k}");
    }
}

/// Times of depth are 11 ms later, and there is one more image, without depth.
fn tum(root: &Path) {
    folders(root, &["rgb", "depth"]);
    let (mut rgb, mut of_depth) =
        (String::from("# color images\n# timestamp filename\n"), String::from("# depth maps\n"));
    for k in 0..=FRAMES {
        let time = 1_305_031_102.175 + 0.033 * k as f64;
        image(root, &format!("rgb/{k}.png"), [64, 48], k);
        rgb += &format!("{time:.6} rgb/{k}.png\n");
        if k < FRAMES {
            depth(root, &format!("depth/d{k}.png"), [64, 48], k);
            of_depth += &format!("{:.6} depth/d{k}.png\n", time + 0.011);
        }
    }
    fs::write(root.join("rgb.txt"), rgb).unwrap();
    fs::write(root.join("depth.txt"), of_depth).unwrap();
}

#[test]
fn a_tum_folder_is_paired_by_time() {
    let (root, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    tum(root.path());
    let (imported, cameras) = imported(root.path(), out.path());
    assert_eq!((imported.frames, imported.without_depth, imported.is_rig), (FRAMES, 1, false));
    assert_eq!(cameras[0].depth_unit_mm, Some(0.2));
    check_depth(&cameras[0], [64, 48], |k| steps([64, 48], k));
    let times: Vec<f64> = cameras[0].frames.iter().map(|frame| frame.metadata.timestamp_s.unwrap()).collect();
    assert!(times.iter().enumerate().all(|(k, time)| (time - 0.033 * k as f64).abs() < 2e-6), "{times:?}");
}

#[test]
fn a_list_of_associations_is_read_whichever_comes_first() {
    for depth_first in [false, true] {
        let (root, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
        tum(root.path());
        let pair = |k: usize| {
            let [a, b] = [format!("{k}.0 rgb/{k}.png"), format!("{k}.001 depth/d{k}.png")];
            if depth_first { format!("{b} {a}\n") } else { format!("{a} {b}\n") }
        };
        fs::write(root.path().join("associations.txt"), (0..FRAMES).map(pair).collect::<String>()).unwrap();
        ["rgb.txt", "depth.txt"].iter().for_each(|name| fs::remove_file(root.path().join(name)).unwrap());
        let (_, cameras) = imported(root.path(), out.path());
        check_depth(&cameras[0], [64, 48], |k| steps([64, 48], k));
    }
}

#[test]
fn faults_of_a_tum_folder_are_named() {
    let root = TempDir::new().unwrap();
    tum(root.path());
    fs::remove_file(root.path().join("depth/d2.png")).unwrap();
    let message = complaint(root.path());
    assert!(
        message.contains("depth.txt") && message.contains("line 4") && message.contains("depth/d2.png"),
        "{message}"
    );
    fs::write(root.path().join("depth.txt"), "1.0 ../secret.png\n").unwrap();
    assert!(complaint(root.path()).contains("not in the folder"));
    fs::write(root.path().join("depth.txt"), "one depth/d0.png\n").unwrap();
    assert!(complaint(root.path()).contains("'one depth/d0.png'"));
    fs::remove_file(root.path().join("depth.txt")).unwrap();
    assert!(complaint(root.path()).contains("no depth.txt"));
}

/// Images of 192×144 px and depth of a third of that, whose left half is not to be trusted.
fn stray(root: &Path, first_image: usize) {
    folders(root, &["rgb", "depth", "confidence"]);
    let mut odometry = String::from("timestamp, frame, x, y, z, qx, qy, qz, qw\n");
    for k in 0..FRAMES {
        image(root, &format!("rgb/{:06}.png", k + first_image), [192, 144], k);
        depth(root, &format!("depth/{k:06}.png"), [64, 48], k);
        let data = (0..64 * 48).map(|i| if i % 64 < 32 { 0 } else { 2 }).collect();
        let confidence = GrayImage { width: 64, height: 48, data, bits: 8 };
        write_gray(root.join(format!("confidence/{k:06}.png")), &confidence).unwrap();
        odometry += &format!("{}, {k:06}, 0, 0, 0, 0, 0, 0, 1\n", 45_000.5 + k as f64 / 60.0);
    }
    fs::write(root.join("odometry.csv"), odometry).unwrap();
    fs::write(root.join("camera_matrix.csv"), "150.0, 0.0, 95.5\n0.0, 151.0, 71.0\n0.0, 0.0, 1.0\n").unwrap();
}

#[test]
fn a_stray_scanner_folder_is_a_rig_of_image_and_depth() {
    // ffmpeg counts frames from 1 if it is not told otherwise.
    for first_image in [0, 1] {
        let (root, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
        stray(root.path(), first_image);
        let (imported, cameras) = imported(root.path(), out.path());
        assert!(imported.is_rig && imported.unit_mm == Some(1.0) && cameras.len() == 2);
        let trusted =
            |k: usize| steps([64, 48], k).iter().enumerate().map(|(i, z)| if i % 64 < 32 { 0 } else { *z }).collect();
        check_depth(&cameras[1], [64, 48], trusted);
        let [of_image, of_depth] = [0, 1].map(|i| cameras[i].camera.clone().unwrap().numbers.unwrap());
        assert_eq!([of_image.fx, of_image.fy, of_image.cx, of_image.cy], [150.0, 151.0, 95.5, 71.0]);
        // The middle of the image stays the middle: (95.5 + 0.5) / 3 − 0.5.
        let third =
            [of_depth.fx - 50.0, of_depth.fy - 151.0 / 3.0, of_depth.cx - 31.5, of_depth.cy - (71.5 / 3.0 - 0.5)];
        assert!(third.iter().all(|difference| difference.abs() < 1e-9), "{of_depth:?}");
    }
}

#[test]
fn a_video_is_refused_with_the_command_that_extracts_its_frames() {
    let root = TempDir::new().unwrap();
    stray(root.path(), 0);
    fs::remove_dir_all(root.path().join("rgb")).unwrap();
    fs::write(root.path().join("rgb.mp4"), b"....ftyp").unwrap();
    let message = complaint(root.path());
    assert!(
        message.contains("rgb.mp4") && message.contains("ffmpeg") && message.contains("-start_number 0"),
        "{message}"
    );
    // Players turn the video upright.
    folders(root.path(), &["rgb"]);
    (0..FRAMES).for_each(|k| image(root.path(), &format!("rgb/{k:06}.png"), [144, 192], k));
    let message = complaint(root.path());
    assert!(message.contains("turned by 90°") && message.contains("-noautorotate"), "{message}");
}

fn metres(k: usize) -> Vec<f32> {
    (0..48 * 64).map(|i| if i == 5 { f32::NAN } else { 0.5 + 0.01 * k as f32 + 1e-5 * i as f32 }).collect()
}

/// The contents of an `.r3d` file, upright: images of 144×192 px, depth of a third of that in metres.
fn record3d(root: &Path, metadata: &str) {
    folders(root, &["rgbd"]);
    for k in 0..FRAMES {
        image(root, &format!("rgbd/{k}.png"), [144, 192], k);
        let bytes: Vec<u8> = metres(k).iter().flat_map(|z| z.to_le_bytes()).collect();
        let confidences: Vec<u8> = (0..48 * 64).map(|i| if i == 7 { 0 } else { 1 }).collect();
        for (extension, contents) in [("depth", bytes), ("conf", confidences)] {
            let mut packed = Vec::new();
            lzfse_rust::encode_bytes(&contents, &mut packed).unwrap();
            fs::write(root.join(format!("rgbd/{k}.{extension}")), packed).unwrap();
        }
    }
    fs::write(root.join("metadata"), metadata).unwrap();
}

/// K is written by columns.
const METADATA: &str = r#"{"w": 144, "h": 192, "fps": 60, "K": [150.0, 0, 0, 0, 151.0, 0, 71.5, 95.0, 1]"#;

#[test]
fn the_contents_of_an_r3d_file_are_read_with_and_without_the_size_of_depth() {
    for size in ["", r#", "dw": 48, "dh": 64"#] {
        let (root, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
        record3d(root.path(), &format!("{METADATA}{size}}}"));
        let (imported, cameras) = imported(root.path(), out.path());
        assert!(imported.is_rig && imported.unit_mm == Some(1000.0));
        let numbers = cameras[0].camera.clone().unwrap().numbers.unwrap();
        assert_eq!([numbers.fx, numbers.fy, numbers.cx, numbers.cy], [150.0, 151.0, 71.5, 95.0]);
        for (k, frame) in cameras[1].frames.iter().enumerate() {
            let DepthFrame { width, height, values } = read_depth_frame(frame.depth.as_ref().unwrap()).unwrap();
            let DepthValues::Float(read) = values else { panic!("not metres") };
            assert_eq!((width, height), (48, 64));
            let expected = metres(k);
            let is_right = |i: usize| if [5, 7].contains(&i) { !(read[i] > 0.0) } else { read[i] == expected[i] };
            assert!((0..48 * 64).all(is_right), "frame {k}");
            assert!((frame.metadata.timestamp_s.unwrap() - k as f64 / 60.0).abs() < 2e-6);
        }
    }
}

#[test]
fn faults_of_an_export_of_record3d_are_named() {
    let root = TempDir::new().unwrap();
    record3d(root.path(), &format!("{METADATA}, \"dw\": 50, \"dh\": 64}}"));
    assert!(complaint(root.path()).contains("50×64"));
    fs::write(root.path().join("rgbd/0.depth"), b"no compressed data").unwrap();
    let message = complaint(root.path());
    assert!(message.contains("0.depth") && message.contains("export it anew"), "{message}");
    fs::write(root.path().join("metadata"), "{").unwrap();
    assert!(complaint(root.path()).contains("not JSON"));
    let archive = root.path().join("scan.r3d");
    fs::write(&archive, b"PK\x03\x04 and more of an archive").unwrap();
    assert!(complaint(&archive).contains("unzip it"));
}
