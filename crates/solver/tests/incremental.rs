//! Incremental sessions: whatever is added and taken back, settling leads to the optimum of the whole problem.

use std::collections::BTreeMap;

use depthcal_solver::{
    Batch, Factor, FrameId, Graph, IncrementalError, IncrementalOptions, IncrementalSession, Key, Noise, Options, Over,
    Prior, Scalar, Values, minimize,
};
use nalgebra::{Isometry3, Point3, SVector, UnitQuaternion, Vector2, Vector3};
use proptest::prelude::*;
use rand::RngExt;

use crate::common::{normal, rng};

/// A point of a board in the image of a camera that sits on a rig: focal length and one radial coefficient, and the camera's
/// rotation against the rig, are shared; the pose of the board is the frame's.
struct Corner {
    board: Vector3<f64>,
    pixel: Vector2<f64>,
}

impl Factor<2> for Corner {
    type Variables = (Isometry3<f64>, Vector2<f64>, UnitQuaternion<f64>);

    #[inline(always)]
    fn residual<T: Scalar>(&self, (pose, camera, rotation): Over<Self::Variables, T>) -> SVector<T, 2> {
        let x = rotation.rotate(&pose.transform(&self.board.map(T::from)));
        let (u, v) = (x[0] / x[2], x[1] / x[2]);
        let f = ((u * u + v * v) * camera[1] + 1.0) * camera[0];
        SVector::<T, 2>::new(f * u - self.pixel.x, f * v - self.pixel.y)
    }
}

const CAMERA: [f64; 2] = [480.0, -0.15];

struct Shared {
    values: Values,
    graph: Graph,
    camera: Key<Vector2<f64>>,
    rotation: Key<UnitQuaternion<f64>>,
}

/// Start values of what is shared, with a prior of the rotation, which frames alone leave undetermined.
fn shared() -> Shared {
    let mut values = Values::new();
    let camera = values.insert(Vector2::new(460.0, 0.0));
    let rotation = values.insert(UnitQuaternion::identity());
    let mut graph = Graph::new();
    let truth = UnitQuaternion::from_scaled_axis(Vector3::new(0.02, -0.03, 0.01));
    graph.add_batch(Prior::isotropic("rotation", rotation, truth, 1e-3).unwrap());
    Shared { values, graph, camera, rotation }
}

/// Points of a board, and where the camera sees them.
type Corners = Vec<(Vector3<f64>, Vector2<f64>)>;

/// A frame of 20 corners: start of its pose, and corners with 0.1 px of noise.
fn frame(seed: u64) -> (Isometry3<f64>, Corners) {
    let mut rng = rng(seed);
    let tilt = Vector3::new(rng.random_range(-0.6..0.6), rng.random_range(-0.6..0.6), rng.random_range(-1.0..1.0));
    let place = Vector3::new(rng.random_range(-0.3..0.1), rng.random_range(-0.3..0.1), rng.random_range(1.0..2.0));
    let pose = Isometry3::new(place, tilt);
    let corners = (0..20).map(|i| {
        let board = Vector3::new(0.06 * f64::from(i % 5), 0.06 * f64::from(i / 5), 0.0);
        let x = pose * Point3::from(board);
        let (u, v) = (x.x / x.z, x.y / x.z);
        let f = CAMERA[0] * (1.0 + CAMERA[1] * (u * u + v * v));
        (board, Vector2::new(f * u + 0.1 * normal(&mut rng), f * v + 0.1 * normal(&mut rng)))
    });
    let corners = corners.collect();
    let off = Isometry3::new(Vector3::new(0.01, -0.01, 0.03), Vector3::new(0.02, 0.03, -0.02));
    (pose * off, corners)
}

/// Adds a frame's variables and factors to values and a graph.
fn build(values: &mut Values, graph: &mut Graph, shared: &Shared, seed: u64) -> Key<Isometry3<f64>> {
    let (start, corners) = frame(seed);
    let pose = values.insert(start);
    let mut batch = Batch::new("corners").with_noise(Noise::isotropic(0.1).unwrap());
    for (board, pixel) in corners {
        batch.push(Corner { board, pixel }, (pose, shared.camera, shared.rotation));
    }
    graph.add_batch(batch);
    pose
}

fn session(options: IncrementalOptions) -> (Shared, IncrementalSession) {
    let shared = shared();
    let session = IncrementalSession::new(shared.values.clone(), &shared.graph, options).unwrap();
    (shared, session)
}

/// Frames by seed, added and taken back.
#[derive(Default)]
struct Present(BTreeMap<FrameId, (u64, Key<Isometry3<f64>>)>);

