//! The cameras of a fit in words: extrinsics where there are several, parameters, and how the fit went.

use depthcal_calibration::adjust::smoothness_prior::indices;
use depthcal_calibration::calibrate::{Calibrated, CalibratedCamera, CameraFit, TimeOffset};
use depthcal_io::DriftOver;
use depthcal_model::Block;
use depthcal_report::format::{count, interval, measured, number, quantity, shown_unit};

use super::voice::say;

/// Blocks of more parameters than this are printed by their fields.
const MOST_PRINTED: usize = 24;

/// Prints the cameras with their parameters; of several also the relations between them.
pub(super) fn print_cameras(fitted: &Calibrated) {
    for pair in &fitted.pairs {
        let [a, b] = &pair.cameras;
        let contradicting = match pair.contradicting {
            0 => String::new(),
            n => format!(", {n} of which contradict"),
        };
        say!("{a} and {b} saw the board together in {}{contradicting}", count(pair.views, "frame"));
    }
    for camera in &fitted.cameras {
        if fitted.cameras.len() > 1 {
            say!("\n[{}]", camera.name);
            print_extrinsics(camera);
        }
        print_parameters(&camera.calibrated);
        for open in &camera.left_open {
            say!("left open by the boards: {} ({})", open.parameter, open.reason);
        }
    }
}

/// One line of the table: a name, a value, its standard deviation or why there is none, a unit.
fn print_value(name: &str, value: f64, std: Option<f64>, unknown: &str, unit: &str) {
    let shown = measured(value, std);
    let std = shown.std.map_or_else(|| unknown.to_owned(), |std| format!("± {std}"));
    let line = format!("  {name:6} {:>12} {std:<12} {}", shown.value, shown_unit(unit));
    say!("{}", line.trim_end());
}

/// The six values of a rigid motion: a rotation vector in radians, which is printed in degrees, and a translation, mm. Standard
/// deviations are zero where it is known.
fn print_motion(values: &[f64; 6], std_devs: &[f64; 6]) {
    let without = if std_devs.iter().any(|std_dev| std_dev.is_nan()) { "± unknown" } else { "fixed" };
    for (i, name) in ["rx", "ry", "rz", "tx", "ty", "tz"].into_iter().enumerate() {
        let (scale, unit) = if i < 3 { (1_f64.to_degrees(), "°") } else { (1.0, "mm") };
        let std_dev = Some(scale * std_devs[i]).filter(|std_dev| *std_dev > 0.0);
        print_value(name, scale * values[i], std_dev, without, unit);
    }
}

fn print_extrinsics(camera: &CameraFit) {
    let Some(std_devs) = camera.place_std_dev else {
        say!("the reference: its frame is the rig's");
        return;
    };
    let (turn, shift) = (camera.camera_from_rig.rotation.scaled_axis(), camera.camera_from_rig.translation.vector);
    say!("camera_from_rig");
    print_motion(&[turn.x, turn.y, turn.z, shift.x, shift.y, shift.z], &std_devs);
    if let Some(TimeOffset { value_s, std_dev_s }) = camera.time_offset {
        let value = quantity(1e3 * value_s, "ms");
        let std_dev = if std_dev_s.is_nan() { "unknown".to_owned() } else { quantity(1e3 * std_dev_s, "ms") };
        say!("time_offset: it exposes {value} ± {std_dev} later than its times say");
    }
    if let Some((drift, std_devs)) = &camera.drift {
        say!("extrinsics_drift over {}", drift_range(drift.over, drift.range));
        print_motion(&drift.change, std_devs);
    }
}

/// The quantity that a drift depends on, and the range of it over which the extrinsics change by the drift's values.
pub(crate) fn drift_range(over: DriftOver, range: f64) -> String {
    match over {
        DriftOver::Time => format!("time, in {}", quantity(range, "s")),
        DriftOver::Temperature => format!("temperature, in {}", quantity(range, "°C")),
    }
}

/// Every field of a block: its range, its roughness, and how much of it the data determine; then the parameters that are the
/// same at all pixels.
fn print_fields(result: &CalibratedCamera, block: &Block) {
    let Some(layout) = block.piece().and_then(|p| p.field()) else { return };
    for field in result.smoothness.fields.iter().filter(|f| f.piece == block.name()) {
        let values = || indices(&layout, field.index).map(|i| block.theta[i]);
        let (least, most) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let effective = field.effective.map_or_else(String::new, |e| format!(", {} effective parameters", number(e)));
        say!(
            "  {:6} {}  {} nodes with data{effective}, roughness {}; {} without data stay neutral",
            field.field,
            interval(least, most, ""),
            field.nodes,
            number(field.roughness),
            field.untouched
        );
    }
    for i in layout.parameter_count() - layout.shared..layout.parameter_count() {
        let parameter = &block.parameters()[i];
        print_value(&parameter.name, block.theta[i], None, "", parameter.unit);
    }
}

/// Parameters with standard deviations, and how the fit went.
fn print_parameters(result: &CalibratedCamera) {
    let stds = result.std_devs();
    for (block, range) in result.camera.blocks_with_ranges() {
        say!("{}", block.name());
        if block.theta.len() > MOST_PRINTED {
            print_fields(result, block);
            continue;
        }
        let parameters = block.parameters().iter().zip(&block.theta).zip(&block.free).zip(&stds[range]);
        for (((parameter, value), free), std) in parameters {
            let unknown = if *free { "no std. dev." } else { "fixed" };
            print_value(&parameter.name, *value, *std, unknown, parameter.unit);
        }
    }
    let noise = &result.noise;
    let has_markers = result.capture.frames.iter().any(|frame| !frame.observed_markers().is_empty());
    let of_markers = has_markers.then(|| format!("of a marker: {} per coordinate", quantity(noise.pixel_sigma, "px")));
    let of_depth = result.with_depth.then(|| {
        let (a, b) = (number(noise.depth.a_per_mm), number(noise.depth.b_mm));
        format!("of inverse depth ρ: σ² = ({a}/mm)² + ({b} mm · ρ²)²")
    });
    say!("noise {}", of_markers.into_iter().chain(of_depth).collect::<Vec<_>>().join("; "));
    if noise.planes.of_noise > 0.0 {
        let size = number(noise.planes.of_noise);
        say!(
            "frames have planes of their own, {size} times a pixel's noise; standard deviations of parameters cover them"
        );
    }
    let wrong: usize = result.capture.frames.iter().map(|f| f.wrong_markers.len()).sum();
    if wrong > 0 {
        say!("{} left out: more than a pixel from the fit", count(wrong, "marker"));
    }
    let samples: usize = result.capture.frames.iter().map(|f| f.samples.len()).sum();
    let apart = result.correlation_length_px.unwrap_or(1);
    say!(
        "{}, {} at least {apart} px apart ({} excluded); {} after {}",
        count(result.capture.frames.len(), "frame"),
        count(samples, "depth pixel"),
        count(result.outliers, "outlier"),
        result.termination,
        count(result.iterations, "iteration")
    );
    for frame in &result.capture.dropped {
        say!("not used: {} ({})", frame.name, frame.reason);
    }
}
