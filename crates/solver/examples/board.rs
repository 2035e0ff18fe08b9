//! A board in front of a depth camera: image points and depths of many frames, joint adjustment of the camera and all poses.
//!
//! `cargo run --release --example board -- FILE --threads N` prints one line of JSON. The text file holds, separated by
//! white space: frames C, points N, σ in pixels, σ in 1/mm; 13 true and 13 initial parameters (fx fy cx cy, k1 k2 p1 p2 k3,
//! dx dy dz dw); N board points; per frame the true and the initial pose (rotation vector, translation), then (u, v, z) for
//! every point.
//!
//! The camera is a chain of small pieces. Each is written once over dual numbers and differentiated on its own; the chain
//! rule multiplies the small Jacobians.

use std::time::Instant;

use depthcal_solver::{EvaluationError, FactorBatch, Graph, Key, Options, Scalar, Values, VariableId, minimize};
use nalgebra::{Isometry3, Matrix3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3, Vector4};
use num_dual::{Derivative, DualSVec64};

/// y = f(x; θ).
trait Piece<const IN: usize, const P: usize, const OUT: usize> {
    fn map<T: Scalar>(x: &[T; IN], theta: &[T; P]) -> [T; OUT];

    /// y, ∂y/∂x and ∂y/∂θ by dual numbers, four directions at a time.
    #[inline(always)]
    fn linearize(x: &[f64; IN], theta: &[f64; P]) -> ([f64; OUT], SMatrix<f64, OUT, IN>, SMatrix<f64, OUT, P>) {
        let mut y = [0.0; OUT];
        let (mut by_x, mut by_theta) = (SMatrix::zeros(), SMatrix::zeros());
        for first in (0..IN + P).step_by(4) {
            let seed = |value: f64, i: usize| {
                if i >= first && i < first + 4 {
                    let mut eps = SVector::<f64, 4>::zeros();
                    eps[i - first] = 1.0;
                    DualSVec64::<4>::new(value, Derivative::some(eps))
                } else {
                    DualSVec64::<4>::from(value)
                }
            };
            let dual =
                Self::map(&std::array::from_fn(|i| seed(x[i], i)), &std::array::from_fn(|i| seed(theta[i], IN + i)));
            for o in 0..OUT {
                y[o] = dual[o].re;
                let Some(eps) = dual[o].eps.0 else { continue };
                for k in 0..4.min(IN + P - first) {
                    if first + k < IN {
                        by_x[(o, first + k)] = eps[k];
                    } else {
                        by_theta[(o, first + k - IN)] = eps[k];
                    }
                }
            }
        }
        (y, by_x, by_theta)
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
    board: Vec<Vector3<f64>>,
    /// (u, v, 1/z) of every point, frame after frame.
    observed: Vec<[f64; 3]>,
    weights: [f64; 3],
    poses: Vec<Key<Isometry3<f64>>>,
    pinhole: Key<Vector4<f64>>,
    lens: Key<SVector<f64, 5>>,
    depth: Key<Vector4<f64>>,
    ids: Vec<[VariableId; 4]>,
}

const COLUMNS: usize = 19;

impl FactorBatch for Frames {
    fn name(&self) -> &str {
        "frames"
    }

    fn group_count(&self) -> usize {
        self.poses.len()
    }

    fn variables(&self, group: usize) -> &[VariableId] {
        &self.ids[group]
    }

    fn row_count(&self, _: usize) -> usize {
        3 * self.board.len()
    }

    fn residual_dim(&self) -> usize {
        3
    }

