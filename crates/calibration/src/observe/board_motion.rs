//! How the board moves about a frame, from its poses in the frames before and after: a camera that exposes a frame at another
//! moment sees the board elsewhere.
//!
//! About the pose (R, t) of a frame, the board's is (R Exp(φ(s)), t + p(s)) s seconds later, with polynomials φ and p through the
//! poses of up to two frames before and two after.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, UnitQuaternion, Vector3};

/// Frames farther apart, s, do not tell how the board moved between them.
const LARGEST_GAP_S: f64 = 0.35;
/// Most frames to either side.
const TO_EITHER_SIDE: usize = 2;
/// Terms of the polynomials: as many as there are neighbours.
const TERMS: usize = 2 * TO_EITHER_SIDE;

/// Motion of the board about a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoardMotion {
    /// Unit of time of the coefficients, s: the distance of the farthest neighbour.
    unit_s: f64,
    /// Coefficients of φ (rad) and p (mm) with s, s², …; zero beyond the neighbours' number.
    coefficients: [[f64; 6]; TERMS],
    /// How far the nearest neighbours are away, s: the motion holds between them.
    between_s: [f64; 2],
}

/// The board of a frame some time later.
#[derive(Debug, Clone, Copy)]
pub struct Moved {
    /// Exp(φ).
    pub turn: UnitQuaternion<f64>,
    /// p, mm.
    pub shift: Vector3<f64>,
    /// Velocity of the rotation, in the tangent of the moved pose, rad/s.
    pub turn_rate: Vector3<f64>,
    /// Velocity of the translation, mm/s.
    pub shift_rate: Vector3<f64>,
}

impl Moved {
    /// The moved board of a frame with this pose.
    pub fn of(&self, pose: &Isometry3<f64>) -> Isometry3<f64> {
        Isometry3::from_parts((pose.translation.vector + self.shift).into(), pose.rotation * self.turn)
    }
}

impl BoardMotion {
    /// The motion about a pose through neighbours: how much later they are, s, and their poses. `None` unless there are
    /// neighbours on both sides.
    pub fn through(pose: &Isometry3<f64>, neighbours: &[(f64, Isometry3<f64>)]) -> Option<Self> {
        let later = neighbours.iter().map(|n| n.0).filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
        let earlier = neighbours.iter().map(|n| n.0).filter(|s| *s < 0.0).fold(f64::NEG_INFINITY, f64::max);
        if !(later.is_finite() && earlier.is_finite()) {
            return None;
        }
        let unit_s = neighbours.iter().map(|n| n.0.abs()).fold(0.0, f64::max);
        let n = neighbours.len().min(TERMS);
        let powers = DMatrix::from_fn(n, n, |i, k| (neighbours[i].0 / unit_s).powi(k as i32 + 1)).lu();
        let tangents: Vec<[f64; 6]> = neighbours.iter().map(|(_, other)| tangent(pose, other)).collect();
        let mut coefficients = [[0.0; 6]; TERMS];
        for component in 0..6 {
            let solved = powers.solve(&DVector::from_fn(n, |i, _| tangents[i][component]))?;
            solved.iter().zip(&mut coefficients).for_each(|(value, of_power)| of_power[component] = *value);
        }
        Some(Self { unit_s, coefficients, between_s: [earlier, later] })
    }

    /// The nearest neighbours' times relative to the frame, s.
    pub fn between_s(&self) -> [f64; 2] {
        self.between_s
    }

    /// The board `s` seconds later.
    pub fn after(&self, s: f64) -> Moved {
        let x = s / self.unit_s;
        let (mut value, mut rate) = ([0.0; 6], [0.0; 6]);
        for (power, coefficients) in self.coefficients.iter().enumerate() {
            let (of_value, of_rate) =
                (x.powi(power as i32 + 1), (power + 1) as f64 * x.powi(power as i32) / self.unit_s);
            for i in 0..6 {
                value[i] += of_value * coefficients[i];
                rate[i] += of_rate * coefficients[i];
            }
        }
        let phi = Vector3::new(value[0], value[1], value[2]);
        Moved {
            turn: UnitQuaternion::from_scaled_axis(phi),
            shift: Vector3::new(value[3], value[4], value[5]),
            turn_rate: right_jacobian(&phi) * Vector3::new(rate[0], rate[1], rate[2]),
            shift_rate: Vector3::new(rate[3], rate[4], rate[5]),
        }
    }
}

