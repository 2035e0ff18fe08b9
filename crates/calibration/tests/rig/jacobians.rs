//! The rig's factors against finite differences.

use std::sync::Arc;

use depthcal_calibration::adjust::factors::{CameraVariables, FrameGroup, FrameView, ObservationBatch, Observations};
use depthcal_calibration::observe::board_motion::BoardMotion;
use depthcal_model::chain::DepthQuery;
use depthcal_model::{Block, Context, Register};
use depthcal_solver::{Graph, Loss, Values, check_jacobians};
use nalgebra::{DVector, Isometry3, Vector3};

/// Derivatives by both poses, by the drift of the place, by the offset of the time and by the camera's parameters are those of
/// finite differences, for markers and for depth, of the reference and of another camera, whose place drifts or not, and before
/// which the board moves or not.
#[test]
fn derivatives_are_those_of_finite_differences() {
    let register = Register::builtin();
    let block = |name: &str, theta: &[f64]| {
        let mut block: Block = register.block(name, None).unwrap();
        block.theta.copy_from_slice(theta);
        block
    };
    let lens = block("brown_conrady", &[-0.1, 0.02, 1e-3, -5e-4, 0.01]);
    let depth = block("projective", &[2e-5, -1e-5, 3e-5, 1.02]);
    let camera = depthcal_model::Camera::new(640, 480, [500.0, 505.0, 310.0, 245.0, 0.0], vec![lens, depth]);
    let mut values = Values::new();
    let turned = |t: [f64; 3], r: [f64; 3]| Isometry3::new(Vector3::from(t), Vector3::from(r));
    let frame = values.insert(turned([-60.0, 30.0, 700.0], [0.3, -0.4, 0.2]));
    let place = values.insert(turned([-80.0, 20.0, 30.0], [0.1, 0.25, -0.05]));
    let blocks: Vec<_> = camera.blocks().iter().map(|b| values.insert(DVector::from_column_slice(&b.theta))).collect();
    let drift = values.insert(DVector::from_column_slice(&[0.2, -0.1, 0.3, 4.0, -2.0, 1.0]));
    let offset = values.insert(DVector::from_element(1, 0.013));
    let later = |s: f64| turned([-60.0 + 300.0 * s, 30.0 - 200.0 * s, 700.0], [0.3 + 0.8 * s, -0.4, 0.2 - s]);
    let motion = BoardMotion::through(&later(0.0), &[(-0.04, later(-0.04)), (0.03, later(0.03))]).unwrap();
    for (place, drift, offset) in [
        (None, None, None),
        (Some(place), None, None),
        (Some(place), Some(drift), None),
        (Some(place), None, Some(offset)),
        (Some(place), Some(drift), Some(offset)),
    ] {
        let variables = CameraVariables { chain: Arc::new(camera.chain()), extrinsics: place, drift, offset };
        let points = vec![[0.0, 0.0], [120.0, 10.0], [60.0, 90.0]];
        let pixels = vec![[300.0, 200.0], [310.0, 210.0], [250.0, 260.0]];
        let markers = Observations::Markers { points: points.clone(), pixels: pixels.clone(), sigmas: vec![0.1; 3] };
        let query = |point: &[f64; 2]| {
            let pose = place.map_or(*values.get(frame), |p| values.get(p) * values.get(frame));
            let pixel = camera.project(&(pose * nalgebra::Point3::new(point[0], point[1], 0.0)).coords).unwrap();
            DepthQuery { board_seed: *point, context: Context { pixel, ..Context::default() } }
        };
        let depth = Observations::Depth {
            queries: points.iter().map(query).collect(),
            inverse_depths: vec![1.4e-3; 3],
            sigmas: vec![2e-6; 3],
        };
        let mut graph = Graph::new();
        let moving = offset.map(|_| (motion, 0.004));
        let view = FrameView { pose: frame, drifted: 0.7, moving };
        let group = |blocks: &[_], observed| vec![FrameGroup { view, blocks: blocks.into(), observed }];
        let in_image = group(&blocks[..blocks.len() - 1], markers);
        graph.add_batch(ObservationBatch::of_markers("image".into(), variables.clone(), in_image, Loss::Trivial));
        graph.add_batch(ObservationBatch::of_depth("depth".into(), variables, group(&blocks, depth), Loss::Trivial));
        for error in check_jacobians(&graph, &values, 1e-5).unwrap() {
            assert!(error.error < 1e-5, "{error:?}");
        }
    }
}
