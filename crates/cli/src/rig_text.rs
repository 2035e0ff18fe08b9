//! Rigs in words.

use depthcal_calibration::calibrate::rig::{CameraFit, RigCalibrated, TimeOffset};
use depthcal_io::{DriftOver, TransferError};
use depthcal_report::format::{count, number, quantity};

use crate::parameters::print_parameters;
use crate::voice::say;

/// Prints every camera with its extrinsics and parameters.
pub(crate) fn print_rig(result: &RigCalibrated) {
    for pair in &result.pairs {
        let [a, b] = &pair.cameras;
        let contradicting = match pair.contradicting {
            0 => String::new(),
            n => format!(", {n} of which contradict"),
        };
        say!("{a} and {b} saw the board together in {}{contradicting}", count(pair.views, "frame"));
    }
    for camera in &result.cameras {
        say!("\n[{}]", camera.name);
        print_extrinsics(camera);
        print_parameters(&camera.calibrated);
        for open in &camera.left_open {
            say!("left open by the boards: {} ({})", open.parameter, open.reason);
        }
    }
}

fn print_extrinsics(camera: &CameraFit) {
    let Some(std_dev) = camera.place_std_dev else {
        say!("the reference: its frame is the rig's");
        return;
    };
    let extrinsics = &camera.camera_from_rig;
    let (turn, shift) = (extrinsics.rotation.scaled_axis(), extrinsics.translation.vector);
    say!("camera_from_rig");
    for (i, axis) in ["x", "y", "z"].iter().enumerate() {
        let (value, std) = (turn[i].to_degrees(), std_dev[i].to_degrees());
        say!("  r{axis}     {value:>12.4} ± {:<12} °", number(std));
    }
    for (i, axis) in ["x", "y", "z"].iter().enumerate() {
        say!("  t{axis}     {:>12.3} ± {:<12} mm", shift[i], number(std_dev[3 + i]));
    }
    if let Some(TimeOffset { value_s, std_dev_s }) = camera.time_offset {
        let [value, std_dev] = [value_s, std_dev_s].map(|s| quantity(1e3 * s, "ms"));
        say!("time_offset: it exposes {value} ± {std_dev} later than its times say");
    }
    if let Some((drift, std_dev)) = &camera.drift {
        say!("extrinsics_drift over {}", drift_range(drift.over, drift.range));
        for (i, axis) in ["x", "y", "z"].iter().enumerate() {
            let (value, std) = (drift.change[i].to_degrees(), std_dev[i].to_degrees());
            say!("  r{axis}     {value:>12.4} ± {:<12} °", number(std));
        }
        for (i, axis) in ["x", "y", "z"].iter().enumerate() {
            say!("  t{axis}     {:>12.3} ± {:<12} mm", drift.change[3 + i], number(std_dev[3 + i]));
        }
    }
}

/// What a drift depends on, and over which range of it the extrinsics change by its values.
pub(crate) fn drift_range(over: DriftOver, range: f64) -> String {
    match over {
        DriftOver::Time => format!("time, in {}", quantity(range, "s")),
        DriftOver::Temperature => format!("temperature, in {}", quantity(range, "°C")),
    }
}

/// Transfer errors, as a table.
pub(crate) fn print_transfers(transfers: &[TransferError]) {
    if transfers.is_empty() {
        return;
    }
    say!("\ntransfer errors: markers through corrected depth into another camera's image");
    say!("{:<16} {:<16} {:>8}  {:>12}  {:>12}  {:>12}", "from", "to", "markers", "before", "after", "after");
    for t in transfers {
        let (before, px, mm) = (quantity(t.before_rms_px, "px"), quantity(t.rms_px, "px"), quantity(t.rms_mm, "mm"));
        say!("{:<16} {:<16} {:>8}  {before:>12}  {px:>12}  {mm:>12}", t.from, t.to, t.markers);
    }
}
