//! Information of every frame on the parameters that all frames share, at the present values of an adjustment: its rows and its
//! normal equations with the pose of the board eliminated.

use std::ops::Range;

use depthcal_model::chain::POSE;
use depthcal_solver::{BatchId, FactorBatch, VariableId};
use nalgebra::{DMatrix, DVector, SVector};
use rayon::prelude::*;

use super::adjustment::Adjustment;
use super::frame_rows::FrameRows;
use super::observations::HUBER;
use super::smoothness_selection::FrameInformation;

/// Which second derivatives normal equations have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Curvature {
    /// Of the reweighted squares that the solver minimises in each step: always definite.
    OfWeights,
    /// Of the loss itself, which is zero beyond three standard deviations: what tells how the optimum moves with the data.
    OfLoss,
}

/// The rows of a group, weighted by the loss.
struct WeightedRows {
    /// By the pose and by those of the chosen parameters that the group has.
    jacobian: DMatrix<f64>,
    /// Numbers of these parameters among the chosen ones.
    present: Vec<usize>,
    residuals: DVector<f64>,
    /// Square roots of the weights, one per row.
    weights: Vec<f64>,
    /// Rows in the linear part of the loss, which has no curvature.
    linear: Vec<usize>,
}

/// The shared parameters of an adjustment: those of all cameras, in the order of [`Adjustment::variables`], each variable once.
struct SharedParameters {
    ranges: Vec<(VariableId, Range<usize>)>,
    /// Those that are free and not known.
    free: Vec<usize>,
}

impl SharedParameters {
    fn of(adjustment: &Adjustment) -> Self {
        let (mut ranges, mut free): (Vec<(VariableId, Range<usize>)>, Vec<usize>) = (Vec::new(), Vec::new());
        let mut first = 0;
        for camera in &adjustment.cameras {
            let is_free = camera.camera.blocks().iter().flat_map(|block| block.free.iter().copied());
            let extrinsics = camera.variables().take(camera.variables_of_extrinsics());
            let is_free_extrinsics = extrinsics
                .flat_map(|id| std::iter::repeat_n(!adjustment.graph.is_fixed(id), adjustment.values.dim(id)));
            let mut is_free = is_free_extrinsics.chain(is_free);
            for id in camera.variables() {
                let dim = adjustment.values.dim(id);
                let of_variable: Vec<bool> = is_free.by_ref().take(dim).collect();
                if ranges.iter().any(|(known, _)| *known == id) {
                    continue;
                }
                free.extend((0..dim).filter(|i| of_variable[*i]).map(|i| first + i));
                ranges.push((id, first..first + dim));
                first += dim;
            }
        }
        Self { ranges, free }
    }

    /// Those of one camera that are free, in the order of its blocks; all others are known.
    fn of_camera(adjustment: &Adjustment, camera: usize) -> Self {
        let shared = Self::of(adjustment);
        let keys = &adjustment.cameras[camera];
        let range =
            |id: VariableId| shared.ranges.iter().find(|(known, _)| *known == id).map(|(_, range)| range.clone());
        let ranges = keys.variables().skip(keys.variables_of_extrinsics()).filter_map(range);
        let free = ranges.flatten().filter(|parameter| shared.free.contains(parameter)).collect();
        Self { free, ..shared }
    }

    /// Columns of the chosen parameters among those of a group over these variables after its pose; `None` for those that it does
    /// not have.
    fn columns(&self, variables: &[VariableId], chosen: &[usize]) -> Vec<Option<usize>> {
        let mut parts: Vec<(&Range<usize>, usize)> = Vec::new();
        let mut first = POSE;
        for id in variables.iter().skip(1) {
            let Some((_, range)) = self.ranges.iter().find(|(known, _)| known == id) else { continue };
            parts.push((range, first));
            first += range.len();
        }
        let column = |parameter: &usize| {
            parts
                .iter()
                .find(|(range, _)| range.contains(parameter))
                .map(|(range, first)| first + parameter - range.start)
        };
        chosen.iter().map(column).collect()
    }
}

