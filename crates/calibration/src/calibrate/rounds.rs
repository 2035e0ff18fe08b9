//! The rounds of [`settle`](super::settle::settle): their number, and the planes of frames, which decide how much depth weighs.

use super::camera_options::CameraOptions;
use super::rules::{Attempt, Rules};
use crate::adjust::adjustment::Adjustment;
use crate::adjust::depth_weight::less_predicts_better;
use crate::adjust::plane_scatter::plane_scatter;
use crate::adjust::smoothness_prior::Smoothness;
use crate::adjust::state::State;
use crate::observe::AdjustableFrame;
use crate::observe::noise::{NoiseModel, PlaneScatter};

/// Relative change of the design effect of frames' planes below which it has settled: their scatter is known to some ten per cent
/// at best.
const PLANES_SETTLED: f64 = 0.05;

/// The rounds of a calibration.
pub(super) struct Rounds {
    /// Number of the present round, from 1.
    pub number: usize,
    /// Rounds after which the result is taken as it is.
    pub most: usize,
    /// Whether the smoothness of fields is chosen from the data.
    pub chooses_smoothness: bool,
    repairs: usize,
    planes: Vec<FramePlanes>,
    /// Of every camera, whether its fields were flat in an earlier round, and held-out frames wanted them rough.
    left_flat: Vec<bool>,
}

/// The planes of a camera's frames.
#[derive(Clone, Copy)]
struct FramePlanes {
    /// Whether depth weighs less than its samples would if frames had no planes of their own; decided once all else has settled.
    weigh: Option<bool>,
    scatter: PlaneScatter,
}

impl Rounds {
    /// The rounds of a state that has not been adjusted.
    pub fn new<F: AdjustableFrame>(state: &State<F>, rules: &Rules<'_, F>, options: &CameraOptions) -> Self {
        let has_fields = |number: usize| !state.cameras[number].smoothness.fields.is_empty();
        // The choice of smoothness and the noise depend on each other.
        let chooses_smoothness = rules.chooses_smoothness && (0..state.cameras.len()).any(has_fields);
        let most =
            if chooses_smoothness { rules.most_rounds.max(options.smoothness_rounds) } else { rules.most_rounds };
        // What a field leaves over while it is too smooth is no scatter of the frames, but would keep it smooth if it counted as
        // one.
        let may_have_planes = options.frame_planes && rules.with_depth;
        let planes = |number: usize| FramePlanes {
            weigh: if may_have_planes
                && state.cameras[number].has_depth()
                && !(rules.chooses_smoothness && has_fields(number))
            {
                None
            } else {
                Some(false)
            },
            scatter: PlaneScatter::NONE,
        };
        let planes = (0..state.cameras.len()).map(planes).collect();
        let left_flat = vec![false; state.cameras.len()];
        Self { number: 0, most, chooses_smoothness, repairs: 0, planes, left_flat }
    }

    /// How often was adjusted.
    pub fn attempt(&self) -> Attempt {
        Attempt { round: self.number, repairs: self.repairs }
    }

    /// The round begins anew after a repair: such rounds estimate no noise and do not count.
    pub fn begin_anew(&mut self) {
        (self.number, self.repairs) = (self.number - 1, self.repairs + 1);
    }

    /// Whether fields that once were flat, and that held-out frames wanted rough then, would be flat again. While
    /// they are flat, poses take up what they explain; with the right poses again, frames that the others do not determine may
    /// speak for flat ones, and the choice would go round in a circle.
    pub fn is_flat_again(&mut self, camera: usize, present: &Smoothness, chosen: &Smoothness) -> bool {
        self.left_flat[camera] |= present.is_flat() && !chosen.is_flat();
        self.left_flat[camera] && chosen.is_flat()
    }

    /// Measures the scatter of the planes of those cameras whose depth weighs less for it.
    pub fn measure_planes<F: AdjustableFrame>(&mut self, state: &State<F>, weighted_by: &[NoiseModel]) {
        for (number, planes) in self.planes.iter_mut().enumerate() {
            if planes.weigh == Some(true) {
                planes.scatter = plane_scatter(state, number, weighted_by);
            }
        }
    }

    /// The scatter of the planes of a camera's frames.
    pub fn planes(&self, number: usize) -> &PlaneScatter {
        &self.planes[number].scatter
    }

    /// The scatter as the weights of a camera's depth have it.
    pub fn planes_in_weights(&self, number: usize) -> PlaneScatter {
        let FramePlanes { weigh, scatter } = self.planes[number];
        // They are reported all the same, and count in the covariance.
        if weigh == Some(true) { scatter } else { PlaneScatter { design_effect: 1.0, ..scatter } }
    }

    /// Whether the scatter of planes has changed little.
    pub fn planes_settled(used: &PlaneScatter, new: &PlaneScatter) -> bool {
        (used.design_effect - new.design_effect).abs() <= PLANES_SETTLED * new.design_effect
    }

    /// Decides, once all else has settled, of which cameras depth weighs less because their frames have planes of their own;
    /// whether the rounds begin from the first for it.
    pub fn decide_depth_weights<F: AdjustableFrame>(
        &mut self,
        state: &mut State<F>,
        weighted_by: &[NoiseModel],
        adjustment: &Adjustment,
    ) -> bool {
        let mut weighs_less = false;
        for number in 0..self.planes.len() {
            if self.planes[number].weigh.is_some() || adjustment.by_node() {
                continue;
            }
            let scatter = plane_scatter(state, number, weighted_by);
            let less = scatter != PlaneScatter::NONE && less_predicts_better(adjustment, number, scatter.design_effect);
            self.planes[number] = FramePlanes { weigh: Some(less), scatter };
            state.cameras[number].noise.planes = self.planes_in_weights(number);
            weighs_less |= less;
        }
        if weighs_less {
            self.number = 0;
        }
        weighs_less
    }
}
