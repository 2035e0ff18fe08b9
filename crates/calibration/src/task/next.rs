//! Which captures to add to those of a fit.

use super::error::TaskError;
use crate::adjust::state::{CameraState, State};
use crate::calibrate::Calibrated;
use crate::observe::noise::NoiseModel;
use crate::plan::{Goal, Plan, PlanError, Planner};

/// Error of projection that is small enough where nothing is asked for, px.
const SMALL_PX: f64 = 0.1;
/// Share of a pixel's noise below which the error of all frames in common hardly adds to it: by 5 %.
const SHARE_OF_NOISE: f64 = 1.0 / 3.0;

/// Request of captures to add.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NextRequest {
    /// `depth`, `projection`, or a parameter `PIECE.PARAMETER`.
    pub goal: String,
    /// Nearest and farthest distance of the goal `depth`, mm [default: what was seen].
    pub range_mm: Option<[f64; 2]>,
    /// Error that is small enough, mm, px or in the parameter's unit [default: a third of a depth pixel's noise, 0.1 px, half of
    /// the present one].
    pub within: Option<f64>,
    /// Number of poses.
    pub poses: usize,
    /// The camera of a rig [default: the first with depth, else the first].
    pub camera: Option<String>,
}

/// Captures to add.
#[derive(Debug, Clone, PartialEq)]
pub struct NextCaptures {
    /// The camera that they are for.
    pub camera: String,
    /// Its number among those of the rig.
    pub number: usize,
    /// The goal that they are to lower.
    pub goal: Goal,
    /// Unit of its values.
    pub unit: String,
    /// The error that is small enough.
    pub target: f64,
    /// The poses, and where they lead.
    pub plan: Plan,
    /// Standard deviation of a depth pixel's noise in the middle of the range, mm, which no further frame lowers; `None` without
    /// depth.
    pub noise_mm: Option<f64>,
}

impl NextRequest {
    /// Number of the camera that is asked for.
    pub(super) fn camera_of(&self, state: &State) -> Result<usize, PlanError> {
        let named = |name: &String| state.cameras.iter().position(|camera| camera.name == *name);
        match &self.camera {
            Some(name) => named(name).ok_or_else(|| PlanError::NoCamera {
                name: name.clone(),
                known: state.cameras.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", "),
            }),
            None => Ok(state.cameras.iter().position(CameraState::has_depth).unwrap_or(0)),
        }
    }

    /// The goal that is asked for.
    pub(super) fn goal_of(&self, camera: &CameraState, planner: &Planner) -> Goal {
        let middle = (planner.range_mm[0] * planner.range_mm[1]).sqrt();
        match self.goal.as_str() {
            "projection" => Goal::Projection { distance_mm: middle },
            "depth" => Goal::Depth { range_mm: self.range_mm.unwrap_or(planner.range_mm) },
            "" if camera.has_depth() => Goal::Depth { range_mm: self.range_mm.unwrap_or(planner.range_mm) },
            "" => Goal::Projection { distance_mm: middle },
            parameter => Goal::Parameter(parameter.to_owned()),
        }
    }

    /// The poses that lower the goal most.
    ///
    /// # Errors
    ///
    /// [`TaskError::Plan`]: the goal means nothing for the camera, or the frames leave parameters open.
    pub fn next(&self, fitted: &Calibrated) -> Result<NextCaptures, TaskError> {
        let (state, covariance) = (&fitted.state, fitted.covariance.as_ref().ok_or(PlanError::Undetermined)?);
        let number = self.camera_of(state)?;
        let planner = Planner::new(state, number, covariance)?;
        let camera = &state.cameras[number];
        let middle = (planner.range_mm[0] * planner.range_mm[1]).sqrt();
        let goal = self.goal_of(camera, &planner);
        let noise_mm = camera.has_depth().then(|| depth_noise_mm(&camera.noise, middle));
        let by_default = match (&goal, noise_mm) {
            (Goal::Depth { .. }, Some(noise)) => SHARE_OF_NOISE * noise,
            (Goal::Parameter(_), _) => 0.5 * planner.plan(&goal, f64::INFINITY, 0)?.now_certain,
            _ => SMALL_PX,
        };
        let target = self.within.unwrap_or(by_default);
        let plan = planner.plan(&goal, target, self.poses)?;
        let unit = goal.unit(&camera.camera);
        Ok(NextCaptures { camera: camera.name.clone(), number, goal, unit, target, plan, noise_mm })
    }
}

/// Standard deviation of a depth pixel's noise at a distance, mm.
pub(super) fn depth_noise_mm(noise: &NoiseModel, distance_mm: f64) -> f64 {
    noise.depth.sigma(1.0 / distance_mm) * distance_mm.powi(2)
}
