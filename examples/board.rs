//! A board in front of a depth camera: image points and depths of many frames, joint adjustment of the camera and all poses.
//!
//! `cargo run --release --example board -- FILE --threads N` prints one line of JSON. The text file holds, separated by
//! white space: frames C, points N, σ in pixels, σ in 1/mm; 13 true and 13 initial parameters (fx fy cx cy, k1 k2 p1 p2 k3,
//! dx dy dz dw); N board points; per frame the true and the initial pose (rotation vector, translation), then (u, v, z) for
//! every point.
//!
//! The camera is a chain of small pieces. Each is written once over dual numbers and differentiated on its own; the chain
//! rule multiplies the small Jacobians, eight points at a time.

mod support;

use std::error::Error;

use depthcal::solver::{EvaluationError, Graph, Key, LANES, Lane, LaneBatch, Lanes, Scalar, Values, VariableId};
use nalgebra::{Isometry3, SVector, Translation3, UnitQuaternion, Vector3, Vector4};
use num_dual::{Derivative, DualSVec64};

/// y = f(x; θ) with up to eight parameters.
trait Piece<const IN: usize, const P: usize, const OUT: usize> {
    fn map<T: Scalar>(x: &[T; IN], theta: &[T; P]) -> [T; OUT];

    /// y and ∂y/∂x by dual numbers.
    #[inline(always)]
    fn by_x(x: &[f64; IN], theta: &[f64; P]) -> ([f64; OUT], [[f64; IN]; OUT]) {
        let mut dual_x = [DualSVec64::<IN>::from(0.0); IN];
        for i in 0..IN {
            let mut eps = SVector::<f64, IN>::zeros();
            eps[i] = 1.0;
            dual_x[i] = DualSVec64::new(x[i], Derivative::some(eps));
        }
        let mut constants = [DualSVec64::<IN>::from(0.0); P];
        for p in 0..P {
            constants[p] = DualSVec64::from(theta[p]);
        }
        let dual = Self::map(&dual_x, &constants);
        let (mut y, mut by_x) = ([0.0; OUT], [[0.0; IN]; OUT]);
        for o in 0..OUT {
            y[o] = dual[o].re;
            if let Some(eps) = &dual[o].eps.0 {
                for i in 0..IN {
                    by_x[o][i] = eps[i];
                }
            }
        }
        (y, by_x)
    }

    /// ∂y/∂θ, one parameter at a time: what does not depend on it carries no derivative and costs nothing.
    #[inline(always)]
    fn by_theta(x: &[f64; IN], theta: &[f64; P]) -> [[f64; P]; OUT] {
        let mut constant_x = [DualSVec64::<1>::from(0.0); IN];
        for i in 0..IN {
            constant_x[i] = DualSVec64::from(x[i]);
        }
        let mut constants = [DualSVec64::<1>::from(0.0); P];
        for p in 0..P {
            constants[p] = DualSVec64::from(theta[p]);
        }
        let mut by_theta = [[0.0; P]; OUT];
        // Written out, because a loop would be left in place and keep dual numbers out of registers.
        macro_rules! columns {
            ($($p:literal)*) => {$(
                if $p < P {
                    let mut dual_theta = constants;
                    dual_theta[$p].eps = Derivative::some(SVector::<f64, 1>::new(1.0));
                    let dual = Self::map(&constant_x, &dual_theta);
                    for o in 0..OUT {
                        if let Some(eps) = &dual[o].eps.0 {
                            by_theta[o][$p] = eps[0];
                        }
                    }
                }
            )*};
        }
        columns!(0 1 2 3 4 5 6 7);
        by_theta
    }
}

/// (X, Y, Z) to (x, y, ρ) = (X/Z, Y/Z, 1/Z).
struct Perspective;

impl Piece<3, 0, 3> for Perspective {
    #[inline(always)]
    fn map<T: Scalar>(&[x, y, z]: &[T; 3], _: &[T; 0]) -> [T; 3] {
        let rho = z.recip();
        [x * rho, y * rho, rho]
    }
}

