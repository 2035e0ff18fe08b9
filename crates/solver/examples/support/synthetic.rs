//! Synthetic pose graphs in the text format of g2o.

use std::collections::HashMap;
use std::fmt::Write;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Standard deviations of relative poses: of translation, and of rotation in radians.
pub const SIGMA_T: f64 = 0.05;
pub const SIGMA_R: f64 = 0.02;

/// A file with about `count` poses of the kind `manhattan`, `sphere` or `torus`; the same in every run.
pub fn generate(kind: &str, count: usize) -> Result<String, String> {
    let mut rng = ChaCha8Rng::seed_from_u64(count as u64);
    let (truth, links) = match kind {
        "manhattan" => manhattan(count, &mut rng),
        "sphere" => rings(count, &mut |u, v| {
            let (latitude, longitude) = (std::f64::consts::PI * (u - 0.5) * 0.95, std::f64::consts::TAU * v);
            UnitQuaternion::from_euler_angles(0.0, -latitude, longitude) * Translation3::new(20.0, 0.0, 0.0)
        }),
        "torus" => rings(count, &mut |u, v| {
            UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::TAU * u)
                * Translation3::new(20.0, 0.0, 0.0)
                * UnitQuaternion::from_euler_angles(0.0, std::f64::consts::TAU * v, 0.0)
                * Translation3::new(5.0, 0.0, 0.0)
        }),
        _ => return Err(format!("there is no kind {kind:?}: manhattan, sphere or torus")),
    };
    Ok(write(&truth, &links, kind == "manhattan", &mut rng))
}

type Links = Vec<(usize, usize)>;

/// Unit steps on a grid with turns at some crossings; places that are visited again are linked.
fn manhattan(count: usize, rng: &mut ChaCha8Rng) -> (Vec<Isometry3<f64>>, Links) {
    let size = (count as f64).sqrt().ceil() as i64;
    let (mut x, mut y, mut heading) = (0_i64, 0_i64, 0_usize);
    let steps = [(1, 0), (0, 1), (-1, 0), (0, -1)];
    let mut visited: HashMap<(i64, i64), usize> = HashMap::new();
    let (mut poses, mut links) = (Vec::new(), Links::new());
    for i in 0..count {
        let angle = std::f64::consts::FRAC_PI_2 * heading as f64;
        poses.push(Translation3::new(x as f64, y as f64, 0.0) * UnitQuaternion::from_euler_angles(0.0, 0.0, angle));
        if i > 0 {
            links.push((i - 1, i));
        }
        if let Some(before) = visited.insert((x, y), i)
            && before + 1 < i
        {
            links.push((before, i));
        }
        if rng.random_bool(0.3) {
            heading = (heading + if rng.random_bool(0.5) { 1 } else { 3 }) % 4;
        }
        // Walls all around.
        while !(-size / 4..=size / 4).contains(&(x + steps[heading].0))
            || !(-size / 4..=size / 4).contains(&(y + steps[heading].1))
        {
            heading = (heading + 1) % 4;
        }
        (x, y) = (x + steps[heading].0, y + steps[heading].1);
    }
    (poses, links)
}

/// Rings of poses one beside the other, walked through in one go; neighbours on neighbouring rings are linked.
fn rings(count: usize, place: &mut dyn FnMut(f64, f64) -> Isometry3<f64>) -> (Vec<Isometry3<f64>>, Links) {
    let rings = ((count as f64).sqrt().round() as usize).max(2);
    let poses = (0..rings * rings).map(|i| place(i as f64 / (rings * rings) as f64, (i % rings) as f64 / rings as f64));
    let mut links = Links::new();
    for i in 1..rings * rings {
        links.push((i - 1, i));
        links.extend(i.checked_sub(rings).map(|before| (before, i)));
    }
    (poses.collect(), links)
}

/// A sum of uniform numbers: nearly normal, without tails.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

fn write(truth: &[Isometry3<f64>], links: &Links, plane: bool, rng: &mut ChaCha8Rng) -> String {
    let (wt, wr) = (1.0 / (SIGMA_T * SIGMA_T), 1.0 / (SIGMA_R * SIGMA_R));
    let mut edges = String::new();
    let mut start = vec![truth[0]];
    for (a, b) in links {
        let mut noise = |sigma: f64| Vector3::from_fn(|_, _| sigma * normal(rng));
        let (mut t, mut r) = (noise(SIGMA_T), noise(SIGMA_R));
        if plane {
            t.z = 0.0;
            r = Vector3::new(0.0, 0.0, r.x);
        }
        let relative = truth[*a].inverse() * truth[*b];
        let measured = Isometry3::from_parts(
            Translation3::from(relative.translation.vector + t),
            relative.rotation * UnitQuaternion::from_scaled_axis(r),
        );
        if a + 1 == *b {
            start.push(start[*a] * measured);
        }
        let (t, q) = (measured.translation.vector, measured.rotation);
        let result = if plane {
            let angle = q.euler_angles().2;
            writeln!(edges, "EDGE_SE2 {a} {b} {} {} {angle} {wt} 0 0 {wt} 0 {wr}", t.x, t.y)
        } else {
            // The information is about the quaternion's vector part, half the rotation vector.
            let w = 4.0 * wr;
            let information = format!("{wt} 0 0 0 0 0 {wt} 0 0 0 0 {wt} 0 0 0 {w} 0 0 {w} 0 {w}");
            let (i, j, k, w) = (q.i, q.j, q.k, q.w);
            writeln!(edges, "EDGE_SE3:QUAT {a} {b} {} {} {} {i} {j} {k} {w} {information}", t.x, t.y, t.z)
        };
        // Writing to a string does not fail.
        result.unwrap_or_default();
    }
    let mut text = String::new();
    for (i, pose) in start.iter().enumerate() {
        let (t, q) = (pose.translation.vector, pose.rotation);
        let result = if plane {
            writeln!(text, "VERTEX_SE2 {i} {} {} {}", t.x, t.y, q.euler_angles().2)
        } else {
            writeln!(text, "VERTEX_SE3:QUAT {i} {} {} {} {} {} {} {}", t.x, t.y, t.z, q.i, q.j, q.k, q.w)
        };
        result.unwrap_or_default();
    }
    text + &edges
}
