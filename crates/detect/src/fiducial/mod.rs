//! Boards whose markers carry a number: ChArUco and AprilGrid.

mod aprilgrid;
mod attempts;
mod charuco;
mod consistent;
mod extend;
mod neighbours;
mod placement;
mod reader;
mod strays;

pub(crate) use aprilgrid::find as find_aprilgrid;
pub(crate) use charuco::find as find_charuco;
pub use charuco::square_of as tag_square;

use crate::error::DetectError;
use crate::tags::dictionary::Dictionary;

/// The cells of tag `id` of the dictionary that OpenCV calls `name`, row by row, with its black border of one cell: whether each
/// is white.
///
/// # Errors
/// [`DetectError`] for an unknown dictionary or a number beyond it.
pub fn tag_cells(name: &str, id: usize) -> Result<Vec<Vec<bool>>, DetectError> {
    Ok(Dictionary::with_tags(name, id + 1)?.cells(id))
}
