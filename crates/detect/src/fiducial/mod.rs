//! Boards whose markers carry a number: ChArUco and AprilGrid.

mod aprilgrid;
mod attempts;
mod charuco;
mod consistent;
mod dictionary;

pub(crate) use aprilgrid::find as find_aprilgrid;
pub(crate) use charuco::find as find_charuco;