/// Radial and tangential distortion (Brown 1966).
struct Lens;

impl Piece<2, 5, 2> for Lens {
    #[inline(always)]
    fn map<T: Scalar>(&[x, y]: &[T; 2], &[k1, k2, p1, p2, k3]: &[T; 5]) -> [T; 2] {
        let (x2, y2, xy) = (x * x, y * y, x * y * 2.0);
        let r2 = x2 + y2;
        let radial = ((k3 * r2 + k2) * r2 + k1) * r2 + 1.0;
        [x * radial + p1 * xy + p2 * (r2 + x2 * 2.0), y * radial + p1 * (r2 + y2 * 2.0) + p2 * xy]
    }
}

/// Focal lengths and principal point.
struct Pinhole;

impl Piece<2, 4, 2> for Pinhole {
    #[inline(always)]
    fn map<T: Scalar>(&[x, y]: &[T; 2], &[fx, fy, cx, cy]: &[T; 4]) -> [T; 2] {
        [fx * x + cx, fy * y + cy]
    }
}

/// Measured inverse depth, affine in x, y and ρ.
struct Depth;

impl Piece<3, 4, 1> for Depth {
    #[inline(always)]
    fn map<T: Scalar>(&[x, y, rho]: &[T; 3], &[dx, dy, dz, dw]: &[T; 4]) -> [T; 1] {
        [dx * x + dy * y + dz + dw * rho]
    }
}

/// All frames: one group each.
struct Frames {
    points: usize,
    /// Coordinates of the board's points, in blocks.
    board: Vec<[Lane; 3]>,
    /// (u, v, 1/z) of every point, frame after frame.
    observed: Vec<[Lane; 3]>,
    weights: [f64; 3],
    poses: Vec<Key<Isometry3<f64>>>,
    pinhole: Key<Vector4<f64>>,
    lens: Key<SVector<f64, 5>>,
    depth: Key<Vector4<f64>>,
    ids: Vec<[VariableId; 4]>,
}

/// What a frame's points share.
struct Frame {
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
    pinhole: [f64; 4],
    lens: [f64; 5],
    depth: [f64; 4],
}

impl Frame {
    /// R P and R P + t.
    #[inline(always)]
    fn transform(&self, p: &[f64; 3]) -> [f64; 3] {
        let mut x = self.translation;
        for i in 0..3 {
            x[i] += self.rotation[i][0] * p[0] + self.rotation[i][1] * p[1] + self.rotation[i][2] * p[2];
        }
        x
    }

    /// ∂(Exp(ω) P rotated)/∂ω = −R [P]×.
    #[inline(always)]
    fn by_rotation(&self, p: &[f64; 3]) -> [[f64; 3]; 3] {
        let mut j = [[0.0; 3]; 3];
        for i in 0..3 {
            let r = &self.rotation[i];
            j[i] = [r[2] * p[1] - r[1] * p[2], r[0] * p[2] - r[2] * p[0], r[1] * p[0] - r[0] * p[1]];
        }
        j
    }
}

/// Row vector times matrix.
#[inline(always)]
fn multiply<const K: usize, const N: usize>(row: &[f64; K], matrix: &[[f64; N]; K]) -> [f64; N] {
    let mut product = [0.0; N];
    for k in 0..K {
        for n in 0..N {
            product[n] += row[k] * matrix[k][n];
        }
    }
    product
}

const ENTRIES: usize = 13 + 13 + 10;

impl LaneBatch<3, ENTRIES> for Frames {
    /// Pose, focal length and principal point of its own, lens; the inverse depth depends on the pose and its own four.
    const PATTERN: [&'static [u32]; 3] = [
        &[0, 1, 2, 3, 4, 5, 6, 8, 10, 11, 12, 13, 14],
        &[0, 1, 2, 3, 4, 5, 7, 9, 10, 11, 12, 13, 14],
        &[0, 1, 2, 3, 4, 5, 15, 16, 17, 18],
    ];

