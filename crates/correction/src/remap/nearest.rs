//! Nearest source pixels, as runs of consecutive pixels.
//!
//! Along a row of the output, the source moves on by one pixel most of the time. Runs that are copied as a whole take
//! less memory traffic than an index per pixel.

use crate::simd::{Isa, Kernel};

/// Consecutive pixels of an output row whose sources are consecutive too, or that have none.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run {
    /// Index of the first source pixel; [`OUTSIDE`] where there is none.
    source: u32,
    length: u32,
}

/// The source of output pixels without one.
const OUTSIDE: u32 = u32::MAX;

/// The runs of all output pixels, given the source (column, row) of each, NaN where there is none, and the size of the
/// image. The runs of row r are those from the r-th to the (r + 1)-th of the numbers returned with them.
pub(crate) fn runs(sources: &[[f64; 2]], width: usize, height: usize) -> (Vec<Run>, Vec<u32>) {
    let inside = |coordinate: f64, size: usize| coordinate >= -0.5 && coordinate < size as f64 - 0.5;
    let nearest = |[u, v]: [f64; 2]| {
        let is_inside = inside(u, width) && inside(v, height);
        let index = || (v.round().max(0.0) as usize * width + u.round().max(0.0) as usize) as u32;
        if is_inside { index() } else { OUTSIDE }
    };
    let (mut runs, mut rows) = (Vec::<Run>::new(), vec![0]);
    for row in sources.chunks(width) {
        let first = runs.len();
        for source in row.iter().map(|pixel| nearest(*pixel)) {
            match runs[first..].last_mut() {
                Some(run) if run.source != OUTSIDE && source == run.source + run.length => run.length += 1,
                Some(run) if run.source == OUTSIDE && source == OUTSIDE => run.length += 1,
                _ => runs.push(Run { source, length: 1 }),
            }
        }
        rows.push(runs.len() as u32);
    }
    (runs, rows)
}

/// Copies the nearest source pixels of an output row; 0 where there is none.
pub(crate) struct Nearest<'a, T> {
    /// The runs of the row.
    pub runs: &'a [Run],
    /// The whole image.
    pub image: &'a [T],
    /// The row of the output.
    pub out: &'a mut [T],
}

impl<T: Copy + Default> Kernel for Nearest<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        /// Pixels copied at a time. A copy may go beyond the end of a run; the next run overwrites that.
        const BLOCK: usize = 16;
        let Self { runs, image, out } = self;
        let mut written = 0;
        for run in runs {
            let (source, length) = (run.source as usize, run.length as usize);
            if run.source == OUTSIDE {
                out[written..written + length].fill(T::default());
            } else {
                let padded = length.next_multiple_of(BLOCK);
                match (image.get(source..source + padded), out.get_mut(written..written + padded)) {
                    (Some(image), Some(out)) => {
                        let (from, to) = (image.as_chunks::<BLOCK>().0, out.as_chunks_mut::<BLOCK>().0);
                        to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
                    }
                    _ => out[written..written + length].copy_from_slice(&image[source..source + length]),
                }
            }
            written += length;
        }
    }
}
