//! The factors of the calibration graph: markers and depth pixels of a camera, a group per frame. The camera's chain stands
//! behind two poses: `rig_from_board` of the frame, and the camera's extrinsics `camera_from_rig`, which the reference (or the
//! only camera) does not have.

use std::cell::RefCell;
use std::sync::Arc;

use depthcal_model::chain::{Chain, DepthQuery, POSE, Workspace};
use depthcal_solver::{EvaluationError, FactorBatch, Key, Loss, Values, VariableId};
use nalgebra::{DVector, Isometry3, Matrix3, UnitQuaternion, Vector3};

use crate::observe::board_motion::{BoardMotion, Moved, right_jacobian};
use crate::observe::extrinsics_drift::drifted;

/// Scratch of a thread: nothing is allocated per evaluation once it has grown to the largest frame.
#[derive(Default)]
struct Scratch {
    work: Workspace,
    theta: Vec<f64>,
    points: Vec<[f64; 2]>,
    inverse_depths: Vec<f64>,
    /// The chain's own Jacobian, by the pose of the board in the camera.
    rows: Vec<f64>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// The variables that hold the parameters of a chain, in its order.
pub type BlockVariables = Arc<[Key<DVector<f64>>]>;

/// The variables of a camera that all its frames share, but for its parameter blocks.
#[derive(Debug, Clone)]
pub struct CameraVariables {
    /// The chain of its pieces.
    pub chain: Arc<Chain>,
    /// `camera_from_rig`; `None` for the reference.
    pub extrinsics: Option<Key<Isometry3<f64>>>,
    /// How the extrinsics change with time or temperature ([`PlaceDrift`](crate::observe::PlaceDrift)); `None` where they do not.
    pub drift: Option<Key<DVector<f64>>>,
    /// By how much it exposes later than its time says, s; `None` where the board stands still or frames are triggered together.
    pub offset: Option<Key<DVector<f64>>>,
}

/// Observations of the board by a camera in one frame.
#[derive(Debug, Clone)]
pub enum Observations {
    /// Markers in the image.
    Markers {
        /// Board points, mm.
        points: Vec<[f64; 2]>,
        /// Where they were found, px.
        pixels: Vec<[f64; 2]>,
        /// Standard deviation of each coordinate, px.
        sigmas: Vec<f64>,
    },
    /// Depth pixels.
    Depth {
        /// The pixels.
        queries: Vec<DepthQuery>,
        /// Measured inverse depths, 1/mm.
        inverse_depths: Vec<f64>,
        /// Standard deviation of each, 1/mm.
        sigmas: Vec<f64>,
    },
}

impl Observations {
    fn rows(&self) -> usize {
        match self {
            Self::Markers { points, .. } => 2 * points.len(),
            Self::Depth { queries, .. } => queries.len(),
        }
    }

    /// Standard deviations, one per marker or depth pixel.
    pub fn sigmas(&self) -> &[f64] {
        match self {
            Self::Markers { sigmas, .. } | Self::Depth { sigmas, .. } => sigmas,
        }
    }
}

/// A frame as a camera sees it.
#[derive(Debug, Clone, Copy)]
pub struct FrameView {
    /// The frame's pose, rig from board.
    pub pose: Key<Isometry3<f64>>,
    /// How far the camera's extrinsics have drifted in this frame, in units of their drift; 0 without one.
    pub drifted: f64,
    /// How the board moves about the frame, and by how much the camera's time is later than the frame's, s; for cameras with an
    /// offset.
    pub moving: Option<(BoardMotion, f64)>,
}

/// A frame's observations of one kind, or those of its depth pixels that lie in one cell of a fine field.
#[derive(Debug, Clone)]
pub struct FrameGroup {
    /// The frame.
    pub view: FrameView,
    /// The variables with the chain's parameters, of an image observation the leading ones that it depends on.
    pub blocks: BlockVariables,
    /// The observations.
    pub observed: Observations,
}

/// Whitened residuals of one kind of one camera in all its frames: (u, v) of markers, or measured inverse depth.
#[derive(Debug, Clone)]
pub struct ObservationBatch {
    name: String,
    camera: CameraVariables,
    groups: Vec<FrameGroup>,
    variables: Vec<Vec<VariableId>>,
    residual_dim: usize,
    loss: Loss,
}

impl ObservationBatch {
    /// The batch of a camera's markers.
    pub fn of_markers(name: String, camera: CameraVariables, groups: Vec<FrameGroup>, loss: Loss) -> Self {
        Self::new(name, camera, groups, loss, 2)
    }

