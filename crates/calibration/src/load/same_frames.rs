//! Frames that are copies of others: they would count twice, and be predicted by themselves in a cross-validation.

use tracing::warn;

use crate::observe::{DetectedFrame, DroppedFrame, MeasuredDepth};

/// Takes frames out whose markers and depth are those of an earlier frame to the bit, which noise never gives twice; they are
/// among the dropped. Only frames with images count: simulated points may have no noise.
pub(super) fn drop_copies(frames: &mut Vec<DetectedFrame>, dropped: &mut Vec<DroppedFrame>) {
    let mut firsts: Vec<DetectedFrame> = Vec::with_capacity(frames.len());
    let mut copies = 0;
    for frame in frames.drain(..) {
        match firsts.iter().find(|first| is_copy(first, &frame)) {
            Some(first) => {
                copies += 1;
                let reason = format!("its image and depth are those of {}: it would count twice", first.name);
                dropped.push(DroppedFrame { name: frame.name.clone(), reason });
            }
            None => firsts.push(frame),
        }
    }
    if copies > 0 {
        warn!("{copies} frames are copies of others and are left out, as they would count twice");
    }
    *frames = firsts;
}

fn is_copy(a: &DetectedFrame, b: &DetectedFrame) -> bool {
    let has_images = a.image.is_some() && b.image.is_some();
    let is_equal_depth = match (&a.depth, &b.depth) {
        (MeasuredDepth::None, MeasuredDepth::None) => true,
        (MeasuredDepth::Image(_), MeasuredDepth::Image(_)) => a.depth_digest == b.depth_digest,
        _ => false,
    };
    has_images && a.board == b.board && is_equal_depth && a.markers == b.markers
}

#[cfg(test)]
mod tests {
    use depthcal_io::{GrayImage, MarkerObservation};

    use super::*;
    use crate::observe::RawFrame;

    fn frame(name: &str, u: f64, digest: Option<u64>) -> DetectedFrame {
        let image = GrayImage { width: 1, height: 1, data: vec![0], bits: 8 };
        let raw =
            RawFrame { name: name.to_owned(), image: Some(image.into()), depth_digest: digest, ..RawFrame::default() };
        let markers = vec![MarkerObservation { index: 0, pixel: [u, 2.0], std_px: 1.0 }];
        DetectedFrame { raw, markers, ..DetectedFrame::default() }
    }

    #[test]
    fn copies_are_counted_once_and_frames_that_differ_by_noise_stay() {
        let mut frames = vec![frame("a", 1.0, None), frame("b", 1.0 + 1e-12, None), frame("c", 1.0, None)];
        let mut dropped = Vec::new();
        drop_copies(&mut frames, &mut dropped);
        assert_eq!(frames.iter().map(|f| f.name.as_str()).collect::<Vec<_>>(), ["a", "b"]);
        assert!(dropped[0].name == "c" && dropped[0].reason.contains("those of a"));
        let depth = |number| {
            MeasuredDepth::Image(
                depthcal_io::DepthFrame { width: 1, height: 1, values: depthcal_io::DepthValues::Steps(vec![number]) }
                    .into(),
            )
        };
        let mut other_depth = vec![frame("a", 1.0, Some(1)), frame("b", 1.0, Some(2))];
        for (number, frame) in (1..).zip(&mut other_depth) {
            frame.raw.depth = depth(number);
        }
        drop_copies(&mut other_depth, &mut dropped);
        assert_eq!((other_depth.len(), dropped.len()), (2, 1));
    }
}
