//! The relative pose of two cameras from the views that they share.

use crate::observe::PosedFrame;
use crate::start::{FrameMarkers, estimate_pose, local_poses};
use depthcal_model::{Camera, Target};
use depthcal_statistics::{rms, upper_median};
use nalgebra::{Isometry3, Point3};
use rayon::prelude::*;

use super::average::mean;

/// Views whose relative poses are tried for all.
const TRIED: usize = 40;
/// A view contradicts where its error exceeds this many times the median view's …
const CONTRADICTS: f64 = 6.0;
/// … and this, px.
const CONTRADICTS_PX: f64 = 3.0;
/// Share of views that contradict from which on a second place is looked for.
const SECOND_PLACE: f64 = 0.2;
/// Share of those that have to agree on it.
const AGREEING: f64 = 0.6;
/// Fewest views that make a second place.
const FEWEST_OF_PLACE: usize = 3;

/// One camera's part of the views that it shares with another.
#[derive(Clone, Copy)]
pub struct PairView<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Its frames, in the order of the shared views.
    pub frames: &'a [&'a PosedFrame],
}

/// Why a view contradicts the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Contradiction {
    /// The images of the two cameras are exchanged.
    Swapped,
    /// The boards do not meet, by so much in the image of the second camera, px.
    Apart(f64),
}

/// The relative pose of two cameras.
#[derive(Debug, Clone)]
pub struct RelativePose {
    /// Maps the first camera's frame to the second's, mm.
    pub second_from_first: Isometry3<f64>,
    /// Median of the errors of the views in the second camera's image, px.
    pub median_px: f64,
    /// Views that contradict the others, with the reason.
    pub contradicting: Vec<(usize, Contradiction)>,
    /// Another place of the second camera that most of the contradicting views agree on: the camera has moved.
    pub second_place: Option<Isometry3<f64>>,
    /// Poses of the board in the first and the second camera of views that were the wrong one of a plane's two poses, by view.
    pub mirrored: Vec<(usize, [Isometry3<f64>; 2])>,
}

/// The relative pose of two cameras from the views that they share, robust against views that contradict; `None` without views.
///
/// Of the views' own relative poses the one is taken that brings the boards of the median view closest, in the image of the
/// second camera; then the mean of those that agree with it. Distances in the image weigh a plane's pose as its markers
/// determine it.
pub fn relative_pose(target: &Target, first: PairView<'_>, second: PairView<'_>) -> Option<RelativePose> {
    let views: Vec<View<'_>> = first
        .frames
        .iter()
        .zip(second.frames)
        .map(|(a, b)| View { target, cameras: [first.camera, second.camera], frames: [*a, *b] })
        .collect();
    let of_views: Vec<Isometry3<f64>> = views.iter().map(View::own).collect();
    let (mut second_from_first, mut errors) = best_of(&views, &of_views)?;
    let median = |errors: &[f64]| upper_median(&mut errors.to_vec()).unwrap_or(f64::INFINITY);
    let limit = |errors: &[f64]| (CONTRADICTS * median(errors)).max(CONTRADICTS_PX);
    let agreeing: Vec<Isometry3<f64>> =
        of_views.iter().zip(&errors).filter(|(_, e)| **e <= limit(&errors)).map(|(pose, _)| *pose).collect();
    if let Some(mean) = mean(&agreeing) {
        let of_mean: Vec<f64> = views.iter().map(|v| v.error_px(&mean)).collect();
        if median(&of_mean) <= median(&errors) {
            (second_from_first, errors) = (mean, of_mean);
        }
    }
    let limit_px = limit(&errors);
    let mut contradicting = Vec::new();
    let mut mirrored = Vec::new();
    for (number, view) in views.iter().enumerate().filter(|(number, _)| errors[*number] > limit_px) {
        if let Some(poses) = view.mirrored(&second_from_first, limit_px) {
            mirrored.push((number, poses));
        } else if view.is_swapped(&second_from_first, limit_px) {
            contradicting.push((number, Contradiction::Swapped));
        } else {
            contradicting.push((number, Contradiction::Apart(errors[number])));
        }
    }
    let second_place = second_place(&views, &of_views, &contradicting, &second_from_first);
    let median_px = median(&errors);
    Some(RelativePose { second_from_first, median_px, contradicting, second_place, mirrored })
}

