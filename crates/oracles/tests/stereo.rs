//! The image part of a rig against OpenCV's stereoCalibrate: the same observations, the same optimum.

use depthcal_calibration::adjust::adjustment::Adjustment;
use depthcal_calibration::calibrate::{CalibrateOptions, calibrate};
use depthcal_calibration::observe::Capture;
use depthcal_calibration::rig_simulated::rig_capture;
use depthcal_simulate::{Kind, PointOptions, RigCamera, RigSimulation};
use opencv::core::{Mat, MatTraitConst, MatTraitConstManual, Point2f, Point3f, Size, TermCriteria, Vector};

/// Infrared and colour by points, of which only markers are kept that both cameras see, in single precision, as OpenCV takes
/// them.
fn observed() -> Capture {
    let camera = |name: &str| RigCamera::usual(name, 1).unwrap().unwrap();
    let rig = RigSimulation::new(vec![camera("infrared"), camera("colour")], Kind::General(1), 4);
    let mut capture = rig_capture(&rig.observe_points(&PointOptions::default()).unwrap());
    let seen = |capture: &Capture, camera: usize| -> std::collections::BTreeSet<(String, usize)> {
        let frames = &capture.cameras[camera].capture.frames;
        frames.iter().flat_map(|f| f.markers.iter().map(|m| (f.name.clone(), m.index))).collect()
    };
    let both: std::collections::BTreeSet<_> = seen(&capture, 0).intersection(&seen(&capture, 1)).cloned().collect();
    for camera in &mut capture.cameras {
        for frame in &mut camera.capture.frames {
            let name = frame.name.clone();
            frame.markers.retain(|m| both.contains(&(name.clone(), m.index)));
            frame.markers.iter_mut().for_each(|m| m.pixel = m.pixel.map(|c| f64::from(c as f32)));
            frame.raw.depth = depthcal_calibration::observe::MeasuredDepth::None;
        }
        camera.capture.frames.retain(|frame| frame.markers.len() >= 20);
    }
    let names: Vec<std::collections::BTreeSet<String>> =
        capture.cameras.iter().map(|c| c.capture.frames.iter().map(|f| f.name.clone()).collect()).collect();
    capture.subset(|name| names.iter().all(|others| others.contains(name)))
}

/// Our least squares, without losses: all residuals are far inside the quadratic part of the loss with a large standard
/// deviation.
fn plain_least_squares(capture: &Capture) -> (Vec<f64>, Vec<[f64; 6]>, f64) {
    const SIGMA_PX: f64 = 10.0;
    let options = CalibrateOptions { lens: Some("brown-conrady:full".to_owned()), ..CalibrateOptions::default() };
    let fit = calibrate(capture, &options).unwrap();
    let mut state = fit.state;
    state.cameras.iter_mut().for_each(|camera| camera.noise.pixel_sigma = SIGMA_PX);
    let adjusted = Adjustment::of_state(&state, true).unwrap().solve_within(0.0).unwrap();
    let squares =
        adjusted.cameras.iter().flat_map(|camera| &camera.image_residuals).map(|r| (r * SIGMA_PX).powi(2)).sum::<f64>();
    let count = adjusted.cameras.iter().map(|camera| camera.image_residuals.len() / 2).sum::<usize>();
    let pose = |p: &nalgebra::Isometry3<f64>| {
        let (r, t) = (p.rotation.scaled_axis(), p.translation.vector);
        [r.x, r.y, r.z, t.x, t.y, t.z]
    };
    let places = adjusted.cameras.iter().map(|camera| pose(&camera.camera_from_rig)).collect();
    let theta = adjusted.cameras.iter().flat_map(|camera| camera.camera.theta()).collect();
    (theta, places, (squares / count as f64).sqrt())
}

fn numbers(mat: &Mat) -> Vec<f64> {
    mat.data_typed::<f64>().unwrap().to_vec()
}

#[test]
fn the_optimum_is_that_of_opencv() {
    let capture = observed();
    let target = &capture.cameras[0].capture.target;
    let (theta, places, rms_px) = plain_least_squares(&capture);
    let mut objects: Vector<Vector<Point3f>> = Vector::new();
    let mut images: [Vector<Vector<Point2f>>; 2] = [Vector::new(), Vector::new()];
    for (number, frame) in capture.cameras[0].capture.frames.iter().enumerate() {
        let point = |index: usize| target.point(index).map(|c| c as f32);
        objects.push(frame.markers.iter().map(|m| point(m.index)).map(|[x, y]| Point3f::new(x, y, 0.0)).collect());
        for (camera, images) in capture.cameras.iter().zip(&mut images) {
            let markers = &camera.capture.frames[number].markers;
            images.push(markers.iter().map(|m| Point2f::new(m.pixel[0] as f32, m.pixel[1] as f32)).collect());
        }
    }
    // Of each camera k1 k2 p1 p2 k3 fx fy cx cy skew; OpenCV starts a per cent off.
    let matrix = |theta: &[f64]| {
        let [fx, fy, cx, cy] = [theta[5], theta[6], theta[7], theta[8]].map(|v| 1.01 * v);
        Mat::from_slice_2d(&[[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]).unwrap()
    };
    let lens = |theta: &[f64]| {
        Mat::from_slice(&theta[..5].iter().map(|k| 0.9 * k).collect::<Vec<_>>()).unwrap().try_clone().unwrap()
    };
    let (ours, theirs) = theta.split_at(10);
    let (mut k1, mut d1, mut k2, mut d2) = (matrix(ours), lens(ours), matrix(theirs), lens(theirs));
    let (mut r, mut t, mut e, mut f) = (Mat::default(), Mat::default(), Mat::default(), Mat::default());
    let criteria =
        TermCriteria::new(opencv::core::TermCriteria_COUNT + opencv::core::TermCriteria_EPS, 2000, 1e-16).unwrap();
    let opencv_px = opencv::calib3d::stereo_calibrate(
        &objects,
        &images[0],
        &images[1],
        &mut k1,
        &mut d1,
        &mut k2,
        &mut d2,
        Size::new(640, 480),
        &mut r,
        &mut t,
        &mut e,
        &mut f,
        opencv::calib3d::CALIB_USE_INTRINSIC_GUESS,
        criteria,
    )
    .unwrap();
    // OpenCV's root mean square is over all points of both cameras.
    assert!((rms_px / opencv_px - 1.0).abs() < 1e-6, "{rms_px} against {opencv_px}");
    let near = |what: &str, a: f64, b: f64, scale: f64| {
        assert!((a - b).abs() <= 1e-6 * scale, "{what}: {a} against OpenCV's {b}");
    };
    for (theta, (k, d)) in [ours, theirs].into_iter().zip([(&k1, &d1), (&k2, &d2)]) {
        let (k, d) = (numbers(k), numbers(d));
        for (i, place) in [(5, 0), (6, 4), (7, 2), (8, 5)] {
            near("pinhole", theta[i], k[place], theta[5]);
        }
        // OpenCV's order is ours. Coefficients of r⁶ hardly matter: all are compared as displacements at the image's corner.
        for i in 0..5 {
            near("lens", theta[i], d[i], 10.0);
        }
    }
    let t = numbers(&t);
    let rotation = nalgebra::Matrix3::from_row_slice(&numbers(&r));
    let axis = nalgebra::Rotation3::from_matrix_unchecked(rotation).scaled_axis();
    for i in 0..3 {
        near("translation", places[1][3 + i], t[i], places[1][3]);
        near("rotation", places[1][i], axis[i], 1.0);
    }
}
