//! Work over all pixels in bands, on the threads of the present pool.

use std::ops::Add;

use super::CorrectionSummary;

/// Pixels that are taken through all stages while they are in the first-level cache.
pub(super) const CHUNK: usize = 1024;
/// Pixels at most that are taken at a time where one loop does all: what goes before and after it then hardly counts.
pub(super) const STRETCH: usize = 8 * CHUNK;
/// Fewest pixels that are worth another thread: some ten microseconds of work.
const FEWEST: usize = 16 * CHUNK;

/// Output that can be cut in two at a pixel.
pub(super) trait Split: Sized + Send {
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

/// Calls `work` with the first pixel, the number of pixels and the output of bands that cover `pixels` pixels. A band is a
/// whole number of chunks, but for the last. Allocates nothing; on one thread it is one call.
pub(super) fn for_bands<O: Split>(
    pixels: usize,
    out: O,
    work: &(impl Fn(usize, usize, O) -> CorrectionSummary + Sync),
) -> CorrectionSummary {
    let threads = rayon::current_num_threads();
    if threads == 1 {
        return work(0, pixels, out);
    }
    // Two for each thread, so that one that comes late finds something left.
    let band = pixels.div_ceil(2 * threads).max(FEWEST).next_multiple_of(CHUNK);
    halves(0, pixels, band, out, work)
}

fn halves<O: Split>(
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
    let (a, b) =
        rayon::join(|| halves(first, before, band, a, work), || halves(first + before, pixels - before, band, b, work));
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