    fn evaluate(
        &self,
        group: usize,
        values: &Values,
        residuals: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError> {
        let pose = values.get(self.poses[group]);
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        let translation = pose.translation.vector;
        let (pinhole, lens, depth) =
            (&values.get(self.pinhole).data.0[0], &values.get(self.lens).data.0[0], &values.get(self.depth).data.0[0]);
        let n = self.board.len();
        let points = self.board.iter().zip(&self.observed[group * n..]).zip(residuals.as_chunks_mut::<3>().0);
        let [wu, wv, wd] = self.weights;
        match jacobian {
            None => {
                for ((point, observed), r) in points {
                    let x = rotation * point + translation;
                    let n = Perspective::map(&[x.x, x.y, x.z], &[]);
                    let [u, v] = Pinhole::map(&Lens::map(&[n[0], n[1]], lens), pinhole);
                    let [rho] = Depth::map(&n, depth);
                    *r = [(u - observed[0]) * wu, (v - observed[1]) * wv, (rho - observed[2]) * wd];
                }
            }
            Some(jacobian) => {
                for (((point, observed), r), j) in points.zip(jacobian.as_chunks_mut::<{ 3 * COLUMNS }>().0) {
                    let x = rotation * point + translation;
                    let (n, n_x, _) = Perspective::linearize(&[x.x, x.y, x.z], &[]);
                    let (l, l_n, l_lens) = Lens::linearize(&[n[0], n[1]], lens);
                    let (uv, uv_l, uv_pinhole) = Pinhole::linearize(&l, pinhole);
                    let ([rho], rho_n, rho_depth) = Depth::linearize(&n, depth);
                    *r = [(uv[0] - observed[0]) * wu, (uv[1] - observed[1]) * wv, (rho - observed[2]) * wd];
                    let w = SMatrix::<f64, 2, 2>::new(wu, 0.0, 0.0, wv);
                    let uv_l = w * uv_l;
                    let uv_pinhole = w * uv_pinhole;
                    let uv_lens = uv_l * l_lens;
                    let uv_x = uv_l * l_n * n_x.fixed_rows::<2>(0);
                    let rho_x = rho_n * n_x * wd;
                    // ∂x/∂ω = −R [P]×.
                    let x_w: Matrix3<f64> = rotation * (-point).cross_matrix();
                    let (uv_w, rho_w) = (uv_x * x_w, rho_x * x_w);
                    for row in 0..2 {
                        let target = &mut j[row * COLUMNS..(row + 1) * COLUMNS];
                        for c in 0..3 {
                            target[c] = uv_w[(row, c)];
                            target[3 + c] = uv_x[(row, c)];
                        }
                        for c in 0..4 {
                            target[6 + c] = uv_pinhole[(row, c)];
                            target[15 + c] = 0.0;
                        }
                        for c in 0..5 {
                            target[10 + c] = uv_lens[(row, c)];
                        }
                    }
                    let target = &mut j[2 * COLUMNS..];
                    for c in 0..3 {
                        target[c] = rho_w[c];
                        target[3 + c] = rho_x[c];
                    }
                    target[6..15].fill(0.0);
                    for c in 0..4 {
                        target[15 + c] = wd * rho_depth[c];
                    }
                }
            }
        }
        Ok(())
    }
}

fn read(path: &str) -> Result<(Graph, Values), Box<dyn std::error::Error>> {
    let text = std::fs::read_to_string(path)?;
    let mut numbers = text.split_ascii_whitespace().map(str::parse::<f64>);
    let mut next = || numbers.next().unwrap_or_else(|| "".parse());
    let (frames, points) = (next()? as usize, next()? as usize);
    let (sigma_px, sigma_rho) = (next()?, next()?);
    for _ in 0..13 {
        next()?;
    }
    let mut values = Values::new();
    let initial = (0..13).map(|_| next()).collect::<Result<Vec<f64>, _>>()?;
    let pinhole = values.insert(Vector4::from_column_slice(&initial[..4]));
    let lens = values.insert(SVector::<f64, 5>::from_column_slice(&initial[4..9]));
    let depth = values.insert(Vector4::from_column_slice(&initial[9..]));
    let mut vector = || Ok::<_, std::num::ParseFloatError>(Vector3::new(next()?, next()?, next()?));
    let board = (0..points).map(|_| vector()).collect::<Result<Vec<_>, _>>()?;
    let (mut poses, mut ids) = (Vec::with_capacity(frames), Vec::with_capacity(frames));
    let mut observed = Vec::with_capacity(frames * points);
    for _ in 0..frames {
        let _truth = (vector()?, vector()?);
        let rotation = UnitQuaternion::from_scaled_axis(vector()?);
        let pose = values.insert(Isometry3::from_parts(Translation3::from(vector()?), rotation));
        ids.push([pose.id(), pinhole.id(), lens.id(), depth.id()]);
        poses.push(pose);
        for _ in 0..points {
            let p = vector()?;
            observed.push([p.x, p.y, 1.0 / p.z]);
        }
    }
    let weights = [1.0 / sigma_px, 1.0 / sigma_px, 1.0 / sigma_rho];
    let mut graph = Graph::new();
    graph.add_batch(Frames { board, observed, weights, poses, pinhole, lens, depth, ids });
    Ok((graph, values))
}

/// Largest resident memory of the process in MB, where the system tells.
fn peak_memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.split_whitespace().next()?.parse::<f64>().ok()).map_or(f64::NAN, |kb| kb / 1024.0)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let path = arguments.first().ok_or("usage: board FILE [--threads N] [--report]")?;
    let threads = match arguments.iter().position(|a| a == "--threads") {
        Some(i) => arguments.get(i + 1).ok_or("--threads needs a number")?.parse()?,
        None => 0,
    };
    let begin = Instant::now();
    let (graph, values) = read(path)?;
    let build = begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    let solution = minimize(&graph, values, &Options { threads, ..Options::default() })?;
    let wall = begin.elapsed().as_secs_f64();
    let report = &solution.report;
    if arguments.iter().any(|a| a == "--report") {
        eprintln!("{report}");
    }
    println!(
        "{}",
        serde_json::json!({
            "wall": wall, "cost0": report.cost0, "cost": report.cost, "iters": report.iterations,
            "converged": report.converged, "seconds": report.seconds, "build": build, "rss_mb": peak_memory(),
            "linear_solver": report.linear_solver.to_string(), "threads": threads,
        })
    );
    Ok(())
}
