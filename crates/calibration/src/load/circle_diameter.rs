//! The diameter of a board's dots, measured in the images of a capture.

use std::collections::BTreeMap;
use std::fmt;

#[cfg(any(test, feature = "detect"))]
use depthcal_statistics::upper_median;

/// A declared diameter is contradicted when the measured one differs from it by more than this share of it.
const CONTRADICTION: f64 = 0.1;
const DIAMETER: &str = "circle_diameter_mm";
const STD: &str = "circle_diameter_std_mm";
const FRAMES: &str = "circle_diameter_frames";

/// The diameter of a board's dots, measured in the images of a capture.
///
/// Images give the ratio of diameter and spacing; its unit comes from the declared spacing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredDiameter {
    /// Median over the frames of the median over a frame's dots, mm.
    pub diameter_mm: f64,
    /// Standard error of the median, from the scatter between frames, mm; with fewer than three frames from that between
    /// the dots.
    pub std_mm: f64,
    /// Number of frames that were measured.
    pub frames: usize,
    /// Diameter declared in `dataset.toml`, mm; `None` where it declares none.
    pub declared_mm: Option<f64>,
}

impl MeasuredDiameter {
    /// From one diameter (mm) and its standard deviation (mm) per frame; `None` without frames.
    #[cfg(any(test, feature = "detect"))]
    pub(crate) fn from_frames(frames: &[(f64, f64)], declared_mm: Option<f64>) -> Option<MeasuredDiameter> {
        let mut diameters: Vec<f64> = frames.iter().map(|f| f.0).collect();
        let diameter_mm = upper_median(&mut diameters)?;
        let root = (frames.len() as f64).sqrt();
        let mut deviations: Vec<f64> = frames.iter().map(|f| (f.0 - diameter_mm).abs()).collect();
        let mut inner: Vec<f64> = frames.iter().map(|f| f.1).collect();
        // 1.4826: from the median deviation to the standard deviation of a normal distribution; 1.2533: from the standard
        // deviation of a mean to that of a median.
        let between = 1.2533 * 1.4826 * upper_median(&mut deviations)? / root;
        let within = upper_median(&mut inner)? / root;
        let std_mm = if frames.len() < 3 { within } else { between.max(within) };
        Some(MeasuredDiameter { diameter_mm, std_mm, frames: frames.len(), declared_mm })
    }

    /// Whether the declared diameter is off by more than 10 %.
    pub fn contradicts_declaration(&self) -> bool {
        self.declared_mm.is_some_and(|declared| (self.diameter_mm / declared - 1.0).abs() > CONTRADICTION)
    }

    /// The measurement as settings of `observations.json`.
    pub(crate) fn to_settings(self) -> impl Iterator<Item = (String, String)> {
        [(DIAMETER, self.diameter_mm.to_string()), (STD, self.std_mm.to_string()), (FRAMES, self.frames.to_string())]
            .into_iter()
            .map(|(name, value)| (name.to_owned(), value))
    }

    /// The inverse of [`MeasuredDiameter::to_settings`]; `None` where the settings hold none.
    pub(crate) fn from_settings(settings: &BTreeMap<String, String>, declared_mm: Option<f64>) -> Option<Self> {
        let number = |name: &str| settings.get(name)?.parse::<f64>().ok();
        let frames = settings.get(FRAMES)?.parse().ok()?;
        Some(MeasuredDiameter { diameter_mm: number(DIAMETER)?, std_mm: number(STD)?, frames, declared_mm })
    }
}

impl fmt::Display for MeasuredDiameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { diameter_mm, std_mm, frames, declared_mm } = self;
        write!(f, "the dots measure {diameter_mm:.2} ± {std_mm:.2} mm in {frames} images")?;
        match declared_mm {
            Some(declared) if self.contradicts_declaration() => write!(
                f,
                ", but dataset.toml declares circle_diameter_mm = {declared}: write {diameter_mm:.2} or leave the field \
                 out; if {declared} mm is what a ruler shows, spacing_mm is wrong"
            ),
            Some(declared) => write!(f, " (declared: {declared} mm)"),
            None => write!(f, " (circle_diameter_mm is not declared)"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_bad_frame_does_not_matter_and_settings_keep_all() {
        let frames = [(10.0, 0.01), (10.02, 0.01), (9.98, 0.01), (10.01, 0.01), (14.0, 0.3)];
        let measured = MeasuredDiameter::from_frames(&frames, Some(12.0)).expect("frames");
        assert!((measured.diameter_mm - 10.01).abs() < 1e-9 && measured.std_mm < 0.03, "{measured:?}");
        assert!(measured.contradicts_declaration());
        let text = measured.to_string();
        assert!(text.contains("10.01") && text.contains("= 12") && text.contains("spacing_mm"), "{text}");
        let settings = measured.to_settings().collect();
        assert_eq!(MeasuredDiameter::from_settings(&settings, Some(12.0)), Some(measured));
        let right = MeasuredDiameter { declared_mm: Some(10.5), ..measured };
        assert!(!right.contradicts_declaration());
        assert!(MeasuredDiameter::from_frames(&[], None).is_none());
    }
}