impl Adjustment {
    /// Rows, in the covariance of [`Adjustment::camera_covariance`], of the free parameters that all frames share, each once.
    pub fn free_rows(&self) -> Vec<usize> {
        let shared = SharedParameters::of(self);
        let mut first_rows = Vec::new();
        let mut first = 0;
        for id in self.variables() {
            let dim = self.values.dim(id);
            let is_new = !first_rows.iter().any(|(known, _)| *known == id);
            if is_new {
                first_rows.push((id, first..first + dim));
            }
            first += dim;
        }
        let rows: Vec<usize> = first_rows.into_iter().flat_map(|(_, rows)| rows).collect();
        shared.free.iter().map(|parameter| rows[*parameter]).collect()
    }

    /// Information of every frame on the free parameters that all frames share, without priors and with residuals weighted by
    /// their losses. It is zero for frames that cannot be evaluated.
    pub fn frame_information(&self, curvature: Curvature) -> Vec<FrameInformation> {
        self.frame_information_weighted(curvature, |_| 1.0)
    }

    /// Information of every frame on the free parameters of one camera, all others known. Of held-out frames its depth alone is
    /// judged.
    pub fn frame_information_of_camera(&self, camera: usize, curvature: Curvature) -> Vec<FrameInformation> {
        let judged = self.cameras[camera].depth;
        let mut others = self.image_batches();
        others.extend(self.depth_batches().into_iter().filter(|id| Some(*id) != judged));
        let shared = SharedParameters::of_camera(self, camera);
        let frames = self.information_of_parts([&others, judged.as_slice()], &shared, curvature, |_| [1.0]);
        frames.into_iter().map(|[frame]| frame).collect()
    }

    /// [`Adjustment::frame_information`] with the depth of every frame, given by its number, counted so many times.
    pub fn frame_information_weighted(
        &self,
        curvature: Curvature,
        depth_weight: impl Fn(usize) -> f64 + Sync,
    ) -> Vec<FrameInformation> {
        let parts = [&self.image_batches()[..], &self.depth_batches()];
        let shared = SharedParameters::of(self);
        let frames = self.information_of_parts(parts, &shared, curvature, |frame| [depth_weight(frame)]);
        frames.into_iter().map(|[frame]| frame).collect()
    }

    /// [`Adjustment::frame_information`] with the weights of the solver. Of held-out frames only the depth of `camera` is judged;
    /// where frames are fitted, its weight is multiplied with each of two `factors`.
    pub fn frame_information_of_depth(&self, camera: usize, factors: [f64; 2]) -> Vec<[FrameInformation; 2]> {
        let judged = self.cameras[camera].depth;
        let mut others = self.image_batches();
        others.extend(self.depth_batches().into_iter().filter(|id| Some(*id) != judged));
        let shared = SharedParameters::of(self);
        self.information_of_parts([&others, judged.as_slice()], &shared, Curvature::OfWeights, |_| factors)
    }

    /// Information of frames from batches that give poses where a frame is held out, and from batches that are then judged; these
    /// count with each of the `factors` of a frame where it is fitted.
    fn information_of_parts<const N: usize>(
        &self,
        parts: [&[BatchId]; 2],
        shared: &SharedParameters,
        curvature: Curvature,
        factors: impl Fn(usize) -> [f64; N] + Sync,
    ) -> Vec<[FrameInformation; N]> {
        let size = POSE + shared.free.len();
        self.poses
            .par_iter()
            .enumerate()
            .map(|(frame, pose)| {
                let parts = parts.map(|batches| {
                    let mut sum = (DMatrix::zeros(size, size), DVector::zeros(size));
                    for batch in batches.iter().filter_map(|b| self.graph.batch(*b)) {
                        for group in groups_of(batch, pose.id()) {
                            if let Some(rows) = self.weighted_rows(batch, group, shared, &shared.free) {
                                add_information(rows, curvature, &mut sum);
                            }
                        }
                    }
                    sum
                });
                factors(frame).map(|factor| FrameInformation::new(&parts[0], &parts[1], POSE, factor))
            })
            .collect()
    }

    fn image_batches(&self) -> Vec<BatchId> {
        self.cameras.iter().filter_map(|camera| camera.image).collect()
    }

