//! The parameters of a fit in words.

use depthcal_calibration::adjust::smoothness_prior::indices;
use depthcal_calibration::calibrate::Calibrated;
use depthcal_model::{Block, Parameter};
use depthcal_report::format::{Measured, count, interval, measured, number, quantity};

use super::voice::say;

/// Blocks of more parameters than this are printed by their fields.
const MOST_PRINTED: usize = 24;

/// One line: a name, a value, what is known about it, a unit.
fn print_parameter(parameter: &Parameter, shown: &Measured, unknown: &str) {
    let std = shown.std.as_ref().map_or_else(|| unknown.to_owned(), |std| format!("± {std}"));
    let unit = if parameter.unit == "1" { "" } else { parameter.unit };
    let line = format!("  {:6} {:>12} {std:<12} {unit}", parameter.name, shown.value);
    say!("{}", line.trim_end());
}

/// Every field of a block: its range, its roughness, and how much of it the data determine; then the parameters that are the
/// same at all pixels.
fn print_fields(result: &Calibrated, block: &Block) {
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
        print_parameter(&block.parameters()[i], &measured(block.theta[i], None), "");
    }
}

/// Parameters with standard deviations, and how the fit went.
pub(super) fn print_parameters(result: &Calibrated) {
    let stds = result.std_devs();
    for (block, range) in result.camera.blocks_with_ranges() {
        say!("{}", block.name());
        if block.theta.len() > MOST_PRINTED {
            print_fields(result, block);
            continue;
        }
        let parameters = block.parameters().iter().zip(&block.theta).zip(&block.free).zip(&stds[range]);
        for (((parameter, value), free), std) in parameters {
            let shown = measured(*value, *std);
            print_parameter(parameter, &shown, if *free { "no std. dev." } else { "fixed" });
        }
    }
    let noise = &result.noise;
    let depth = if result.with_depth {
        let (a, b) = (number(noise.depth.a_per_mm), number(noise.depth.b_mm));
        format!("; of inverse depth ρ: σ² = ({a}/mm)² + ({b} mm · ρ²)²")
    } else {
        String::new()
    };
    say!("noise of a marker: {} per coordinate{depth}", quantity(noise.pixel_sigma, "px"));
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