impl Present {
    fn add(&mut self, session: &mut IncrementalSession, shared: &Shared, seed: u64) {
        let (frame, key) = session.add(|values, graph| build(values, graph, shared, seed)).unwrap();
        self.0.insert(frame, (seed, key));
    }

    fn take_back(&mut self, session: &mut IncrementalSession, index: usize) {
        if let Some(frame) = self.0.keys().nth(index % self.0.len().max(1)).copied() {
            session.remove(frame).unwrap();
            self.0.remove(&frame);
        }
    }

    /// The optimum of all frames at once: values, the keys of poses in the order of frames, and the cost.
    fn batch(&self, shared: &Shared) -> (Values, Vec<Key<Isometry3<f64>>>, f64) {
        let (mut values, mut graph) = (shared.values.clone(), shared.graph.clone());
        let keys = self.0.values().map(|(seed, _)| build(&mut values, &mut graph, shared, *seed)).collect();
        let solution = minimize(&graph, values, &Options { cost_tolerance: 1e-14, ..Options::default() }).unwrap();
        assert!(solution.report.converged, "{}", solution.report);
        (solution.values, keys, solution.report.cost)
    }
}

/// The distance of a session from the batch optimum, in standard deviations of the shared variables.
fn distance(session: &mut IncrementalSession, shared: &Shared, optimum: &Values) -> f64 {
    let camera = optimum.get(shared.camera) - session.shared().get(shared.camera);
    let turn = (optimum.get(shared.rotation).inverse() * session.shared().get(shared.rotation)).scaled_axis();
    let delta = SVector::<f64, 5>::new(camera.x, camera.y, turn.x, turn.y, turn.z);
    delta.dot(&(session.information() * delta)).sqrt()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn settling_leads_to_the_batch_optimum(
        changes in proptest::collection::vec((any::<bool>(), 0_u64..1000), 1..25), threshold in 0.0_f64..3.0,
    ) {
        let options = IncrementalOptions { threshold, cost_tolerance: 1e-13, ..IncrementalOptions::default() };
        let (shared, mut session) = session(options);
        let mut present = Present::default();
        // Three frames determine everything.
        (0..3).for_each(|seed| present.add(&mut session, &shared, seed));
        for (take, seed) in changes {
            if take && present.0.len() > 3 {
                present.take_back(&mut session, seed as usize);
            } else {
                present.add(&mut session, &shared, seed);
            }
        }
        prop_assert!(session.frames().eq(present.0.keys().copied()));
        prop_assert!(session.settle().unwrap());
        let (optimum, keys, cost) = present.batch(&shared);
        prop_assert!((session.cost() - cost).abs() < 1e-9 * cost, "{} {cost}", session.cost());
        let distance = distance(&mut session, &shared, &optimum);
        prop_assert!(distance < 1e-4, "{distance}");
        for ((frame, (_, key)), batch_key) in present.0.iter().zip(keys) {
            let pose = *session.frame_values(*frame).unwrap().get(*key);
            let off = optimum.get(batch_key).inverse() * pose;
            // A hundredth of the standard deviations of a pose, some 1e-4 m and rad.
            prop_assert!(off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-6, "{off}");
        }
    }
}

/// Between additions the session stays close to the optimum and linearises a bounded number of frames.
#[test]
fn adding_follows_the_optimum_with_little_work() {
    let (shared, mut session) = session(IncrementalOptions::default());
    let mut present = Present::default();
    let mut work = Vec::new();
    for seed in 0..60 {
        let before = session.linearizations();
        present.add(&mut session, &shared, seed);
        work.push(session.linearizations() - before);
        if seed > 10 && seed % 10 == 0 {
            let (optimum, ..) = present.batch(&shared);
            let distance = distance(&mut session, &shared, &optimum);
            assert!(distance < 0.05, "{seed} {distance}");
        }
    }
    // Each frame again in every step would be 30 and more a time.
    let late: usize = work[30..].iter().sum();
    assert!(late < 10 * 30, "{work:?}");
    let settled = session.linearizations();
    assert!(session.settle().unwrap());
    assert!(session.linearizations() > settled);
}

#[test]
fn bits_do_not_depend_on_threads() {
    let run = |threads: usize| {
        let (shared, mut session) = session(IncrementalOptions { threads, ..IncrementalOptions::default() });
        let mut present = Present::default();
        let mut bits: Vec<u64> = Vec::new();
        let mut note = |session: &IncrementalSession| {
            bits.extend(session.shared().get(shared.camera).iter().map(|x| x.to_bits()));
            bits.extend(session.shared().get(shared.rotation).coords.iter().map(|x| x.to_bits()));
            bits.push(session.cost().to_bits());
        };
        for seed in 0..40 {
            present.add(&mut session, &shared, seed);
            note(&session);
        }
        (0..5).for_each(|index| present.take_back(&mut session, 7 * index));
        session.settle().unwrap();
        note(&session);
        bits
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(3));
}

