//! Boards whose markers carry a number: ChArUco and AprilGrid.

mod aprilgrid;
mod attempts;
mod charuco;
mod consistent;
mod dictionary;
mod extend;
mod neighbours;
mod placement;
mod strays;

pub(crate) use aprilgrid::find as find_aprilgrid;
pub(crate) use charuco::find as find_charuco;