    fn depth_batches(&self) -> Vec<BatchId> {
        self.cameras.iter().filter_map(|camera| camera.depth).collect()
    }

    /// The rows of a group over its pose and those of the chosen parameters that it has; `None` where it cannot be evaluated.
    fn weighted_rows(
        &self,
        batch: &dyn FactorBatch,
        group: usize,
        shared: &SharedParameters,
        chosen: &[usize],
    ) -> Option<WeightedRows> {
        let rows = batch.row_count(group);
        let width: usize = batch.variables(group).iter().map(|id| self.values.dim(*id)).sum();
        let (mut r, mut jacobian) = (vec![0.0; rows], vec![0.0; rows * width]);
        batch.evaluate(group, &self.values, &mut r, Some(&mut jacobian)).ok()?;
        let (dim, loss) = (batch.residual_dim(), batch.loss());
        // Images depend on the leading part of a camera's parameters only, and on no other camera's.
        let columns = shared.columns(batch.variables(group), chosen);
        let present: Vec<usize> = (0..chosen.len()).filter(|i| columns[*i].is_some()).collect();
        let places: Vec<usize> = (0..POSE).chain(columns.into_iter().flatten()).collect();
        let mut part = DMatrix::zeros(rows, places.len());
        let (mut linear, mut weights) = (Vec::new(), Vec::with_capacity(rows));
        for (k, (residual, rows)) in r.chunks_exact_mut(dim).zip(jacobian.chunks_exact(dim * width)).enumerate() {
            let size = residual.iter().map(|r| r * r).sum::<f64>().sqrt();
            let weight = loss.evaluate(size * size)[1].sqrt();
            if size > HUBER {
                linear.extend(k * dim..(k + 1) * dim);
            }
            for (i, row) in rows.chunks_exact(width).enumerate() {
                residual[i] *= weight;
                weights.push(weight);
                for (c, place) in places.iter().enumerate() {
                    part[(k * dim + i, c)] = weight * row[*place];
                }
            }
        }
        Some(WeightedRows { jacobian: part, present, residuals: DVector::from_vec(r), weights, linear })
    }

    /// By how much functions of a frame's own, with the given shapes at every depth sample of a camera in it, turn the gradient
    /// of the cost by the free shared parameters, the frame's pose eliminated: one row per parameter, one column per shape.
    /// `None` for a frame without depth or where it cannot be evaluated.
    pub fn plane_response<const N: usize>(
        &self,
        camera: usize,
        frame: usize,
        shapes: &[SVector<f64, N>],
    ) -> Option<DMatrix<f64>> {
        let pose = self.poses.get(frame)?.id();
        let shared = SharedParameters::of(self);
        let size = POSE + shared.free.len();
        let (mut normal, mut turned) = (DMatrix::zeros(size, size), DMatrix::zeros(size, N));
        let of_camera = self.cameras[camera].depth?;
        for id in self.image_batches().into_iter().chain(self.depth_batches()) {
            let batch = self.graph.batch(id)?;
            let Some(group) = groups_of(batch, pose).next() else {
                if id == of_camera { return None } else { continue }
            };
            let rows = self.weighted_rows(batch, group, &shared, &shared.free)?;
            let places = rows.places();
            let product = rows.jacobian.tr_mul(&rows.jacobian);
            scatter(&product, &places, &mut normal);
            if id == of_camera {
                let planes = DMatrix::from_fn(shapes.len(), N, |row, k| rows.weights[row] * shapes[row][k]);
                let product = rows.jacobian.tr_mul(&planes);
                places.iter().enumerate().for_each(|(i, place)| {
                    let mut row = turned.row_mut(*place);
                    row += product.row(i);
                });
            }
        }
        let count = shared.free.len();
        let of_pose = normal.view((0, 0), (POSE, POSE)).into_owned().cholesky()?;
        let by_pose = normal.view((POSE, 0), (count, POSE)).into_owned();
        let direct = turned.rows(POSE, count).into_owned();
        Some(direct - by_pose * of_pose.solve(&turned.rows(0, POSE).into_owned()))
    }