    /// The batch of a camera's depth pixels.
    pub fn of_depth(name: String, camera: CameraVariables, groups: Vec<FrameGroup>, loss: Loss) -> Self {
        Self::new(name, camera, groups, loss, 1)
    }

    fn new(name: String, camera: CameraVariables, groups: Vec<FrameGroup>, loss: Loss, residual_dim: usize) -> Self {
        let of_group = |group: &FrameGroup| {
            let extrinsics = camera.extrinsics.iter().map(|k| k.id()).chain(camera.drift.iter().map(|k| k.id()));
            let offset = camera.offset.iter().filter(|_| group.view.moving.is_some()).map(|k| k.id());
            let blocks = group.blocks.iter().map(|k| k.id());
            std::iter::once(group.view.pose.id()).chain(extrinsics).chain(offset).chain(blocks).collect()
        };
        let variables = groups.iter().map(of_group).collect();
        Self { name, camera, groups, variables, residual_dim, loss }
    }
}

/// Extrinsics under a drift, with what their rows take.
#[derive(Debug, Clone, Copy)]
struct DriftedExtrinsics {
    /// Of the frame.
    camera_from_rig: Isometry3<f64>,
    /// The rotation that the drift adds, Exp(s ω).
    turned: UnitQuaternion<f64>,
    /// s times the transposed right Jacobian of SO(3) at s ω, and s; `None` without a drift.
    of_drift: Option<(Matrix3<f64>, f64)>,
}

impl DriftedExtrinsics {
    fn new(extrinsics: &Isometry3<f64>, drift: Option<(&DVector<f64>, f64)>) -> Self {
        let Some((drift, s)) = drift else {
            return Self { camera_from_rig: *extrinsics, turned: UnitQuaternion::identity(), of_drift: None };
        };
        let turn = Vector3::new(drift[0], drift[1], drift[2]) * s;
        let camera_from_rig = drifted(extrinsics, drift.as_slice(), s);
        let jacobian = right_jacobian(&turn).transpose() * s;
        Self { camera_from_rig, turned: UnitQuaternion::from_scaled_axis(turn), of_drift: Some((jacobian, s)) }
    }
}

/// Writes the rows of a chain's Jacobian by `camera_from_board` = `camera_from_rig` · `rig_from_board` as rows by both, by the
/// drift of `camera_from_rig` where it has one, and by the offset of the camera's time where the board is `moved`.
///
/// With (R, t) = (A B, A b + a) and tangents R Exp(ω), t + τ of each: a change (ω_b, τ_b) of `rig_from_board` is (ω_b, A τ_b)
/// of the product, and (ω_a, τ_a) of `camera_from_rig` is (Bᵀ ω_a, τ_a − A [b]× ω_a). A moved board (B, b) = (F Exp(φ), f + p)
/// changes with the frame's pose (F, f) by (Exp(φ)ᵀ ω_f, τ_f), and with the time by its rates.
fn write_rows(
    inner: &[f64],
    outer: &mut [f64],
    extrinsics: &DriftedExtrinsics,
    (rig_from_board, moved): (&Isometry3<f64>, Option<&Moved>),
    columns: usize,
) {
    let to_rig = extrinsics.camera_from_rig.rotation.inverse();
    let b = rig_from_board.translation.vector;
    let of_drift = if extrinsics.of_drift.is_some() { POSE } else { 0 };
    let blocks = 2 * POSE + of_drift + usize::from(moved.is_some());
    for (inner, outer) in inner.chunks_exact(columns).zip(outer.chunks_exact_mut(columns - POSE + blocks)) {
        let by_turn = Vector3::new(inner[0], inner[1], inner[2]);
        let by_shift = Vector3::new(inner[3], inner[4], inner[5]);
        let shift_in_rig = to_rig * by_shift;
        // By ω of the drifted extrinsics.
        let turn_of_extrinsics = rig_from_board.rotation * by_turn + b.cross(&shift_in_rig);
        outer[0..3].copy_from_slice(moved.map_or(by_turn, |moved| moved.turn * by_turn).as_slice());
        outer[3..6].copy_from_slice(shift_in_rig.as_slice());
        outer[6..9].copy_from_slice((extrinsics.turned * turn_of_extrinsics).as_slice());
        outer[9..12].copy_from_slice(by_shift.as_slice());
        if let Some((jacobian, s)) = &extrinsics.of_drift {
            outer[12..15].copy_from_slice((jacobian * turn_of_extrinsics).as_slice());
            outer[15..18].copy_from_slice((by_shift * *s).as_slice());
        }
        if let Some(moved) = moved {
            outer[blocks - 1] = by_turn.dot(&moved.turn_rate) + shift_in_rig.dot(&moved.shift_rate);
        }
        outer[blocks..].copy_from_slice(&inner[POSE..]);
    }
}

fn scale_rows(jacobian: &mut [f64], columns: usize, weights: impl Iterator<Item = f64>) {
    for (row, weight) in jacobian.chunks_exact_mut(columns).zip(weights) {
        row.iter_mut().for_each(|d| *d *= weight);
    }
}

impl FactorBatch for ObservationBatch {
    fn name(&self) -> &str {
        &self.name
    }

