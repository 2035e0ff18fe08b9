//! ArUco and AprilTag markers, read without OpenCV: dark regions by a local threshold, quadrilaterals around them, their sides
//! fitted to the grey values, their cells compared with a dictionary.

mod cells;
pub(crate) mod dictionary;
mod hull;
mod quad;
mod read;
mod regions;
mod sides;
mod survey;
mod tag;
mod threshold;

pub(crate) use read::read_tags;
pub use survey::{SeenTag, SeenTags, survey_tags};
pub(crate) use tag::{Reading, Tag};
