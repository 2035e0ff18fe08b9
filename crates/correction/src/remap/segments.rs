//! The four source pixels around the source of every output pixel, segment by segment.

use super::means::{Cell, WINDOW};

/// Output pixels of a segment, whose sources lie in a common window.
pub(crate) const SEGMENT: usize = 64;

/// Consecutive output pixels of a row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segment {
    /// First source pixel of the window.
    pub base: u32,
    /// Whether all its pixels have four sources in the window, and the window and the one a row and a column further
    /// lie in the image.
    pub whole: bool,
}

/// The cell of a pixel without four sources; only segments that are not `whole` have such pixels.
pub(crate) const BORDER: Cell = Cell { offset: u16::MAX, right: u8::MAX, lower: u8::MAX };

/// The windows of the upper left, upper right, lower left and lower right source pixels, for a segment at `base`.
#[inline(always)]
pub(crate) fn windows<T>(image: &[T], base: usize, width: usize) -> Option<[&[T; WINDOW]; 4]> {
    let window = |first: usize| image.get(first..first + WINDOW)?.first_chunk();
    Some([window(base)?, window(base + 1)?, window(base + width)?, window(base + width + 1)?])
}

/// The segments of all output rows, and the cell of every output pixel, given the source (column, row) of each, NaN
/// where there is none, and the size of the image.
pub(crate) fn segments(sources: &[[f64; 2]], width: usize, height: usize) -> (Vec<Segment>, Vec<Cell>) {
    let pixels = width * height;
    let spare = WINDOW + width + 1;
    // Index of the upper left source pixel, and the fractions of a pixel to the right and down, for sources in the
    // image.
    let corner = |[u, v]: [f64; 2]| {
        let inside = u >= 0.0 && v >= 0.0 && u <= width as f64 - 1.0 && v <= height as f64 - 1.0;
        let (column, row) = ((u as usize).min(width.max(2) - 2), (v as usize).min(height.max(2) - 2));
        let enough = width > 1 && height > 1;
        (inside && enough).then(|| (row * width + column, [u - column as f64, v - row as f64]))
    };
    let (mut segments, mut cells) = (Vec::new(), Vec::with_capacity(pixels));
    for part in sources.chunks(width).flat_map(|row| row.chunks(SEGMENT)) {
        let corners: Vec<_> = part.iter().map(|pixel| corner(*pixel)).collect();
        let least = corners.iter().flatten().map(|(index, _)| *index).min().unwrap_or(0);
        let base = least.min(pixels.saturating_sub(spare));
        let of_corner = |corner: &Option<(usize, [f64; 2])>| {
            let (index, fractions) = (*corner)?;
            let offset = u16::try_from(index - base).ok()?;
            let [right, lower] = fractions.map(|f| (f * 256.0).round().min(255.0) as u8);
            Some(Cell { offset, right, lower })
        };
        let cells_of_segment: Vec<Option<Cell>> = corners.iter().map(of_corner).collect();
        segments.push(Segment {
            base: base as u32,
            whole: pixels >= spare && cells_of_segment.iter().all(Option::is_some),
        });
        cells.extend(cells_of_segment.iter().map(|cell| cell.unwrap_or(BORDER)));
    }
    (segments, cells)
}
