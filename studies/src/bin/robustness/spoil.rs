//! Faults of rendered frames.

use depthcal_simulate::{CameraTruth, Pose, RenderedFrame};

/// Largest value of an image of 8 bits.
const WHITE: u16 = 255;
/// Length of the path of a moving board, px.
const BLUR_PX: usize = 9;
/// By how much a board moves while the rows are exposed, px.
const ROLLED_PX: f64 = 6.0;
/// Radius of a reflection, mm on the board.
const GLARE_MM: f64 = 25.0;
/// A longer exposure.
const OVEREXPOSED: u16 = 3;

/// A bright spot about a point of the board (mm).
pub fn glare(frame: &mut RenderedFrame, camera: &CameraTruth, pose: &Pose, on_board: [f64; 2]) {
    let [x, y, z] = pose.apply([on_board[0], on_board[1], 0.0]);
    let middle = [0, 1].map(|i| camera.focal_px[i] * [x, y][i] / z + camera.centre_px[i]);
    let radius = GLARE_MM * camera.focal_px[0] / z;
    for (i, value) in frame.image.iter_mut().enumerate() {
        let [u, v] = [(i % frame.width) as f64 - middle[0], (i / frame.width) as f64 - middle[1]];
        // Full within the radius, with a soft edge.
        let share = (1.5 - u.hypot(v) / radius).clamp(0.0, 1.0);
        *value = (f64::from(*value) + share * f64::from(WHITE)).min(f64::from(WHITE)) as u16;
    }
}

/// The mean along a row.
pub fn blur(frame: &mut RenderedFrame) {
    for row in frame.image.chunks_mut(frame.width) {
        let sharp = row.to_vec();
        for (u, value) in row.iter_mut().enumerate() {
            let path = u.saturating_sub(BLUR_PX / 2)..(u + BLUR_PX / 2 + 1).min(sharp.len());
            let count = path.len() as u32;
            *value = (sharp[path].iter().map(|v| u32::from(*v)).sum::<u32>() / count) as u16;
        }
    }
}

/// An exposure that is too long.
pub fn saturate(frame: &mut RenderedFrame) {
    frame.image.iter_mut().for_each(|value| *value = (*value * OVEREXPOSED).min(WHITE));
}

/// Rows that are exposed one after the other, of image and depth.
pub fn roll(frame: &mut RenderedFrame) {
    let (width, height) = (frame.width, frame.height);
    for v in 0..height {
        let shift = ROLLED_PX * (v as f64 / height as f64 - 0.5);
        let (whole, part) = (shift.floor(), shift - shift.floor());
        let row = frame.image[v * width..(v + 1) * width].to_vec();
        let depth = frame.depth[v * width..(v + 1) * width].to_vec();
        let source = |u: usize, more: isize| (u as isize - whole as isize - more).clamp(0, width as isize - 1) as usize;
        for u in 0..width {
            let mixed = (1.0 - part) * f64::from(row[source(u, 0)]) + part * f64::from(row[source(u, 1)]);
            frame.image[v * width + u] = mixed.round() as u16;
            frame.depth[v * width + u] = depth[source(u, if part > 0.5 { 1 } else { 0 })];
        }
    }
}

/// Left and right exchanged, of image and depth.
pub fn mirror(frame: &mut RenderedFrame) {
    let width = frame.width;
    frame.image.chunks_mut(width).for_each(<[u16]>::reverse);
    frame.depth.chunks_mut(width).for_each(<[u16]>::reverse);
}
