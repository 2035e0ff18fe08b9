//! The pinhole K, which every camera has between its lens and its pixel pieces: u = fx x' + s y' + cx, v = fy y' + cy.

use crate::piece::Parameter;

/// Number of its parameters: fx, fy, cx, cy, skew, px.
pub const PINHOLE: usize = 5;
/// Name in files and reports.
pub const NAME: &str = "pinhole";
/// Title in print.
pub const TITLE: &str = "Pinhole K";
/// Summary in plain words that follow its name and a colon.
pub const SUMMARY: &str = "focal lengths, principal point and skew of the image";
/// The equation in print.
pub const EQUATION: &str = "(fx x + skew y + cx, fy y + cy)";

/// Its parameters. Their nominal values mean nothing: start values come from the data.
pub static PARAMETERS: [Parameter; PINHOLE] = [
    Parameter::new("fx", "px", 500.0, 10.0).meaning("Focal length: pixels per unit of slope, across."),
    Parameter::new("fy", "px", 500.0, 10.0).meaning("Focal length: pixels per unit of slope, down."),
    Parameter::new("cx", "px", 320.0, 10.0).meaning("Principal point: column where the optical axis meets the image."),
    Parameter::new("cy", "px", 240.0, 10.0).meaning("Principal point: row where the optical axis meets the image."),
    Parameter::new("skew", "px", 0.0, 1.0).meaning("Shear of the pixel grid; zero for real sensors."),
];