/// (ω, τ) that lead from a pose to another.
fn tangent(from: &Isometry3<f64>, to: &Isometry3<f64>) -> [f64; 6] {
    let turn = (from.rotation.inverse() * to.rotation).scaled_axis();
    let shift = to.translation.vector - from.translation.vector;
    [turn.x, turn.y, turn.z, shift.x, shift.y, shift.z]
}

/// The motion of the board about each of several poses with their times, s; `None` where a time is unknown, or where no other
/// is near enough before and after it.
pub fn motions(frames: &[(Option<f64>, Isometry3<f64>)]) -> Vec<Option<BoardMotion>> {
    let mut order: Vec<(f64, usize)> =
        frames.iter().enumerate().filter_map(|(i, (time, _))| Some(((*time).filter(|t| t.is_finite())?, i))).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut motions = vec![None; frames.len()];
    for (place, (time, number)) in order.iter().enumerate() {
        let neighbours = |way: &mut dyn Iterator<Item = &(f64, usize)>| {
            let mut last = *time;
            let near = way.take_while(|(t, _)| {
                let is_near = (t - last).abs() <= LARGEST_GAP_S && *t != last;
                last = *t;
                is_near
            });
            near.take(TO_EITHER_SIDE).map(|(t, i)| (t - time, frames[*i].1)).collect::<Vec<_>>()
        };
        let mut all = neighbours(&mut order[..place].iter().rev());
        all.extend(neighbours(&mut order[place + 1..].iter()));
        motions[*number] = BoardMotion::through(&frames[*number].1, &all);
    }
    motions
}

/// J with Exp(φ + δ) ≈ Exp(φ) Exp(J δ) (Chirikjian 2012, 10.86).
pub(crate) fn right_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let (cross, angle) = (phi.cross_matrix(), phi.norm());
    let (a, b) = match angle < 1e-4 {
        true => (0.5, 1.0 / 6.0),
        false => ((1.0 - angle.cos()) / angle.powi(2), (angle - angle.sin()) / angle.powi(3)),
    };
    Matrix3::identity() - cross * a + cross * cross * b
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(t: f64) -> Isometry3<f64> {
        let turn = Vector3::new(0.3 * (2.0 * t).sin(), 0.2 * (1.7 * t).cos(), 0.1 * t);
        Isometry3::new(Vector3::new(120.0 * (1.9 * t).sin(), 80.0 * (2.3 * t).cos(), 700.0 + 90.0 * t), turn)
    }

    /// Between frames a thirtieth of a second apart, a waved board is where its neighbours put it, and its rates are differences.
    #[test]
    fn a_waved_board_is_found_between_frames() {
        let frames: Vec<_> = (0..9).map(|i| f64::from(i) / 30.0).map(|t| (Some(t), at(t))).collect();
        let motions = motions(&frames);
        assert!(motions[0].is_none() && motions[8].is_none());
        for s in [-0.02, 0.0, 0.013] {
            let (time, pose) = (4.0 / 30.0, frames[4].1);
            let motion = motions[4].unwrap();
            let error = motion.after(s).of(&pose) * at(time + s).inverse();
            assert!(error.rotation.angle() < 1e-6, "{}", error.rotation.angle());
            let distance = (motion.after(s).of(&pose).translation.vector - at(time + s).translation.vector).norm();
            assert!(distance < 1e-3, "{distance} mm at {s} s");
            let step = 1e-5;
            let [low, high] = [-step, step].map(|d| motion.after(s + d).of(&pose));
            let moved = motion.after(s);
            let turn = (low.rotation.inverse() * high.rotation).scaled_axis() / (2.0 * step);
            let shift = (high.translation.vector - low.translation.vector) / (2.0 * step);
            assert!((turn - moved.turn_rate).norm() < 1e-5, "{turn} {}", moved.turn_rate);
            assert!((shift - moved.shift_rate).norm() < 1e-3);
        }
    }

    #[test]
    fn frames_far_apart_or_without_times_tell_no_motion() {
        let frames: Vec<_> = (0..5).map(|i| (Some(f64::from(i)), at(f64::from(i)))).collect();
        assert!(motions(&frames).iter().all(Option::is_none));
        assert!(motions(&[(None, at(0.0)), (None, at(0.1)), (None, at(0.2))]).iter().all(Option::is_none));
    }
}
