//! Division of a frame into bands of pixels, which run on the threads of the current rayon pool.

use std::ops::Add;

use super::summary::CorrectionSummary;

/// Pixels that are taken through all stages at a time, few enough to stay in the first-level cache.
pub(crate) const CHUNK: usize = 1024;
/// Most pixels that are taken at a time where a single loop does all the work: long enough that the cost of entering
/// the loop is negligible.
pub(crate) const STRETCH: usize = 8 * CHUNK;
/// Fewest pixels of a band, some ten microseconds of work: less is not worth another thread.
const FEWEST: usize = 16 * CHUNK;

/// Output that can be split into two parts at a pixel.
pub(crate) trait Split: Sized + Send {
    /// The first `pixels` pixels, and the others.
    fn split(self, pixels: usize) -> (Self, Self);
}

impl Split for () {
    fn split(self, _: usize) -> ((), ()) {
        ((), ())
    }
}

impl<T: Send> Split for &mut [T] {
    fn split(self, pixels: usize) -> (Self, Self) {
        self.split_at_mut(pixels)
    }
}

/// Divides `pixels` pixels into bands and calls `work` for each, with the index of its first pixel, its number of
/// pixels and its part of the output. All bands but the last are a multiple of [`CHUNK`]. Returns the sum of the
/// summaries. Allocates nothing; on a single thread there is one band.
pub(crate) fn for_bands<O: Split>(
    pixels: usize,
    out: O,
    work: &(impl Fn(usize, usize, O) -> CorrectionSummary + Sync),
) -> CorrectionSummary {
    let threads = rayon::current_num_threads();
    if threads == 1 {
        return work(0, pixels, out);
    }
    // Two per thread, so that a thread that is free early finds more work.
    let band = pixels.div_ceil(2 * threads).max(FEWEST).next_multiple_of(CHUNK);
    in_halves(0, pixels, band, out, work)
}

fn in_halves<O: Split>(
    first: usize,
    pixels: usize,
    band: usize,
    out: O,
    work: &(impl Fn(usize, usize, O) -> CorrectionSummary + Sync),
) -> CorrectionSummary {
    if pixels <= band {
        return work(first, pixels, out);
    }
    let before = pixels.div_ceil(band) / 2 * band;
    let (a, b) = out.split(before);
    let (a, b) = rayon::join(
        || in_halves(first, before, band, a, work),
        || in_halves(first + before, pixels - before, band, b, work),
    );
    a.add(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_cover_every_pixel_once() {
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            for pixels in [1, CHUNK, FEWEST + 1, 307_200] {
                let mut out = vec![0u32; pixels];
                let work = |first: usize, count: usize, band: &mut [u32]| {
                    assert!(band.len() == count && first.is_multiple_of(CHUNK));
                    band.iter_mut().enumerate().for_each(|(i, o)| *o += (first + i) as u32 + 1);
                    CorrectionSummary { corrected: count, ..CorrectionSummary::default() }
                };
                let summary = pool.install(|| for_bands(pixels, &mut out[..], &work));
                assert_eq!(summary.corrected, pixels);
                assert!(out.iter().enumerate().all(|(i, o)| *o == i as u32 + 1));
            }
        }
    }
}
