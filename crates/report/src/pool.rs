//! Sets of evaluated frames, and their errors with intervals.

use std::collections::BTreeSet;

use super::input::{ReportCamera, ReportDataset, ReportDiagnosis, Role};
use depthcal_calibration::judge::camera::{EvaluatedFrame, outliers};
use depthcal_calibration::judge::depth_errors::PixelError;
use depthcal_calibration::judge::intervals::{self, Change};
use depthcal_io::Outliers;
use depthcal_statistics::Estimate;

/// A frame with its dataset and role.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pooled<'a> {
    pub frame: &'a EvaluatedFrame,
    pub dataset: &'a str,
    pub role: Role,
}

/// A set of frames.
#[derive(Debug, Clone)]
pub(super) struct Pool<'a> {
    pub frames: Vec<Pooled<'a>>,
}

fn of_dataset<'a>(d: &ReportDataset<'a>) -> impl Iterator<Item = Pooled<'a>> {
    let (dataset, role) = (d.evaluated.name.as_str(), d.role);
    d.evaluated.frames.iter().map(move |frame| Pooled { frame, dataset, role })
}

impl<'a> Pool<'a> {
    /// Frames of the datasets that `keep` accepts.
    pub(super) fn of(camera: &ReportCamera<'a>, keep: impl Fn(Role) -> bool) -> Self {
        Self { frames: camera.evaluations.iter().filter(|d| keep(d.role)).flat_map(of_dataset).collect() }
    }

    /// Frames of one dataset.
    pub(super) fn one(dataset: &ReportDataset<'a>) -> Self {
        Self { frames: of_dataset(dataset).collect() }
    }

    /// The frames that the headline speaks of, and what they were to the fit: held-out ones, else other captures, else
    /// the fitted ones.
    pub(super) fn headline(camera: &ReportCamera<'a>) -> (Self, Role) {
        for role in [Role::HeldOut, Role::Other] {
            let pool = Self::of(camera, |r| r == role);
            if !pool.frames.is_empty() {
                return (pool, role);
            }
        }
        (Self::of(camera, |_| true), Role::Fitted)
    }

    /// Frames of a diagnosis with their errors under the last model: those that its headline speaks of.
    pub(super) fn last(camera: &ReportCamera<'a>) -> Self {
        Self::headline(camera).0
    }

    /// Frames of a diagnosis with their errors under the declared model.
    pub(super) fn declared(d: &ReportDiagnosis<'a>) -> Self {
        Self::one(&ReportDataset { evaluated: d.before, role: Role::HeldOut })
    }

    /// Number of different frames: one that is fitted and held out, as in a cross-validation, counts once.
    pub(super) fn frame_count(&self) -> usize {
        self.frames.iter().map(|f| (f.dataset, f.frame.name.as_str())).collect::<BTreeSet<_>>().len()
    }

    /// Whether any frame has a depth error.
    pub(super) fn has_depth(&self) -> bool {
        self.pixels().next().is_some()
    }

    /// All usable pixels of those that were kept one by one.
    pub(super) fn pixels(&self) -> impl Iterator<Item = &'a PixelError> + Clone + '_ {
        self.frames.iter().flat_map(|f| f.frame.pixels.iter()).filter(|p| p.is_usable())
    }

    fn evaluated(&self) -> impl Iterator<Item = &'a EvaluatedFrame> + Clone + '_ {
        self.frames.iter().map(|f| f.frame)
    }

    /// Mean dot error, mm; `None` without depth.
    pub(super) fn dot_error(&self) -> Option<Change> {
        intervals::dot_error(self.evaluated())
    }

    /// Mean plane error, mm; `None` without depth.
    pub(super) fn plane_error(&self) -> Option<Change> {
        intervals::plane_error(self.evaluated())
    }

    /// Root mean square depth error, mm; `None` without depth.
    pub(super) fn depth_rms(&self) -> Option<Change> {
        intervals::depth_rms(self.evaluated())
    }

    /// Number of markers of these frames that were left out.
    pub(super) fn wrong_markers(&self) -> usize {
        self.frames.iter().map(|f| f.frame.wrong_markers).sum()
    }

    /// Board pixels of these frames that were left out of the errors of depth; `None` without depth.
    pub(super) fn outliers(&self) -> Option<Outliers> {
        outliers(self.evaluated())
    }

    /// Root mean square reprojection error, px, and the number of frames.
    pub(super) fn reprojection(&self) -> Option<(Estimate, usize)> {
        intervals::reprojection(self.evaluated())
    }
}
