//! How the frames of a cross-validation are divided into parts.

use depthcal_statistics::upper_median;

/// How frames are divided into the parts of a cross-validation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Parts {
    /// Every n-th frame belongs to the same part.
    #[default]
    Interleaved,
    /// Every part is a block of consecutive frames: neighbours of a sweep are alike, and a fit that has seen a frame's neighbours
    /// has nearly seen the frame.
    Blocks,
}

/// The part, from 0, of every frame, given the number of its markers in the order of the frames.
///
/// Frames that show few markers determine little: they are divided separately, so that no part takes more than its share of the
/// frames that carry the fit, and every fit without a part can stand.
pub fn parts_of(markers: &[usize], parts: usize, how: Parts) -> Vec<usize> {
    let mut counts: Vec<f64> = markers.iter().map(|m| *m as f64).collect();
    let enough = upper_median(&mut counts).unwrap_or(0.0) / 2.0;
    let mut part_of = vec![0; markers.len()];
    for carries in [true, false] {
        let members: Vec<usize> = (0..markers.len()).filter(|i| (markers[*i] as f64 >= enough) == carries).collect();
        for (k, frame) in members.iter().enumerate() {
            part_of[*frame] = match how {
                Parts::Interleaved => k % parts,
                Parts::Blocks => k * parts / members.len(),
            };
        }
    }
    part_of
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_are_alike_are_divided_in_their_order() {
        assert_eq!(parts_of(&[40; 7], 3, Parts::Interleaved), [0, 1, 2, 0, 1, 2, 0]);
        assert_eq!(parts_of(&[40; 7], 3, Parts::Blocks), [0, 0, 0, 1, 1, 2, 2]);
    }

    /// Ten frames with many markers among 22 with few, all good ones at the places that one part would take: every part has two.
    #[test]
    fn frames_that_carry_the_fit_are_spread_over_the_parts() {
        for how in [Parts::Interleaved, Parts::Blocks] {
            // With more poor frames than good ones the median is poor: nothing tells them apart, and nothing has to.
            let markers: Vec<usize> = (0..25).map(|i| if i % 5 == 0 || i % 5 == 3 { 40 } else { 38 }).collect();
            let part_of = parts_of(&markers, 5, how);
            assert!((0..5).all(|p| part_of.iter().filter(|o| **o == p).count() == 5));
            let markers: Vec<usize> = (0..25).map(|i| if i % 5 == 0 { 6 } else { 40 }).collect();
            let part_of = parts_of(&markers, 5, how);
            for part in 0..5 {
                let poor = (0..25).filter(|i| part_of[*i] == part && markers[*i] == 6).count();
                assert_eq!(poor, 1, "{how:?}, part {part}: {part_of:?}");
            }
        }
    }
}
