//! Which frames are worth keeping: sharp, at rest, and different from those that are kept.

use std::collections::{BTreeMap, VecDeque};

use depthcal_io::MarkerObservation;

/// Movement between two frames of a video up to which the board is at rest, as a share of the image's diagonal: 1 px of 800.
const STILL: f64 = 0.00125;
/// Frames in which the board has to be at rest one after another: at 30 Hz a tenth of a second.
const STILL_FRAMES: u32 = 3;
/// Edges of this width are sharp whatever the others are, px.
const SHARP_PX: f64 = 3.0;
/// Edges may be so many times as wide as in the sharper quarter of the last frames.
const WIDER: f64 = 1.8;
/// Number of frames that are compared.
const COMPARED: usize = 60;
/// Mean distance of the markers from those of every kept frame that makes a frame another, as a share of the image's diagonal.
const DIFFERENT: f64 = 0.04;

/// How a frame is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Judgement {
    pub is_sharp: bool,
    pub is_still: bool,
}

/// Compares frames with those before.
#[derive(Debug, Default)]
pub(crate) struct Judge {
    before: Vec<MarkerObservation>,
    still_frames: u32,
    widths: VecDeque<f64>,
}

impl Judge {
    /// Judges a frame in which the board was found; without markers, it was not. `diagonal` is that of the image, px.
    pub(crate) fn judge(
        &mut self,
        markers: &[MarkerObservation],
        edge_width_px: Option<f64>,
        diagonal: f64,
        is_video: bool,
    ) -> Judgement {
        let moved = mean_distance(markers, &self.before);
        let is_near = moved.is_some_and(|moved| moved <= STILL * diagonal);
        self.still_frames = if is_near { self.still_frames + 1 } else { 0 };
        self.before = markers.to_vec();
        let is_sharp = edge_width_px.is_some_and(|width| {
            self.widths.push_back(width);
            if self.widths.len() > COMPARED {
                self.widths.pop_front();
            }
            let mut widths: Vec<f64> = self.widths.iter().copied().collect();
            widths.sort_by(f64::total_cmp);
            width <= (WIDER * widths[widths.len() / 4]).max(SHARP_PX)
        });
        Judgement { is_sharp, is_still: !is_video || self.still_frames >= STILL_FRAMES }
    }
}

/// Whether the markers lie elsewhere than those of another frame.
pub(crate) fn differ(markers: &[MarkerObservation], others: &[MarkerObservation], diagonal: f64) -> bool {
    mean_distance(markers, others).is_none_or(|distance| distance > DIFFERENT * diagonal)
}

/// Mean distance of the markers that both have, px; `None` where they have fewer than three in common.
fn mean_distance(a: &[MarkerObservation], b: &[MarkerObservation]) -> Option<f64> {
    let places: BTreeMap<usize, [f64; 2]> = b.iter().map(|marker| (marker.index, marker.pixel)).collect();
    let distances = a.iter().filter_map(|marker| {
        let other = places.get(&marker.index)?;
        Some((marker.pixel[0] - other[0]).hypot(marker.pixel[1] - other[1]))
    });
    let (sum, count) = distances.fold((0.0, 0_usize), |(sum, count), distance| (sum + distance, count + 1));
    (count >= 3).then(|| sum / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn markers(shift: f64) -> Vec<MarkerObservation> {
        let marker = |index| MarkerObservation {
            index,
            pixel: [10.0 * (index % 5) as f64 + shift, (index / 5) as f64],
            std_px: 1.0,
        };
        (0..20).map(marker).collect()
    }

    #[test]
    fn a_board_is_at_rest_after_frames_that_are_alike() {
        let mut judge = Judge::default();
        let mut is_still = |shift| judge.judge(&markers(shift), Some(2.0), 800.0, true).is_still;
        assert!(!is_still(0.0), "nothing is known of the first");
        assert!([5.0, 10.0, 15.0].into_iter().all(|shift| !is_still(shift)));
        assert_eq!([15.5, 15.4, 15.6, 15.5].map(&mut is_still), [false, false, true, true]);
        assert!(!is_still(20.0));
        let mut judge = Judge::default();
        assert!(
            judge.judge(&markers(0.0), Some(2.0), 800.0, false).is_still,
            "a shot is not compared with the one before"
        );
    }

    #[test]
    fn edges_are_compared_with_those_of_other_frames() {
        let mut judge = Judge::default();
        let mut is_sharp = |width| judge.judge(&markers(0.0), width, 800.0, false).is_sharp;
        assert!((0..8).all(|_| is_sharp(Some(4.0))));
        assert!(is_sharp(Some(6.0)) && !is_sharp(Some(8.0)) && !is_sharp(None));
        // A camera of which all images are soft still has its better ones.
        assert!((0..60).map(|_| is_sharp(Some(8.0))).last().unwrap());
        assert!(is_sharp(Some(2.9)));
    }

    #[test]
    fn frames_differ_by_the_places_of_their_markers() {
        assert!(!differ(&markers(0.0), &markers(30.0), 800.0));
        assert!(differ(&markers(0.0), &markers(34.0), 800.0));
        assert!(differ(&markers(0.0)[..2], &markers(0.0), 800.0), "two markers say nothing of a pose");
    }
}
