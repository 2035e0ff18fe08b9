//! Which depth image belongs to which image.

use std::ops::ControlFlow;

use crate::error::{ImportError, Span};
use crate::guess::Candidate;
use crate::message::{Content, content};
use crate::pick::Picked;
use crate::recording::Recording;

/// How depth is paired with images.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Pairing {
    /// By time: the nearest depth image, at most half a frame away.
    #[default]
    Time,
    /// The first image with the first depth image, the second with the second, and so on; there are as many of both.
    Order,
    /// By time, after these seconds were added to the times of the depth images: their clock is another.
    Offset(f64),
}

/// The time of capture and that of recording of a message, ns.
#[derive(Debug, Clone, Copy)]
struct Times {
    captured: u64,
    recorded: u64,
}

/// The number of the depth image of each picked image; `None` where it has none.
///
/// # Errors
/// [`ImportError::Unpaired`] where no image has one, [`ImportError::Counts`] where the order pairs nothing.
pub(crate) fn paired(
    recording: &Recording,
    [image, depth]: [&Candidate; 2],
    picked: &Picked,
    pairing: Pairing,
) -> Result<Vec<Option<usize>>, ImportError> {
    let times = times(recording, depth)?;
    let offset_ns = match pairing {
        Pairing::Order if times.len() != picked.of => {
            return Err(ImportError::Counts { path: recording.path.clone(), images: picked.of, depths: times.len() });
        }
        Pairing::Order => return Ok(picked.images.iter().map(|seen| Some(seen.number)).collect()),
        Pairing::Offset(seconds) => (seconds * 1e9).round() as i64,
        Pairing::Time => 0,
    };
    let shifted: Vec<u64> = times.iter().map(|time| time.captured.saturating_add_signed(offset_ns)).collect();
    let pairs = nearest(&shifted, picked);
    if pairs.iter().all(Option::is_none) && !picked.images.is_empty() {
        return Err(unpaired(recording, [image, depth], &times));
    }
    Ok(pairs)
}

/// Times of the messages of a stream.
fn times(recording: &Recording, stream: &Candidate) -> Result<Vec<Times>, ImportError> {
    let mut times = Vec::new();
    recording.visit(&|s| *s == stream.stream, &mut |packet| {
        let recorded = packet.time_ns;
        if let Content::Picture(captured, _) = content(&recording.path, &packet)? {
            times.push(Times { captured, recorded });
        }
        Ok(ControlFlow::Continue(()))
    })?;
    Ok(times)
}

fn nearest(times: &[u64], picked: &Picked) -> Vec<Option<usize>> {
    let mut order: Vec<usize> = (0..times.len()).collect();
    order.sort_by_key(|i| times[*i]);
    let mut gaps: Vec<u64> = order.windows(2).map(|pair| times[pair[1]] - times[pair[0]]).collect();
    gaps.sort_unstable();
    // A lone depth image belongs to an image within a second.
    let within = gaps.get(gaps.len() / 2).map_or(1_000_000_000, |gap| gap.div_ceil(2)).max(1_000_000);
    let nearest = |time: u64| {
        let after = order.partition_point(|i| times[*i] < time);
        let near = order[after.saturating_sub(1)..(after + 1).min(order.len())].iter().copied();
        near.min_by_key(|i| times[*i].abs_diff(time)).filter(|i| times[*i].abs_diff(time) <= within)
    };
    picked.images.iter().map(|seen| nearest(seen.time_ns)).collect()
}

/// The error of streams whose times have nothing in common: both ranges, and the offset between the clocks by the times at which
/// the recorder received the messages or, where it noted only the clocks' own, by the first images.
fn unpaired(recording: &Recording, [image, depth]: [&Candidate; 2], depths: &[Times]) -> ImportError {
    let images = match times(recording, image) {
        Ok(images) => images,
        Err(error) => return error,
    };
    let delay = |times: &[Times]| {
        let mut delays: Vec<i64> = times.iter().map(|t| t.captured.wrapping_sub(t.recorded) as i64).collect();
        delays.sort_unstable();
        delays.get(delays.len() / 2).copied().unwrap_or(0)
    };
    let first = |times: &[Times]| times.iter().map(|t| t.captured).min().unwrap_or(0);
    let offset_ns = match delay(&images).saturating_sub(delay(depths)) {
        0 => first(&images).wrapping_sub(first(depths)) as i64,
        offset => offset,
    };
    let span = |stream: &Candidate, times: &[Times]| Span {
        stream: stream.stream.name.clone(),
        count: times.len(),
        first_s: first(times) as f64 / 1e9,
        last_s: times.iter().map(|t| t.captured).max().unwrap_or(0) as f64 / 1e9,
    };
    ImportError::Unpaired {
        path: recording.path.clone(),
        streams: Box::new([span(image, &images), span(depth, depths)]),
        offset_s: offset_ns as f64 / 1e9,
    }
}
