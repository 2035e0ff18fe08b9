//! Rigs that several tests capture with; not every test has all of them.

use depthcal_simulate::{CameraTruth, Kind, PointOptions, Pose, RigCamera, RigPoints, RigSimulation, Streams};

/// A colour camera of 1280×720 px, 52 mm to the left of the infrared one.
pub fn colour() -> RigCamera {
    let truth = CameraTruth {
        centre_px: [644.0, 352.5],
        focal_px: [931.0, 929.5],
        lens: [0.09, -0.21, -0.0008, 0.0011, 0.08],
        ..CameraTruth::ideal(1280, 720, 930.0)
    };
    let place = Pose::from_rotation_vector([0.012, -0.021, 0.006], [52.3, -1.4, 3.2]);
    RigCamera::new("colour", Streams::Colour, truth, place)
}

/// Infrared and depth of the thesis' first camera.
pub fn infrared() -> RigCamera {
    RigCamera::new(
        "infrared",
        Streams::InfraredAndDepth,
        CameraTruth::published(1).expect("camera 1"),
        Pose::identity(),
    )
}

/// Infrared, depth and colour by points.
pub fn two_cameras(seed: u64, kind: Kind) -> RigPoints {
    let rig = RigSimulation::new(vec![infrared(), colour()], kind, seed);
    rig.observe_points(&PointOptions::default()).expect("a simulation")
}

/// Infrared, depth and a second depth camera, of time of flight, whose image cannot be had.
pub fn depth_only() -> RigCamera {
    RigCamera::usual("depth", 1).expect("camera 1").expect("a usual camera")
}
