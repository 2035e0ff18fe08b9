//! Gaps within surfaces: pixels without depth between pixels of one surface.
//!
//! A depth camera often measures nothing on dark print or where light is weak. What is there still hides what lies behind:
//! another camera must not see the wall through the holes in the depth of a board.

/// Longest gap, in image widths.
const LONGEST: f32 = 1.0 / 16.0;
/// Depths on both sides of a gap differ by no more than this share per pixel of the gap …
const PER_PIXEL: f32 = 0.01;
/// … and in all.
const MOST: f32 = 0.1;

/// A point for every pixel without depth in a gap of a surface, interpolated along its row or its column, whichever is nearer;
/// NaN elsewhere. `points` are mm in the camera's frame, row by row of an image `width` pixels wide, NaN where there is none.
pub(super) fn closed_gaps(points: &[[f32; 3]], width: usize) -> Vec<[f32; 3]> {
    let mut closed = vec![[f32::NAN; 3]; points.len()];
    if width == 0 {
        return closed;
    }
    let rows = points.len() / width;
    let longest = (width as f32 * LONGEST) as usize;
    for row in 0..rows {
        close_line(points, &mut closed, |i| row * width + i, width, longest);
    }
    for column in 0..width {
        close_line(points, &mut closed, |i| i * width + column, rows, longest);
    }
    closed
}

/// Closes the gaps of a row or a column, whose `length` pixels are at `place`.
fn close_line(
    points: &[[f32; 3]],
    closed: &mut [[f32; 3]],
    place: impl Fn(usize) -> usize,
    length: usize,
    longest: usize,
) {
    let mut last: Option<usize> = None;
    for i in (0..length).filter(|i| !points[place(*i)][2].is_nan()) {
        let before = last.replace(i);
        let Some(start) = before.filter(|start| i - start > 1 && i - start <= longest + 1) else { continue };
        let (a, b) = (points[place(start)], points[place(i)]);
        let steps = (i - start) as f32;
        let (near, far) = (a[2].min(b[2]), a[2].max(b[2]));
        if far > (1.0 + (PER_PIXEL * steps).min(MOST)) * near {
            continue;
        }
        for k in start + 1..i {
            let share = (k - start) as f32 / steps;
            let between = |x: f32, y: f32| x + share * (y - x);
            // Rays are affine in the pixel but for the lens, and inverse depth is on a plane.
            let z = 1.0 / between(1.0 / a[2], 1.0 / b[2]);
            let pixel = &mut closed[place(k)];
            if pixel[2].is_nan() || z < pixel[2] {
                *pixel = [z * between(a[0] / a[2], b[0] / b[2]), z * between(a[1] / a[2], b[1] / b[2]), z];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gaps within one surface are closed on it, gaps between two surfaces and at the image's edge are not.
    #[test]
    fn gaps_of_one_surface_are_closed() {
        let width = 64;
        let on_plane = |i: usize| [i as f32 * 2.0, 0.0, 1000.0];
        let mut line: Vec<[f32; 3]> = (0..width).map(on_plane).collect();
        let none = [f32::NAN; 3];
        line[10] = none;
        line[11] = none;
        for i in 30..width {
            line[i][2] = 1300.0;
        }
        line[29] = none;
        (40..52).for_each(|i| line[i] = none);
        line[0] = none;
        let closed = closed_gaps(&line, width);
        for i in 0..width {
            match i {
                10 | 11 => {
                    assert!((closed[i][0] - 2.0 * i as f32).abs() < 1e-3 && (closed[i][2] - 1000.0).abs() < 1e-2)
                }
                _ => assert!(closed[i][2].is_nan(), "{i}: {:?}", closed[i]),
            }
        }
    }
}