    fn group_count(&self) -> usize {
        self.groups.len()
    }

    fn variables(&self, group: usize) -> &[VariableId] {
        &self.variables[group]
    }

    fn row_count(&self, group: usize) -> usize {
        self.groups[group].observed.rows()
    }

    fn residual_dim(&self) -> usize {
        self.residual_dim
    }

    fn loss(&self) -> Loss {
        self.loss.clone()
    }

    fn evaluate(
        &self,
        group: usize,
        values: &Values,
        residuals: &mut [f64],
        mut jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError> {
        let FrameGroup { view: FrameView { pose: frame, drifted, moving }, blocks, observed } = &self.groups[group];
        let moved = self
            .camera
            .offset
            .zip(*moving)
            .map(|(offset, (motion, later))| motion.after(later + values.get(offset)[0]));
        let rig_from_board = moved.map_or(*values.get(*frame), |moved| moved.of(values.get(*frame)));
        let drift = self.camera.drift.map(|drift| (values.get(drift), *drifted));
        let extrinsics = self.camera.extrinsics.map(|key| DriftedExtrinsics::new(values.get(key), drift));
        let pose = extrinsics.map_or(rig_from_board, |extrinsics| extrinsics.camera_from_rig * rig_from_board);
        SCRATCH.with_borrow_mut(|scratch| {
            let Scratch { work, theta, points, inverse_depths, rows } = scratch;
            theta.clear();
            blocks.iter().for_each(|key| theta.extend(values.get(*key).iter()));
            let columns = POSE + theta.len();
            // The reference's rows are the chain's own.
            let mut chain_rows = match (&mut jacobian, extrinsics) {
                (Some(_), Some(_)) => {
                    rows.resize(residuals.len() * columns, 0.0);
                    Some(&mut rows[..])
                }
                (Some(jacobian), None) => Some(&mut **jacobian),
                (None, _) => None,
            };
            let chain = &self.camera.chain;
            let failed = |e: depthcal_model::chain::ChainError| EvaluationError::new(e.to_string());
            match observed {
                Observations::Markers { points: board, pixels, sigmas } => {
                    points.resize(board.len(), [0.0; 2]);
                    chain.image(work, theta, &pose, board, points, chain_rows.as_deref_mut()).map_err(failed)?;
                    for (k, (predicted, found)) in points.iter().zip(pixels).enumerate() {
                        for i in 0..2 {
                            residuals[2 * k + i] = (predicted[i] - found[i]) / sigmas[k];
                        }
                    }
                    if let Some(chain_rows) = chain_rows {
                        scale_rows(chain_rows, columns, sigmas.iter().flat_map(|s| [1.0 / s, 1.0 / s]));
                    }
                }
                Observations::Depth { queries, inverse_depths: measured, sigmas } => {
                    points.resize(queries.len(), [0.0; 2]);
                    inverse_depths.resize(queries.len(), 0.0);
                    let depth_rows = chain_rows.as_deref_mut();
                    chain.depth(work, theta, &pose, queries, inverse_depths, points, depth_rows).map_err(failed)?;
                    for (k, (predicted, measured)) in inverse_depths.iter().zip(measured).enumerate() {
                        residuals[k] = (predicted - measured) / sigmas[k];
                    }
                    if let Some(chain_rows) = chain_rows {
                        scale_rows(chain_rows, columns, sigmas.iter().map(|s| 1.0 / s));
                    }
                }
            }
            if let (Some(jacobian), Some(extrinsics)) = (jacobian, &extrinsics) {
                write_rows(rows, jacobian, extrinsics, (&rig_from_board, moved.as_ref()), columns);
            }
            Ok(())
        })
    }
}
