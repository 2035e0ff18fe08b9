//! Tests of several cameras on one rigid body, one module per subject: `cargo test -p depthcal-calibration --test rig depth_only`
//! runs those of one module.

mod bent_board;
mod depth_only;
mod fields;
mod jacobians;
mod known_extrinsics;
mod like_one_camera;
mod one_camera;
mod several_boards;
mod support;
mod time_offset;
mod traced_effects;
mod truth;