#[test]
fn a_frame_taken_back_leaves_no_trace() {
    let (shared, mut session) = session(IncrementalOptions { cost_tolerance: 1e-13, ..IncrementalOptions::default() });
    let mut present = Present::default();
    (0..8).for_each(|seed| present.add(&mut session, &shared, seed));
    session.settle().unwrap();
    let before = *session.shared().get(shared.camera);
    // A frame whose corners are 3 px off, thirty standard deviations.
    let (wrong, _) = session
        .add(|values, graph| {
            let (start, corners) = frame(99);
            let pose = values.insert(start);
            let mut batch = Batch::new("corners").with_noise(Noise::isotropic(0.1).unwrap());
            for (i, (board, pixel)) in corners.into_iter().enumerate() {
                let pixel = pixel + Vector2::new(3.0 * (i as f64).sin(), 3.0 * (i as f64).cos());
                batch.push(Corner { board, pixel }, (pose, shared.camera, shared.rotation));
            }
            graph.add_batch(batch);
        })
        .unwrap();
    session.settle().unwrap();
    let moved = (session.shared().get(shared.camera) - before).amax();
    assert!(moved > 0.1, "{moved}");
    session.remove(wrong).unwrap();
    session.settle().unwrap();
    let moved = (session.shared().get(shared.camera) - before).amax();
    assert!(moved < 1e-4, "{moved}");
    assert!(matches!(session.remove(wrong), Err(IncrementalError::UnknownFrame { frame: 9 })));
    assert!(session.frame_values(wrong).is_err());
}

/// Shared components that are fixed stay, in frames and in the session, and the result is that of the batch with them fixed.
#[test]
fn fixed_shared_components_stay() {
    let mut shared = shared();
    shared.graph.fix_partly(shared.camera, &[false, true]);
    let mut session =
        IncrementalSession::new(shared.values.clone(), &shared.graph, IncrementalOptions::default()).unwrap();
    let mut present = Present::default();
    (0..6).for_each(|seed| present.add(&mut session, &shared, seed));
    assert!(session.settle().unwrap());
    let (optimum, _, cost) = present.batch(&shared);
    assert_eq!(session.shared().get(shared.camera).y, 0.0);
    assert!((session.cost() - cost).abs() < 1e-9 * cost);
    assert!((session.shared().get(shared.camera).x - optimum.get(shared.camera).x).abs() < 1e-4);
}

#[test]
fn faults_leave_the_session_as_it_was() {
    let (shared, mut session) = session(IncrementalOptions::default());
    let mut present = Present::default();
    (0..4).for_each(|seed| present.add(&mut session, &shared, seed));
    let camera = *session.shared().get(shared.camera);
    let fixes = session.add(|values, graph| {
        build(values, graph, &shared, 5);
        graph.fix(shared.camera);
    });
    assert!(matches!(fixes, Err(IncrementalError::Fixed { .. })));
    let bounds = session.add(|values, graph| {
        let pose = build(values, graph, &shared, 5);
        graph.bound(pose, 3, -1.0, 1.0);
    });
    assert!(matches!(bounds, Err(IncrementalError::Bounds)));
    // One corner does not determine a pose.
    let poor = session.add(|values, graph| {
        let (start, corners) = frame(5);
        let pose = values.insert(start);
        let (board, pixel) = corners[3];
        graph.add(Corner { board, pixel }, (pose, shared.camera, shared.rotation));
    });
    assert!(matches!(poor, Err(IncrementalError::Undetermined)), "{:?}", poor.err());
    assert_eq!(*session.shared().get(shared.camera), camera);
    assert_eq!(session.frames().len(), 4);
    present.add(&mut session, &shared, 5);
    assert!(session.settle().unwrap());
}

/// Shared variables stay until enough frames are there; then they are at the optimum of these.
#[test]
fn shared_variables_are_held_until_enough_frames_are_there() {
    let options = IncrementalOptions { hold_until: 4, cost_tolerance: 1e-13, ..IncrementalOptions::default() };
    let (shared, mut session) = session(options);
    let start = *shared.values.get(shared.camera);
    let mut present = Present::default();
    for seed in 0..4 {
        assert_eq!(*session.shared().get(shared.camera), start);
        present.add(&mut session, &shared, seed);
    }
    let (optimum, ..) = present.batch(&shared);
    let distance = distance(&mut session, &shared, &optimum);
    assert!(distance < 1e-4, "{distance}");
}
