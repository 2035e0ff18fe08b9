//! Boards as a camera would see them: a drawing of poses that are to be captured.

use std::fmt::Write;

use depthcal_model::{Camera, Target};
use nalgebra::{Isometry3, Point3};

use crate::html::escape;

/// Width of a view, and space around it and for its caption, px of the drawing.
const WIDTH: f64 = 320.0;
const MARGIN: f64 = 16.0;
const CAPTION: f64 = 40.0;
/// Steps of a border, which a lens bends.
const STEPS: usize = 12;

/// The views of a camera as SVG, one below the other: the image's border, the border of the board's markers and the markers, with
/// a caption each. A board is given by its pose in the camera's frame, mm.
pub fn board_views(camera: &Camera, target: &Target, boards: &[(Isometry3<f64>, String)]) -> String {
    let scale = WIDTH / camera.width as f64;
    let height = scale * camera.height as f64;
    let (full_width, row) = (WIDTH + 2.0 * MARGIN, height + CAPTION + MARGIN);
    let full_height = row * boards.len() as f64 + MARGIN;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {full_width:.0} {full_height:.0}\" \
         font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
    );
    let [low, high] = target.marker_rectangle();
    let corners = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]];
    for (number, (pose, caption)) in boards.iter().enumerate() {
        let top = MARGIN + row * number as f64;
        let place = |p: [f64; 2]| {
            let pixel = camera.project(&(pose * Point3::from(camera.board_point(p))).coords)?;
            Some([MARGIN + scale * (pixel[0] + 0.5), top + scale * (pixel[1] + 0.5)])
        };
        let border = (0..4 * STEPS).filter_map(|k| {
            let (from, to) = (corners[k / STEPS], corners[(k / STEPS + 1) % 4]);
            let t = (k % STEPS) as f64 / STEPS as f64;
            place([0, 1].map(|i| from[i] + t * (to[i] - from[i])))
        });
        let border: Vec<String> = border.map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            "<rect x=\"{MARGIN}\" y=\"{top:.1}\" width=\"{WIDTH}\" height=\"{height:.1}\" fill=\"#eef1f4\" stroke=\"#333\"/>\n\
             <polygon points=\"{}\" fill=\"#fff\" stroke=\"#0a6\" stroke-width=\"2\"/>",
            border.join(" ")
        );
        for [x, y] in target.points().into_iter().filter_map(place) {
            let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"1.6\" fill=\"#333\"/>");
        }
        let _ = writeln!(
            svg,
            "<text x=\"{MARGIN}\" y=\"{:.1}\">{}. {}</text>",
            top + height + 16.0,
            number + 1,
            escape(caption)
        );
    }
    svg + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use depthcal_model::Pattern;

    use super::*;

    /// A board of 4 × 3 corners in the middle of the image: every corner is drawn, within the image's border.
    #[test]
    fn every_marker_is_drawn_inside_the_image() {
        let camera = Camera::new(640, 480, [500.0, 500.0, 319.5, 239.5, 0.0], vec![]);
        let target = Target { pattern: Pattern::Chessboard, columns: 4, rows: 3, spacing_mm: 30.0 };
        let pose = Isometry3::translation(-45.0, -30.0, 600.0);
        let svg = board_views(&camera, &target, &[(pose, "0.6 m away & parallel".to_owned())]);
        let circles: Vec<&str> = svg.lines().filter(|line| line.starts_with("<circle")).collect();
        assert_eq!(circles.len(), 12);
        let number = |line: &str, name: &str| -> f64 {
            line.split(&format!("{name}=\"")).nth(1).and_then(|t| t.split('"').next()).unwrap().parse().unwrap()
        };
        for circle in circles {
            let (x, y) = (number(circle, "cx"), number(circle, "cy"));
            assert!(x > MARGIN && x < MARGIN + WIDTH && y > MARGIN && y < MARGIN + 240.0, "{circle}");
        }
        assert!(svg.contains("away &amp; parallel"));
    }
}
