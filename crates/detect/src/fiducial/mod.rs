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

use crate::error::DetectError;
use crate::open_cv::tags;

/// The cells of tag `id` of OpenCV's dictionary `name`, row by row, with its black border of one cell: whether each is white.
///
/// # Errors
/// [`DetectError`] for an unknown dictionary, a number beyond it, or an OpenCV without dictionaries.
pub fn tag_cells(name: &str, id: usize) -> Result<Vec<Vec<bool>>, DetectError> {
    let number = dictionary::dictionary_number(name)?;
    let got = tags::dictionary_size(number)?;
    if id >= got {
        return Err(DetectError::DictionaryTooSmall { dictionary: name.to_owned(), need: id + 1, got });
    }
    tags::tag_cells(number, id)
}