    type Shared = Frame;

    fn name(&self) -> &str {
        "frames"
    }

    fn group_count(&self) -> usize {
        self.poses.len()
    }

    fn variables(&self, group: usize) -> &[VariableId] {
        &self.ids[group]
    }

    fn residual_count(&self, _: usize) -> usize {
        self.points
    }

    fn share(&self, group: usize, values: &Values) -> Result<Frame, EvaluationError> {
        let pose = values.get(self.poses[group]);
        Ok(Frame {
            rotation: pose.rotation.to_rotation_matrix().into_inner().transpose().into(),
            translation: pose.translation.vector.into(),
            pinhole: (*values.get(self.pinhole)).into(),
            lens: (*values.get(self.lens)).into(),
            depth: (*values.get(self.depth)).into(),
        })
    }

    #[inline(always)]
    fn residuals(&self, group: usize, frame: &Frame, block: usize, residuals: &mut [Lane; 3]) {
        let board = &self.board[block];
        let observed = &self.observed[group * self.board.len() + block];
        let weights = self.weights;
        for l in 0..LANES {
            let n = Perspective::map(&frame.transform(&[board[0][l], board[1][l], board[2][l]]), &[]);
            let [u, v] = Pinhole::map(&Lens::map(&[n[0], n[1]], &frame.lens), &frame.pinhole);
            let [rho] = Depth::map(&n, &frame.depth);
            residuals[0][l] = (u - observed[0][l]) * weights[0];
            residuals[1][l] = (v - observed[1][l]) * weights[1];
            residuals[2][l] = (rho - observed[2][l]) * weights[2];
        }
    }

    #[inline(always)]
    fn linearize(
        &self,
        group: usize,
        frame: &Frame,
        block: usize,
        residuals: &mut [Lane; 3],
        jacobian: &mut [Lane; ENTRIES],
    ) {
        let board = &self.board[block];
        let observed = &self.observed[group * self.board.len() + block];
        let weights = self.weights;
        for l in 0..LANES {
            let p = [board[0][l], board[1][l], board[2][l]];
            let (n, n_x) = Perspective::by_x(&frame.transform(&p), &[]);
            let normalized = [n[0], n[1]];
            let (d, d_n) = Lens::by_x(&normalized, &frame.lens);
            let d_lens = Lens::by_theta(&normalized, &frame.lens);
            let (uv, uv_d) = Pinhole::by_x(&d, &frame.pinhole);
            let uv_pinhole = Pinhole::by_theta(&d, &frame.pinhole);
            let ([rho], [rho_n]) = Depth::by_x(&n, &frame.depth);
            let [rho_depth] = Depth::by_theta(&n, &frame.depth);
            let x_w = frame.by_rotation(&p);
            for row in 0..2 {
                let w = weights[row];
                residuals[row][l] = (uv[row] - observed[row][l]) * w;
                let by_d = [w * uv_d[row][0], w * uv_d[row][1]];
                let by_x = multiply(&multiply(&by_d, &d_n), &[n_x[0], n_x[1]]);
                let by_w = multiply(&by_x, &x_w);
                let by_lens = multiply(&by_d, &d_lens);
                let first = 13 * row;
                for k in 0..3 {
                    jacobian[first + k][l] = by_w[k];
                    jacobian[first + 3 + k][l] = by_x[k];
                }
                for k in 0..2 {
                    jacobian[first + 6 + k][l] = w * uv_pinhole[row][row + 2 * k];
                }
                for k in 0..5 {
                    jacobian[first + 8 + k][l] = by_lens[k];
                }
            }
            let w = weights[2];
            residuals[2][l] = (rho - observed[2][l]) * w;
            let by_x = multiply(&[w * rho_n[0], w * rho_n[1], w * rho_n[2]], &n_x);
            let by_w = multiply(&by_x, &x_w);
            for k in 0..3 {
                jacobian[26 + k][l] = by_w[k];
                jacobian[29 + k][l] = by_x[k];
            }
            for k in 0..4 {
                jacobian[32 + k][l] = w * rho_depth[k];
            }
        }
    }
}