    /// Residuals of a frame and their derivatives by its pose, weighted as the solver weights them, those of a camera's depth
    /// samples last; `None` where it cannot be evaluated.
    pub(crate) fn frame_rows(&self, camera: usize, frame: usize) -> Option<FrameRows> {
        let pose = self.poses.get(frame)?.id();
        let shared = SharedParameters { ranges: Vec::new(), free: Vec::new() };
        let (mut residuals, mut weights, mut columns, mut depth) = (Vec::new(), Vec::new(), Vec::new(), 0);
        let of_camera = self.cameras[camera].depth;
        let others = self.image_batches().into_iter().chain(self.depth_batches()).filter(|id| Some(*id) != of_camera);
        for id in others.chain(of_camera) {
            let batch = self.graph.batch(id)?;
            let Some(group) = only_group(batch, pose)? else { continue };
            let rows = self.weighted_rows(batch, group, &shared, &[])?;
            residuals.extend(rows.residuals.iter());
            columns.extend(rows.jacobian.transpose().iter());
            depth = if Some(id) == of_camera { rows.weights.len() } else { 0 };
            weights.extend(rows.weights);
        }
        let pose = DMatrix::from_row_slice(residuals.len(), POSE, &columns);
        Some(FrameRows { residuals: DVector::from_vec(residuals), weights, pose, depth })
    }

    /// Weighted derivatives and residuals of a frame's markers and of its depth samples in the only camera, over its pose and
    /// some of the camera's parameters; `columns` count from the pose's on, and of the image those that it depends on are there.
    /// `None` where the frame cannot be evaluated or lacks one of the two.
    pub(crate) fn weighted_parts(&self, frame: usize, columns: &[usize]) -> Option<[(DMatrix<f64>, DVector<f64>); 2]> {
        let pose = self.poses.get(frame)?.id();
        let shared = SharedParameters::of(self);
        let chosen: Vec<usize> = columns.iter().map(|column| column - POSE).collect();
        let part = |id: Option<BatchId>| {
            let batch = self.graph.batch(id?)?;
            let rows = self.weighted_rows(batch, only_group(batch, pose)??, &shared, &chosen)?;
            Some((rows.jacobian, rows.residuals))
        };
        let camera = self.cameras.first()?;
        Some([part(camera.image)?, part(camera.depth)?])
    }
}

impl WeightedRows {
    /// Places of the columns among the pose's and those of the chosen parameters.
    fn places(&self) -> Vec<usize> {
        (0..POSE).chain(self.present.iter().map(|i| POSE + i)).collect()
    }
}

/// Adds the rows of a group to normal equations over the pose and the chosen parameters.
fn add_information(
    mut rows: WeightedRows,
    curvature: Curvature,
    (normal, gradient): &mut (DMatrix<f64>, DVector<f64>),
) {
    let places = rows.places();
    let of_group = rows.jacobian.tr_mul(&rows.residuals);
    if curvature == Curvature::OfLoss {
        for row in &rows.linear {
            rows.jacobian.row_mut(*row).fill(0.0);
        }
    }
    scatter(&rows.jacobian.tr_mul(&rows.jacobian), &places, normal);
    places.iter().zip(of_group.iter()).for_each(|(place, g)| gradient[*place] += g);
}

/// Adds a matrix to the rows and columns of another at the given places.
fn scatter(product: &DMatrix<f64>, places: &[usize], sum: &mut DMatrix<f64>) {
    for (j, column) in places.iter().enumerate() {
        for (i, row) in places.iter().enumerate() {
            sum[(*row, *column)] += product[(i, j)];
        }
    }
}

/// The groups of a frame in a batch.
fn groups_of(batch: &dyn FactorBatch, pose: VariableId) -> impl Iterator<Item = usize> + '_ {
    (0..batch.group_count()).filter(move |group| batch.variables(*group).first() == Some(&pose))
}

/// The group of a pose in a batch, if there is one. `None` where there are several: pixels that are sorted into the cells of a
/// fine field are not in the frame's order.
fn only_group(batch: &dyn FactorBatch, pose: VariableId) -> Option<Option<usize>> {
    let mut groups = groups_of(batch, pose);
    let group = groups.next();
    groups.next().is_none().then_some(group)
}
