//! Weighted means of four source pixels, for a segment of output pixels at a time.

use crate::simd::{Isa, Kernel, dispatch};

/// Pixels of the window that the sources of a segment lie in: a 16-bit index cannot leave it, so that loops need no
/// bounds checks.
pub const WINDOW: usize = 1 << 16;

/// The four source pixels of an output pixel, and its place among them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cell {
    /// The upper left source pixel, relative to the segment's base.
    pub offset: u16,
    /// Weight of the two right ones, 1/256.
    pub right: u8,
    /// Weight of the two lower ones, 1/256.
    pub lower: u8,
}

/// Weights of [upper left, upper right, lower left, lower right], which sum to 65536.
#[inline(always)]
pub fn weights(cell: Cell) -> [u32; 4] {
    let (right, lower) = (u32::from(cell.right), u32::from(cell.lower));
    let (left, upper) = (256 - right, 256 - lower);
    [left * upper, right * upper, left * lower, right * lower]
}

/// A pixel value of which weighted means can be computed.
pub trait Means: Copy + Default {
    /// The mean of [upper left, upper right, lower left, lower right] with weights that sum to 65536.
    fn mean(four: [Self; 4], weights: [u32; 4]) -> Self;

    /// [`Means::mean`] for all pixels of a segment; `windows` are those of the four source pixels.
    #[inline(always)]
    fn means(windows: [&[Self; WINDOW]; 4], cells: &[Cell], out: &mut [Self]) {
        for (out, cell) in out.iter_mut().zip(cells) {
            *out = Self::mean(windows.map(|window| window[usize::from(cell.offset)]), weights(*cell));
        }
    }
}

/// The rounded mean. The sum is at most 65535 · 65536 + 32768, which 32 bits hold.
#[inline(always)]
fn weighted(four: [u32; 4], weights: [u32; 4]) -> u32 {
    ((0..4).map(|k| four[k] * weights[k]).sum::<u32>() + (1 << 15)) >> 16
}

impl Means for u8 {
    #[inline(always)]
    fn mean(four: [Self; 4], weights: [u32; 4]) -> Self {
        weighted(four.map(u32::from), weights) as Self
    }

    fn means(windows: [&[Self; WINDOW]; 4], cells: &[Cell], out: &mut [Self]) {
        dispatch(Bytes { windows, cells, out });
    }
}

impl Means for u16 {
    #[inline(always)]
    fn mean(four: [Self; 4], weights: [u32; 4]) -> Self {
        weighted(four.map(u32::from), weights) as Self
    }
}

impl Means for [u8; 3] {
    #[inline(always)]
    fn mean(four: [Self; 4], weights: [u32; 4]) -> Self {
        std::array::from_fn(|c| u8::mean(four.map(|texel| texel[c]), weights))
    }
}

/// A segment of bytes. Fetching them cannot be vectorised, so that is a loop of its own, which packs the four bytes of
/// a pixel into 32 bits; the loop over the packed bytes is vectorised.
struct Bytes<'a> {
    windows: [&'a [u8; WINDOW]; 4],
    cells: &'a [Cell],
    out: &'a mut [u8],
}

impl Kernel for Bytes<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        const AT_ONCE: usize = 64;
        let [upper_left, upper_right, lower_left, lower_right] = self.windows;
        let mut fours = [0u32; AT_ONCE];
        for (cells, out) in self.cells.chunks(AT_ONCE).zip(self.out.chunks_mut(AT_ONCE)) {
            let n = cells.len();
            let (fours, out) = (&mut fours[..n], &mut out[..n]);
            for (four, cell) in fours.iter_mut().zip(cells) {
                let i = usize::from(cell.offset);
                *four = u32::from_le_bytes([upper_left[i], upper_right[i], lower_left[i], lower_right[i]]);
            }
            for i in 0..n {
                let (right, lower) = (u32::from(cells[i].right), u32::from(cells[i].lower));
                // The upper and the lower mean as two numbers of 16 bits, which hold 255 · 256.
                let columns = (fours[i] & 0x00ff_00ff) * (256 - right) + (fours[i] >> 8 & 0x00ff_00ff) * right;
                let sum = (columns & 0xffff) * (256 - lower) + (columns >> 16) * lower;
                out[i] = ((sum + (1 << 15)) >> 16) as u8;
            }
        }
    }
}