/// The relative pose, of some views' own, under which the median view has the least error, and the errors of all views, px.
fn best_of(views: &[View<'_>], own: &[Isometry3<f64>]) -> Option<(Isometry3<f64>, Vec<f64>)> {
    let step = own.len().div_ceil(TRIED).max(1);
    let tried: Vec<(Isometry3<f64>, Vec<f64>)> = own
        .par_iter()
        .step_by(step)
        .map(|pose| (*pose, views.iter().map(|view| view.error_px(pose)).collect::<Vec<f64>>()))
        .collect();
    let median = |errors: &[f64]| upper_median(&mut errors.to_vec()).unwrap_or(f64::INFINITY);
    tried.into_iter().min_by(|a, b| median(&a.1).total_cmp(&median(&b.1)))
}

/// A place on which most of the views that contradict agree.
fn second_place(
    views: &[View<'_>],
    own: &[Isometry3<f64>],
    contradicting: &[(usize, Contradiction)],
    first: &Isometry3<f64>,
) -> Option<Isometry3<f64>> {
    let apart: Vec<usize> = contradicting.iter().filter(|c| c.1 != Contradiction::Swapped).map(|c| c.0).collect();
    if apart.len() < FEWEST_OF_PLACE || (apart.len() as f64) < SECOND_PLACE * views.len() as f64 {
        return None;
    }
    let apart_views: Vec<View<'_>> = apart.iter().map(|i| views[*i]).collect();
    let poses: Vec<Isometry3<f64>> = apart.iter().map(|i| own[*i]).collect();
    let (place, errors) = best_of(&apart_views, &poses)?;
    let agreeing = errors.iter().filter(|e| **e <= CONTRADICTS_PX).count();
    let is_other = (place.inverse() * first).translation.vector.norm() > 0.0;
    (is_other && agreeing >= FEWEST_OF_PLACE && agreeing as f64 >= AGREEING * apart.len() as f64).then_some(place)
}

/// A frame that both cameras saw.
#[derive(Clone, Copy)]
struct View<'a> {
    target: &'a Target,
    cameras: [&'a Camera; 2],
    frames: [&'a PosedFrame; 2],
}

impl View<'_> {
    /// Second from first by this view alone.
    fn own(&self) -> Isometry3<f64> {
        self.frames[1].camera_from_board * self.frames[0].camera_from_board.inverse()
    }

    /// Root mean square distance between the second camera's markers and where the first camera's pose puts them, px; infinite
    /// where they have no image.
    fn error_px(&self, second_from_first: &Isometry3<f64>) -> f64 {
        self.error_of(second_from_first, &self.frames[0].camera_from_board)
    }

    fn error_of(&self, second_from_first: &Isometry3<f64>, first_from_board: &Isometry3<f64>) -> f64 {
        let pose = second_from_first * first_from_board;
        let distances = self.frames[1].markers.iter().map(|m| {
            let p = self.cameras[1].board_point(self.target.point(m.index));
            let projected = self.cameras[1].project(&(pose * Point3::from(p)).coords);
            projected.map_or(f64::INFINITY, |projected| (projected[0] - m.pixel[0]).hypot(projected[1] - m.pixel[1]))
        });
        rms(distances)
    }

    /// Other minima of the two poses with which the view does not contradict.
    fn mirrored(&self, second_from_first: &Isometry3<f64>, limit_px: f64) -> Option<[Isometry3<f64>; 2]> {
        let poses = |i: usize| {
            let markers = FrameMarkers { name: &self.frames[i].name, markers: &self.frames[i].markers };
            local_poses(self.cameras[i], self.target, &markers).unwrap_or_default()
        };
        let (firsts, seconds) = (poses(0), poses(1));
        let first = firsts.iter().find(|p| self.error_of(second_from_first, &p.camera_from_board) <= limit_px)?;
        let predicted = second_from_first * first.camera_from_board;
        let near = |p: &Isometry3<f64>| p.rotation.angle_to(&predicted.rotation);
        let second = seconds.iter().map(|p| p.camera_from_board).min_by(|a, b| near(a).total_cmp(&near(b)));
        Some([first.camera_from_board, second.unwrap_or(predicted)])
    }

    /// Whether the view fits once the images are exchanged.
    fn is_swapped(&self, second_from_first: &Isometry3<f64>, limit_px: f64) -> bool {
        let [a, b] = self.frames;
        let posed = |camera: &Camera, frame: &PosedFrame| {
            let markers = FrameMarkers { name: &frame.name, markers: &frame.markers };
            let pose = estimate_pose(camera, self.target, &markers).ok()?;
            Some(PosedFrame { camera_from_board: pose.camera_from_board, ..frame.clone() })
        };
        let (Some(first), Some(second)) = (posed(self.cameras[0], b), posed(self.cameras[1], a)) else { return false };
        View { frames: [&first, &second], ..*self }.error_px(second_from_first) <= limit_px
    }
}
