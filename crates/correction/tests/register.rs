//! Registration against planes whose depth in either camera is known.

use depthcal_correction::{colours_of, depth_into};
use depthcal_io::RgbImage;
use depthcal_model::{Camera, Register};
use nalgebra::{Isometry3, Point3, Vector3};

/// A depth camera of 160×120 px, and a colour camera of three times as many with a lens, to its side.
fn cameras() -> (Camera, Camera, Isometry3<f64>) {
    let mut lens = Register::builtin().block("brown_conrady", None).unwrap();
    lens.theta = vec![0.08, -0.1, 1e-3, -5e-4, 0.02];
    let depth = Camera::new(160, 120, [130.0, 130.0, 80.0, 60.0, 0.0], vec![]);
    let colour = Camera::new(480, 360, [420.0, 421.0, 242.0, 178.0, 0.0], vec![lens]);
    (depth, colour, Isometry3::new(Vector3::new(-60.0, 4.0, 7.0), Vector3::new(0.01, -0.03, 0.02)))
}

/// Points of the depth camera on a scene: the nearest of the planes n · X = d whose ray passes `shows`.
fn points(depth: &Camera, plane: impl Fn(f64, f64) -> f64) -> Vec<[f32; 3]> {
    let [fx, fy, cx, cy, _] = depth.pinhole();
    let pixels = (0..depth.height).flat_map(|v| (0..depth.width).map(move |u| (u as f64, v as f64)));
    pixels
        .map(|(u, v)| {
            let (x, y) = ((u - cx) / fx, (v - cy) / fy);
            let z = plane(x, y);
            [x * z, y * z, z].map(|c| c as f32)
        })
        .collect()
}

/// A tilted plane: every pixel that it covers has the plane's depth there, without gaps, although the colour image has nine times
/// as many pixels.
#[test]
fn a_plane_has_its_own_depth_in_the_other_camera() {
    let (depth, colour, colour_from_depth) = cameras();
    // n · X = 1 in the depth camera.
    let m = Vector3::new(2e-4, -1e-4, 1.2e-3);
    let points = points(&depth, |x, y| 1.0 / (m.x * x + m.y * y + m.z));
    let registered = depth_into(&points, depth.width, &colour, &colour_from_depth);
    assert_eq!((registered.width, registered.height), (480, 360));
    // n · R⁻¹ (X' − t) = 1.
    let turned = colour_from_depth.rotation * m;
    let offset = 1.0 + turned.dot(&colour_from_depth.translation.vector);
    let mut covered = 0;
    for v in 60..300 {
        for u in 80..400 {
            let z = f64::from(registered.depth_mm[v * 480 + u]);
            assert!(z > 0.0, "a gap at ({u}, {v})");
            let [x, y] = colour.ray([u as f64, v as f64], 1e-3).unwrap();
            let expected = offset / (turned.x * x + turned.y * y + turned.z);
            assert!((z - expected).abs() < 0.3, "({u}, {v}): {z} instead of {expected}");
            covered += 1;
        }
    }
    assert_eq!(registered.holes, registered.depth_mm.iter().filter(|z| **z == 0.0).count());
    assert!(covered + registered.holes <= 480 * 360 && registered.holes > 0);
}

/// A depth camera that sees more than the other one, in pixels 30 times as large: the surface reaches all four edges, although
/// the points next to an edge lie far outside.
#[test]
fn surfaces_reach_the_edges_of_the_image() {
    let depth = Camera::new(24, 20, [14.0, 14.0, 11.5, 9.5, 0.0], vec![]);
    let colour = Camera::new(480, 360, [420.0, 420.0, 240.0, 180.0, 0.0], vec![]);
    let points = points(&depth, |_, _| 1000.0);
    let registered = depth_into(&points, depth.width, &colour, &Isometry3::identity());
    let gaps: Vec<_> = (0..480 * 360).filter(|i| registered.depth_mm[*i] == 0.0).map(|i| [i % 480, i / 480]).collect();
    assert!(gaps.is_empty(), "{gaps:?}");
    assert!(registered.depth_mm.iter().all(|z| (z - 1000.0).abs() < 0.01));
}

/// A near board before a wall: the near one wins, nothing joins the two, and points of the wall that the board hides from the
/// colour camera have no colour, while the others have that of their surface.
#[test]
fn the_nearest_surface_wins_and_hidden_points_have_no_colour() {
    let (depth, colour, colour_from_depth) = cameras();
    let on_board = |x: f64, y: f64| x.abs() < 0.2 && y.abs() < 0.2;
    let scene = |x: f64, y: f64| if on_board(x, y) { 500.0 } else { 1500.0 };
    let points = points(&depth, scene);
    let registered = depth_into(&points, depth.width, &colour, &colour_from_depth);
    let between = registered.depth_mm.iter().filter(|z| **z > 560.0 && **z < 1350.0).count();
    assert_eq!(between, 0, "no surface lies between board and wall");
    // The colour camera sees the board in red and the wall in blue.
    let paint = |z: &f32| if *z > 0.0 && *z < 800.0 { [200, 0, 0] } else { [0, 0, 200] };
    let image = RgbImage { width: 480, height: 360, data: registered.depth_mm.iter().map(paint).collect() };
    let colours = colours_of(&points, &colour, &colour_from_depth, &registered, &image);
    let (mut hidden, mut mixed) = (0, 0);
    for (point, sampled) in points.iter().zip(&colours) {
        match sampled {
            Some([red, _, blue]) => {
                let is_board = point[2] < 800.0;
                mixed += usize::from(if is_board { *blue > 0 } else { *red > 0 });
            }
            None => {
                // Points beyond the image have no colour either.
                let seen = colour_from_depth * Point3::from(point.map(f64::from));
                let [u, v] = colour.project(&seen.coords).unwrap();
                let inside = (1.0..478.0).contains(&u) && (1.0..358.0).contains(&v);
                hidden += usize::from(inside && point[2] > 800.0);
            }
        }
    }
    // 60 mm to the side, the board hides a strip of the wall 60 · (1500/500 − 1) mm wide, a tenth of a focal length.
    assert!(hidden > 200, "{hidden} hidden");
    assert!(mixed < 300, "{mixed} of {} mix the surfaces at the border", points.len());
    let alone = depth_into(&[[f32::NAN; 3]; 4], 2, &colour, &colour_from_depth);
    assert_eq!(alone.holes, 480 * 360);
}

