//! Files that are refused, with what they say.

use super::*;

const K: &str = "[525., 0., 319.5, 0., 525., 239.5, 0., 0., 1.]";

#[test]
fn a_lens_that_is_not_recognised_is_refused_with_the_keys() {
    let message = fails(&format!("K: {K}\nlens_polynomial: [0.1, 0.2]\nimg_size: [640, 480]\n"));
    assert!(
        message.contains(
            "camera.yaml: no lens is recognised beside `K`, only the keys K, lens_polynomial, img_size: call"
        ),
        "{message}"
    );
    assert!(
        message.contains("write `distortion_coefficients: [0, 0, 0, 0, 0]` for a camera without distortion"),
        "{message}"
    );
    // A camera of a stereo file without its own coefficients does not take the other's.
    let stereo = format!("M1: {K}\nD1: [0.1, 0, 0, 0]\nM2: {K}\n");
    let second = parse_camera(Path::new("stereo.yml"), &stereo, Some("M2")).unwrap_err().to_string();
    assert!(second.contains("no lens is recognised beside `M2`"), "{second}");
    let open3d = "{\"width\": 640, \"height\": 480, \"intrinsic_matrix\": [525, 0, 0, 0, 525, 0, 319.5, 239.5, 1], \"dist\": [0.1]}";
    assert!(fails(open3d).contains("no lens is recognised beside `intrinsic_matrix`"), "{}", fails(open3d));
    let realsense = "{\"ppx\": 319.5, \"ppy\": 239.5, \"fx\": 525.0, \"fy\": 525.0}";
    assert!(fails(realsense).contains("no lens is recognised beside `fx`"));
    let kalibr = "cam0:\n  camera_model: pinhole\n  intrinsics: [5, 5, 3, 2]\n  distortion_coeffs: [0.1, 0, 0, 0]\n";
    assert!(fails(kalibr).contains("no lens is recognised beside `cam0.intrinsics`"), "{}", fails(kalibr));
}

#[test]
fn counts_and_models_of_coefficients() {
    let opencv = |lens: &str| fails(&format!("K: {K}\n{lens}\n"));
    assert!(opencv("dist: [0.1, 0.2, 0.3]").contains("`dist` has 3 numbers, expected 4, 5, 8, 12 or 14 of OpenCV's"));
    assert!(opencv("dist: [0.1, 0, 0, 0, 0.1]\nfisheye_model: 1").contains("has 5 numbers, expected 4, k1 to k4"));
    assert!(opencv("d: [0.1, 0, 0, 0]\ndistortion_model: ''").contains("`distortion_model` is empty"));
    let eight = opencv("d: [1, 2, 3, 4, 5, 6, 7, 8]\ndistortion_model: plumb_bob");
    assert!(
        eight.contains("has 8 numbers, expected 4 or 5") && eight.contains("name the model rational_polynomial"),
        "{eight}"
    );
    assert!(opencv("d: [0.1, 0, 0, 0]\ndistortion_model: none").contains("is not zero, but the lens model is none"));
    assert!(opencv("d: [0.1, 0, 0, 0]\ncamera_model: ds").contains("model ds is not supported"));
    let twice = opencv("dist: [0.1, 0, 0, 0]\nD: [0.2, 0, 0, 0]");
    assert!(twice.contains("`dist` and `D` are different: leave one of them out"), "{twice}");
    assert!(
        opencv("k1: 0.1\nk2: 0.1\nk3: 0.1\nk4: 0.1").contains("`k4` stands without k5 and k6: name the lens model")
    );
}

#[test]
fn matrices_that_are_none() {
    let transposed = fails("K: [525., 0., 0., 0., 525., 0., 319.5, 239.5, 1.]\nD: [0, 0, 0, 0]\n");
    assert!(transposed.contains("`K` is no camera matrix") && transposed.contains("looks transposed"), "{transposed}");
    let zero = fails("k: [0, 0, 0, 0, 0, 0, 0, 0, 1]\nd: []\ndistortion_model: plumb_bob\n");
    assert!(zero.contains("`k` is zero, as drivers write for a camera without a calibration"), "{zero}");
    assert!(fails("K: [5, 5, 3, 2]\nD: [0, 0, 0, 0]\n").contains("`K` has 4 numbers, expected 9"));
    assert!(fails(&format!("K: {K}\nD: [0, 0, 0, 0]\nwidth: 640\n")).contains("`width` stands alone"));
}