/// A file's numbers.
struct Problem {
    initial: [f64; 13],
    sigmas: [f64; 2],
    board: Vec<[f64; 3]>,
    /// Rotation vector and translation, then (u, v, z) of all points, for each frame.
    frames: Vec<([f64; 6], Vec<[f64; 3]>)>,
}

fn parse(path: &str) -> Result<Problem, Box<dyn Error>> {
    let text = std::fs::read_to_string(path)?;
    let mut numbers = text.split_ascii_whitespace().map(str::parse::<f64>);
    let mut next = || numbers.next().unwrap_or_else(|| "".parse());
    let (frames, points) = (next()? as usize, next()? as usize);
    let sigmas = [next()?, next()?];
    let _truth = array::<13>(&mut next)?;
    let initial = array(&mut next)?;
    let board = (0..points).map(|_| array(&mut next)).collect::<Result<_, _>>()?;
    let frames = (0..frames).map(|_| {
        let _truth = array::<6>(&mut next)?;
        Ok::<_, Box<dyn Error>>((array(&mut next)?, (0..points).map(|_| array(&mut next)).collect::<Result<_, _>>()?))
    });
    let frames = frames.collect::<Result<_, _>>()?;
    Ok(Problem { initial, sigmas, board, frames })
}

fn array<const N: usize>(
    mut next: impl FnMut() -> Result<f64, std::num::ParseFloatError>,
) -> Result<[f64; N], std::num::ParseFloatError> {
    let mut array = [0.0; N];
    for x in &mut array {
        *x = next()?;
    }
    Ok(array)
}

/// Triples in lanes; the last block is filled up with copies of the last one.
fn in_lanes(triples: &[[f64; 3]]) -> impl Iterator<Item = [Lane; 3]> + '_ {
    triples
        .chunks(LANES)
        .map(|block| std::array::from_fn(|i| std::array::from_fn(|l| block[l.min(block.len() - 1)][i])))
}

fn build(problem: Problem) -> Result<(Graph, Values), Box<dyn Error>> {
    let Problem { initial, sigmas, board, frames } = problem;
    let mut values = Values::new();
    let pinhole = values.insert(Vector4::from_column_slice(&initial[..4]));
    let lens = values.insert(SVector::<f64, 5>::from_column_slice(&initial[4..9]));
    let depth = values.insert(Vector4::from_column_slice(&initial[9..]));
    let points = board.len();
    let (mut poses, mut ids) = (Vec::with_capacity(frames.len()), Vec::with_capacity(frames.len()));
    let mut observed = Vec::with_capacity(frames.len() * points.div_ceil(LANES));
    for ([r1, r2, r3, t1, t2, t3], mut points) in frames {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(r1, r2, r3));
        let pose = values.insert(Isometry3::from_parts(Translation3::new(t1, t2, t3), rotation));
        ids.push([pose.id(), pinhole.id(), lens.id(), depth.id()]);
        poses.push(pose);
        points.iter_mut().for_each(|p| p[2] = 1.0 / p[2]);
        observed.extend(in_lanes(&points));
    }
    let board = in_lanes(&board).collect();
    let weights = [1.0 / sigmas[0], 1.0 / sigmas[0], 1.0 / sigmas[1]];
    let mut graph = Graph::new();
    graph.add_batch(Lanes::new(Frames { points, board, observed, weights, poses, pinhole, lens, depth, ids }));
    Ok((graph, values))
}

fn main() -> Result<(), Box<dyn Error>> {
    support::run("board", parse, build, |_| {})?;
    Ok(())
}
