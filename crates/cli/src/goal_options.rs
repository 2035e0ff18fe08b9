//! The error to lower, for commands that plan captures or choose frames.

use clap::Args;
use depthcal_calibration::task::NextRequest;

/// Options of the goal.
#[derive(Debug, Args)]
pub(super) struct GoalOptions {
    /// The error to lower: depth (of corrected depth), projection (of pixels), or a parameter PIECE.PARAMETER [default: depth,
    /// projection without depth].
    #[arg(long, default_value = "", hide_default_value = true)]
    goal: String,
    /// Nearest and farthest distance of the goal depth, mm [default: those that were seen].
    #[arg(long, value_name = "NEAR,FAR", value_parser = parse_range)]
    range_mm: Option<[f64; 2]>,
}

impl GoalOptions {
    /// The goal, of the default camera and size.
    pub(super) fn request(&self) -> NextRequest {
        NextRequest { goal: self.goal.clone(), range_mm: self.range_mm, ..NextRequest::default() }
    }
}

fn parse_range(text: &str) -> Result<[f64; 2], String> {
    let ends: Vec<f64> = text.split(',').filter_map(|end| end.trim().parse().ok()).collect();
    match ends[..] {
        [near, far] if near > 0.0 && far > near && far.is_finite() => Ok([near, far]),
        _ => Err("give nearest and farthest distance in mm, such as 500,4000".to_owned()),
    }
}
