//! The graph of shared views: every camera's place by the pairs that share most views.

use std::collections::BTreeMap;

use crate::observe::{CameraFrames, DroppedFrame, PosedFrame};
use depthcal_model::Camera;
use nalgebra::Isometry3;
use tracing::{info, warn};

use super::error::ExtrinsicsError;
use super::labels::agree_on_labels;
use super::offset::{MovingView, OffsetEstimate, time_offset};
use super::pair::{Contradiction, PairView, RelativePose, relative_pose};
use crate::observe::board_motion::{BoardMotion, motions};

/// Views that two cameras need to share to be connected.
const FEWEST_VIEWS: usize = 2;
/// Frames that a message names.
const NAMED: usize = 6;
/// Disagreement of a pair with the places by other pairs from which on it is reported, px per median view's error.
const LOOP_RATIO: f64 = 6.0;
/// … and px.
const LOOP_PX: f64 = 3.0;

/// A camera whose frames have poses.
pub struct Node<'a> {
    /// Its name.
    pub name: &'a str,
    /// The camera.
    pub camera: &'a Camera,
    /// Its frames.
    pub capture: &'a mut CameraFrames<PosedFrame>,
    /// By how much it exposes later than its times say, s, where it exposes at other moments than the reference and the board
    /// moves.
    pub offset_s: Option<f64>,
}

/// The places of all cameras that have images.
#[derive(Debug, Clone)]
pub struct Places {
    /// `camera_from_rig` of every camera.
    pub camera_from_rig: Vec<Isometry3<f64>>,
    /// Pairs of cameras that share views.
    pub pairs: Vec<PairSummary>,
}

/// Views that two cameras share, and how well they agree.
#[derive(Debug, Clone, PartialEq)]
pub struct PairSummary {
    /// Their names.
    pub cameras: [String; 2],
    /// Frames that both saw.
    pub views: usize,
    /// Of these, frames that contradict the others.
    pub contradicting: usize,
    /// Distance of the boards in the second camera's image in the median view, px, with poses of single images.
    pub median_px: f64,
}