/// Colours are interpolated between pixels, both ways.
#[test]
fn colours_are_those_of_the_place_between_pixels() {
    let (depth, colour, colour_from_depth) = cameras();
    let points = points(&depth, |_, _| 1200.0);
    let registered = depth_into(&points, depth.width, &colour, &colour_from_depth);
    // Steps of 40 at every second column, and at every third row: linear between neighbours.
    let levels = |i: usize, period: usize| if i.is_multiple_of(period) { 200 } else { 160 };
    let pixel = |i: usize| [levels(i % 480, 2), levels(i / 480, 3), 7];
    let image = RgbImage { width: 480, height: 360, data: (0..480 * 360).map(pixel).collect() };
    let mut checked = 0;
    for (point, sampled) in points.iter().zip(colours_of(&points, &colour, &colour_from_depth, &registered, &image)) {
        let Some(sampled) = sampled else { continue };
        let seen = colour_from_depth * Point3::from(point.map(f64::from));
        let between = |coordinate: f64, period: usize| {
            let [here, next] = [0.0, 1.0].map(|k| f64::from(levels((coordinate.floor() + k) as usize, period)));
            here + (next - here) * coordinate.fract()
        };
        let [u, v] = colour.project(&seen.coords).unwrap();
        let expected = [between(u, 2), between(v, 3), 7.0];
        // Rounded to whole numbers; points are f32.
        assert!(sampled.iter().zip(expected).all(|(f, e)| (f64::from(*f) - e).abs() < 0.6), "{sampled:?} {expected:?}");
        checked += 1;
    }
    assert!(checked > 10_000, "{checked}");
}

/// A board whose depth has holes, as on dark print: the wall behind is not seen through them, and its points that the board hides
/// get none of the board's colours. Holes in the wall itself hide nothing.
#[test]
fn holes_in_a_surface_hide_what_is_behind() {
    let (depth, colour, colour_from_depth) = cameras();
    let on_board = |x: f64, y: f64| x.abs() < 0.3 && y.abs() < 0.3;
    let scene = |x: f64, y: f64| if on_board(x, y) { 500.0 } else { 1500.0 };
    let whole = points(&depth, scene);
    let mut holed = whole.clone();
    let is_hole = |i: usize| (i % 160) % 12 < 5 && (i / 160) % 12 < 5;
    (0..holed.len()).filter(|i| is_hole(*i)).for_each(|i| holed[i] = [f32::NAN; 3]);
    let expected = depth_into(&whole, depth.width, &colour, &colour_from_depth);
    let registered = depth_into(&holed, depth.width, &colour, &colour_from_depth);
    let (mut through, mut board, mut empty) = (0, 0, 0);
    for (z, is) in registered.depth_mm.iter().zip(&expected.depth_mm) {
        if *is > 0.0 && *is < 800.0 {
            board += 1;
            through += usize::from(*z > 800.0);
            empty += usize::from(*z == 0.0);
        }
    }
    assert!(board > 20_000 && empty > board / 10, "{board} {empty}");
    assert!(through < board / 200, "the wall is seen through the board at {through} of {board} pixels");
    // Away from the board nothing is lost that is measured.
    let lost = registered.depth_mm.iter().zip(&expected.depth_mm).filter(|(z, is)| **is > 800.0 && **z == 0.0).count();
    let wall = expected.depth_mm.iter().filter(|z| **z > 800.0).count();
    assert!(lost < wall / 3, "{lost} of {wall}");
    let paint = |z: &f32| if *z > 0.0 && *z < 800.0 { [200, 0, 0] } else { [0, 0, 200] };
    let image = RgbImage { width: 480, height: 360, data: expected.depth_mm.iter().map(paint).collect() };
    let colours = colours_of(&holed, &colour, &colour_from_depth, &registered, &image);
    let wrong = |(point, sampled): (&[f32; 3], &Option<[u8; 3]>)| {
        point[2] > 800.0 && sampled.is_some_and(|[red, _, _]| red > 100)
    };
    let red = holed.iter().zip(&colours).filter(|pair| wrong((pair.0, pair.1))).count();
    assert!(red < 60, "{red} points of the wall have the board's colour");
}