#[test]
fn files_of_other_kinds_are_named() {
    let message = fails("{\"format\": \"depthcal-calibration\", \"version\": 2}");
    assert!(message.contains("`depthcal export` writes a camera file of a calibration"), "{message}");
    assert!(fails("{\"camera_angle_x\": 0.7, \"frames\": []}").contains("write w, h, fl_x, fl_y, cx and cy"));
    assert!(fails("D: [0, 0, 0, 0]\n").contains("there is a lens, but no camera matrix"));
    let json = parse_camera(Path::new("camera.json"), "{\"K\": [1, 2,, 3]}", None).unwrap_err().to_string();
    assert!(json.contains("is no valid JSON: expected value at line 1 column 13"), "{json}");
    assert!(fails("<opencv_storage><K>1</opencv_storage>").contains("is no valid XML"));
    let folder = tempfile::tempdir().unwrap();
    let zip = folder.path().join("camera.npz");
    std::fs::write(&zip, b"PK\x03\x04\xff\xfe").unwrap();
    let message = read_camera(&zip).unwrap_err().to_string();
    assert!(message.contains("camera.npz: is binary, not text: write matrix and coefficients"), "{message}");
}

#[test]
fn json_and_xml_that_would_fill_the_stack_are_refused() {
    let json = format!("{{\"a\": {}1{}}}", "[".repeat(60), "]".repeat(60));
    assert!(fails(&json).contains("has more than 32 lists or objects"), "{}", fails(&json));
    let xml = format!("{}{}", "<a>".repeat(60), "</a>".repeat(60));
    assert!(fails(&xml).contains("has more than 32 elements"), "{}", fails(&xml));
    let deep = format!("{}{}", "<a>".repeat(90_000), "</a>".repeat(90_000));
    assert!(fails(&deep).contains("has more than 32 elements") || fails(&deep).contains("is no valid XML"));
}

#[test]
fn yaml_that_would_fill_stack_or_memory_is_refused() {
    let message = fails(&format!("a: {}{}", "[".repeat(100), "]".repeat(100)));
    assert!(message.contains("camera.yaml: line 1: has more than 32 lists"), "{message}");
    let message = fails(&format!("a: {}", "[".repeat(100_000)));
    assert!(message.contains("camera.yaml") && message.contains("recursion limit"), "{message}");
    let deep = (0..100).map(|i| format!("{}- a:\n", "  ".repeat(2 * i))).collect::<String>();
    assert!(fails(&deep).contains("has more than 32 lists"));
    // Each line ten times the one before: 10⁹ numbers.
    let bomb: String = (1..10).map(|i| format!("a{i}: &a{i} [{}]\n", format!("*a{},", i - 1).repeat(10))).collect();
    let message = fails(&format!("a0: &a0 [1]\n{bomb}"));
    assert!(message.contains("line 7: has more than 1000000 values, its aliases (*NAME) written out"), "{message}");
    // Each list in the one before, by aliases.
    let deep: String = (1..100).map(|i| format!("a{i}: &a{i} [*a{}]\n", i - 1)).collect();
    assert!(fails(&format!("a0: &a0 [1]\n{deep}")).contains("has more than 32 lists"));
}

#[test]
fn sizes_that_no_image_has_are_refused() {
    let kalibr = |size: &str| {
        format!("cam0:\n  camera_model: pinhole\n  intrinsics: [5.0, 5.0, 3.0, 2.0]\n  resolution: {size}\n")
    };
    let mrcal = |size: &str| {
        format!("{{ 'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [5, 5, 3, 2], 'imagersize': {size} }}")
    };
    let ros = |size: &str| {
        let [width, height] = size.trim_matches(['[', ']']).split_once(',').map(|(w, h)| [w, h]).unwrap();
        format!(
            "image_width: {width}\nimage_height: {height}\ncamera_matrix:\n  data: [5, 0, 3, 0, 5, 2, 0, 0, 1]\n\
             distortion_model: plumb_bob\n"
        )
    };
    for size in ["[1e300,480]", "[60000,60000]", "[640.5,480]", "[0,480]", "[-640,480]"] {
        for (text, field) in [(kalibr(size), "resolution"), (mrcal(size), "imagersize"), (ros(size), "image_width")] {
            let message = fails(&text);
            assert!(message.contains(field) && message.contains("px"), "{size}: {message}");
        }
    }
    let message = fails("1 PINHOLE 4294967295 4294967295 5 5 3 2\n");
    assert!(message.contains("camera 1: WIDTH") && message.contains("px"), "{message}");
}