/// Connects the cameras by the views that they share, the first being the reference. Poses that were the wrong one of a plane's
/// two are corrected; frames that contradict are dropped from the camera that shares fewer views, with the reason.
///
/// # Errors
///
/// [`ExtrinsicsError::Unconnected`], [`ExtrinsicsError::Moved`].
pub fn connect(nodes: &mut [Node<'_>]) -> Result<Places, ExtrinsicsError> {
    let mut edges: Vec<([usize; 2], RelativePose, usize)> = Vec::new();
    let mut pairs = Vec::new();
    for b in 1..nodes.len() {
        for a in 0..b {
            let moves = nodes[a].offset_s.is_some() || nodes[b].offset_s.is_some();
            let mut shared = shared_frames(nodes[a].capture, nodes[b].capture);
            if !moves {
                number_alike([a, b], nodes, &shared);
            }
            let mut firsts: Vec<PosedFrame> = shared.iter().map(|s| nodes[a].capture.frames[s[0]].clone()).collect();
            if moves {
                (shared, firsts) = when_the_second_exposes([&nodes[a], &nodes[b]], &shared);
            }
            if shared.is_empty() {
                continue;
            }
            let seconds: Vec<PosedFrame> = shared.iter().map(|s| nodes[b].capture.frames[s[1]].clone()).collect();
            let (firsts, seconds): (Vec<_>, Vec<_>) = (firsts.iter().collect(), seconds.iter().collect());
            let view = |n: usize, frames| PairView { camera: nodes[n].camera, frames };
            let relative = relative_pose(&nodes[a].capture.target, view(a, &firsts), view(b, &seconds));
            let Some(relative) = relative else { continue };
            check_moved([nodes[a].name, nodes[b].name], &firsts, &relative)?;
            let contradicting = relative.contradicting.len();
            let cameras = [a, b].map(|n| nodes[n].name.to_owned());
            pairs.push(PairSummary { cameras, views: shared.len(), contradicting, median_px: relative.median_px });
            for (view, poses) in relative.mirrored.iter().filter(|_| !moves) {
                let [first, second] = shared[*view];
                nodes[a].capture.frames[first].camera_from_board = poses[0];
                nodes[b].capture.frames[second].camera_from_board = poses[1];
            }
            drop_contradicting([a, b], nodes, &shared, &relative);
            let agreeing = shared.len() - contradicting;
            edges.push(([a, b], relative, agreeing));
        }
    }
    let camera_from_rig = spanning_tree(nodes, &edges)?;
    check_loops(nodes, &edges, &camera_from_rig);
    Ok(Places { camera_from_rig, pairs })
}

/// Numbers boards that look the same after a turn alike in the views that two cameras share; the first one's stay as they are.
fn number_alike([a, b]: [usize; 2], nodes: &mut [Node<'_>], shared: &[[usize; 2]]) {
    let (before, after) = nodes.split_at_mut(b);
    let (first, Some(second)) = (&before[a], after.first_mut()) else { return };
    let target = first.capture.target.clone();
    let mut seconds: Vec<Option<&mut PosedFrame>> = second.capture.frames.iter_mut().map(Some).collect();
    let view = |[i, j]: &[usize; 2]| Some((&first.capture.frames[*i], seconds.get_mut(*j)?.take()?));
    agree_on_labels(&target, &mut shared.iter().filter_map(view).collect::<Vec<_>>());
}

/// Places of the frames that both captures have.
fn shared_frames(first: &CameraFrames<PosedFrame>, second: &CameraFrames<PosedFrame>) -> Vec<[usize; 2]> {
    let places: BTreeMap<&str, usize> = second.frames.iter().enumerate().map(|(i, f)| (f.name.as_str(), i)).collect();
    let frames = first.frames.iter().enumerate();
    frames.filter_map(|(i, frame)| Some([i, *places.get(frame.name.as_str())?])).collect()
}

/// Of shared frames those about which the board's motion is known, and the first camera's part of them with the board where it is
/// when the second camera exposes.
fn when_the_second_exposes(
    [first, second]: [&Node<'_>; 2],
    shared: &[[usize; 2]],
) -> (Vec<[usize; 2]>, Vec<PosedFrame>) {
    let offset_s = second.offset_s.unwrap_or(0.0) - first.offset_s.unwrap_or(0.0);
    let views = moving_views(first.capture, second.capture, shared);
    let moved = |(places, view): ([usize; 2], MovingView)| {
        let mut frame = first.capture.frames[places[0]].clone();
        frame.camera_from_board = view.motion.after(offset_s + view.later_s).of(&view.first_from_board);
        (places, frame)
    };
    views.into_iter().map(moved).unzip()
}

/// The views of shared frames about which the board's motion in the first camera is known.
fn moving_views(
    first: &CameraFrames<PosedFrame>,
    second: &CameraFrames<PosedFrame>,
    shared: &[[usize; 2]],
) -> Vec<([usize; 2], MovingView)> {
    let mut about: Vec<Option<BoardMotion>> = vec![None; first.frames.len()];
    for board in 0..first.target.parts().len() {
        let frames_of_board: Vec<usize> = (0..about.len()).filter(|i| first.frames[*i].board == board).collect();
        let pose = |i: &usize| (first.frames[*i].metadata.timestamp_s, first.frames[*i].camera_from_board);
        let board_motions = motions(&frames_of_board.iter().map(pose).collect::<Vec<_>>());
        frames_of_board.iter().zip(board_motions).for_each(|(i, motion)| about[*i] = motion);
    }
    let view = |places: &[usize; 2]| {
        let (a, b) = (&first.frames[places[0]], &second.frames[places[1]]);
        let later_s = b.metadata.timestamp_s? - a.metadata.timestamp_s?;
        let (first_from_board, second_from_board) = (a.camera_from_board, b.camera_from_board);
        Some((*places, MovingView { first_from_board, motion: about[places[0]]?, later_s, second_from_board }))
    };
    shared.iter().filter_map(view).collect()
}

/// By how much the second camera exposes later than its times say against the first, by the poses of single images; `None` where
/// the two share too few frames about which the board's motion is known.
pub fn offset_between(first: &CameraFrames<PosedFrame>, second: &CameraFrames<PosedFrame>) -> Option<OffsetEstimate> {
    let views = moving_views(first, second, &shared_frames(first, second));
    time_offset(&first.target, &views.into_iter().map(|(_, view)| view).collect::<Vec<_>>())
}

fn listed(names: &[&str]) -> String {
    let more = names.len().saturating_sub(NAMED);
    let shown = names.iter().take(NAMED).copied().collect::<Vec<_>>().join(", ");
    if more > 0 { format!("{shown} and {more} more") } else { shown }
}

fn check_moved(names: [&str; 2], frames: &[&PosedFrame], found: &RelativePose) -> Result<(), ExtrinsicsError> {
    let Some(place) = found.second_place else { return Ok(()) };
    let moved: Vec<usize> = found.contradicting.iter().map(|c| c.0).collect();
    let (second, first): (Vec<_>, Vec<_>) = frames.iter().enumerate().partition(|(i, _)| moved.contains(i));
    let name = |(_, frame): &(usize, &&PosedFrame)| frame.name.clone();
    let (first, second): (Vec<String>, Vec<String>) =
        (first.iter().map(name).collect(), second.iter().map(name).collect());
    let shown = |names: &[String]| listed(&names.iter().map(String::as_str).collect::<Vec<_>>());
    let motion = place * found.second_from_first.inverse();
    Err(ExtrinsicsError::Moved {
        camera: names[1].to_owned(),
        other: names[0].to_owned(),
        first: first.len(),
        first_frames: shown(&first).into(),
        second: second.len(),
        second_frames: shown(&second).into(),
        angle_deg: motion.rotation.angle().to_degrees(),
        distance_mm: (place.inverse().translation.vector - found.second_from_first.inverse().translation.vector).norm(),
    })
}

/// Drops the frames of views that contradict from the second camera.
fn drop_contradicting([a, b]: [usize; 2], nodes: &mut [Node<'_>], shared: &[[usize; 2]], found: &RelativePose) {
    let mut places: Vec<(usize, Contradiction)> =
        found.contradicting.iter().map(|(view, why)| (shared[*view][1], *why)).collect();
    places.sort_by_key(|(place, _)| std::cmp::Reverse(*place));
    for (place, why) in places {
        let first = nodes[a].name.to_owned();
        let node = &mut nodes[b];
        let frame = node.capture.frames.remove(place);
        let reason = match why {
            Contradiction::Swapped => format!("its image and that of {first} are exchanged"),
            Contradiction::Apart(px) => {
                format!(
                    "its board is {px:.1} px from where {first} sees it: the board or a camera moved between the two exposures"
                )
            }
        };
        warn!("camera {}: frame {} is dropped: {reason}", node.name, frame.name);
        node.capture.dropped.push(DroppedFrame { name: frame.name.clone(), reason });
    }
}

/// Places along the pairs with the most views that agree (Prim 1957).
fn spanning_tree(
    nodes: &[Node<'_>],
    edges: &[([usize; 2], RelativePose, usize)],
) -> Result<Vec<Isometry3<f64>>, ExtrinsicsError> {
    let mut places: Vec<Option<Isometry3<f64>>> = vec![None; nodes.len()];
    places[0] = Some(Isometry3::identity());
    loop {
        let open = edges
            .iter()
            .filter(|([a, b], _, views)| *views >= FEWEST_VIEWS && (places[*a].is_some() != places[*b].is_some()));
        // Of equals the first, so that the order of the file decides.
        let Some(([a, b], relative, views)) = open.rev().max_by_key(|(_, _, views)| *views) else { break };
        info!("{} and {} share {views} views that agree", nodes[*a].name, nodes[*b].name);
        match (places[*a], places[*b]) {
            (Some(place), None) => places[*b] = Some(relative.second_from_first * place),
            (None, Some(place)) => places[*a] = Some(relative.second_from_first.inverse() * place),
            _ => break,
        }
    }
    let lost = places.iter().position(Option::is_none);
    if let Some(lost) = lost {
        let shared = edges.iter().filter(|e| e.0.contains(&lost)).map(|e| e.2).max().unwrap_or(0);
        return Err(ExtrinsicsError::Unconnected {
            camera: nodes[lost].name.to_owned(),
            reference: nodes[0].name.to_owned(),
            shared,
            needed: FEWEST_VIEWS,
        });
    }
    Ok(places.into_iter().flatten().collect())
}

/// Reports pairs that disagree with the places that other pairs give.
fn check_loops(nodes: &[Node<'_>], edges: &[([usize; 2], RelativePose, usize)], places: &[Isometry3<f64>]) {
    for ([a, b], relative, views) in edges.iter().filter(|e| e.2 >= FEWEST_VIEWS) {
        let by_places = places[*b] * places[*a].inverse();
        let error = by_places * relative.second_from_first.inverse();
        let [fx, ..] = nodes[*b].camera.pinhole();
        let px = fx * error.rotation.angle();
        if px > LOOP_PX && px > LOOP_RATIO * relative.median_px {
            warn!(
                "{} and {}: the {views} views that they share put them {:.2}° and {:.1} mm from where the other cameras' views do",
                nodes[*a].name,
                nodes[*b].name,
                error.rotation.angle().to_degrees(),
                error.translation.vector.norm()
            );
        }
    }
}
