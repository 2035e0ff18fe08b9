//! Lines and points over two axes, as SVG without references to anything else.

use std::fmt::Write;

use crate::format::number;

/// Width and height of the picture.
const SIZE: [f64; 2] = [720.0, 420.0];
/// Margins for the labels: left, top, right, bottom.
const MARGINS: [f64; 4] = [96.0, 40.0, 16.0, 56.0];
/// Fewest intervals between the labels of an axis.
const INTERVALS: f64 = 5.0;
/// Height of a line of the key.
const KEY: f64 = 20.0;

/// A picture that is being drawn.
#[derive(Debug)]
pub(crate) struct Chart {
    ranges: [[f64; 2]; 2],
    marks: String,
    key: String,
    keys: usize,
}

/// Writes into memory, which does not fail.
macro_rules! put {
    ($text:expr, $($arguments:tt)*) => { let _ = write!($text, $($arguments)*); };
}

/// Text with the characters that mean something in SVG replaced.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

impl Chart {
    /// A picture of these ranges of x and y.
    pub fn new(x: [f64; 2], y: [f64; 2]) -> Self {
        Self { ranges: [x, y], marks: String::new(), key: String::new(), keys: 0 }
    }

    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let share = |value: f64, [low, high]: [f64; 2]| (value - low) / (high - low);
        let [left, top, right, bottom] = MARGINS;
        [
            left + share(x, self.ranges[0]) * (SIZE[0] - left - right),
            SIZE[1] - bottom - share(y, self.ranges[1]) * (SIZE[1] - top - bottom),
        ]
    }

    /// A line through points.
    pub fn line(&mut self, points: impl IntoIterator<Item = (f64, f64)>, colour: &str, width: u32) {
        let places = points.into_iter().map(|(x, y)| self.place([x, y]));
        let places: Vec<String> = places.map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let places = places.join(" ");
        put!(
            self.marks,
            "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" points=\"{places}\"/>\n"
        );
    }

    /// A point.
    pub fn point(&mut self, x: f64, y: f64, colour: &str) {
        let [x, y] = self.place([x, y]);
        put!(self.marks, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{colour}\"/>\n");
    }

    /// A line of the key.
    pub fn key(&mut self, text: &str, colour: &str) {
        let (x, y) = (MARGINS[0] + 12.0, MARGINS[1] + 14.0 + KEY * self.keys as f64);
        self.keys += 1;
        put!(
            self.key,
            "<line x1=\"{x}\" y1=\"{y}\" x2=\"{}\" y2=\"{y}\" stroke=\"{colour}\" stroke-width=\"2\"/>\n",
            x + 18.0
        );
        put!(self.key, "<text x=\"{}\" y=\"{}\">{}</text>\n", x + 24.0, y + 4.0, escaped(text));
    }

    /// The picture, with its title, empty for none, and the names of its axes.
    pub fn svg(&self, title: &str, [x_name, y_name]: [&str; 2]) -> String {
        let [width, height] = SIZE;
        let [left, top, right, bottom] = MARGINS;
        let (inner_right, inner_bottom) = (width - right, height - bottom);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
        );
        for x in ticks(self.ranges[0]) {
            let [column, _] = self.place([x, self.ranges[1][0]]);
            put!(svg, "<path d=\"M{column:.1} {top}V{inner_bottom}\" stroke=\"#ddd\"/>\n");
            let y = inner_bottom + 16.0;
            put!(svg, "<text x=\"{column:.1}\" y=\"{y}\" text-anchor=\"middle\">{}</text>\n", escaped(&number(x)));
        }
        for y in ticks(self.ranges[1]) {
            let [_, line] = self.place([self.ranges[0][0], y]);
            put!(svg, "<path d=\"M{left} {line:.1}H{inner_right}\" stroke=\"#ddd\"/>\n");
            let (x, middle) = (left - 6.0, line + 4.0);
            put!(svg, "<text x=\"{x}\" y=\"{middle:.1}\" text-anchor=\"end\">{}</text>\n", escaped(&number(y)));
        }
        put!(svg, "<path d=\"M{left} {top}V{inner_bottom}H{inner_right}\" fill=\"none\" stroke=\"black\"/>\n");
        svg.push_str(&self.marks);
        if self.keys > 0 {
            svg.push_str(&self.key);
        }
        let middle = [0.5 * (left + inner_right), 0.5 * (top + inner_bottom)];
        let text = |x: f64, y: f64, size: u32, turn: &str, words: &str| {
            let words = escaped(words);
            format!("<text x=\"{x}\" y=\"{y}\" text-anchor=\"middle\" font-size=\"{size}\"{turn}>{words}</text>\n")
        };
        svg += &text(middle[0], 24.0, 18, "", title);
        svg += &text(middle[0], height - 14.0, 13, "", x_name);
        svg += &text(20.0, middle[1], 13, &format!(" transform=\"rotate(-90 20 {})\"", middle[1]), y_name);
        svg + "</svg>\n"
    }
}

/// Round numbers in a range: multiples of 1, 2 or 5 times a power of ten.
fn ticks([low, high]: [f64; 2]) -> Vec<f64> {
    let rough = (high - low) / INTERVALS;
    if !(rough > 0.0 && rough.is_finite()) {
        return Vec::new();
    }
    let power = 10f64.powf(rough.log10().floor());
    let step = [5.0, 2.0, 1.0].into_iter().find(|m| m * power <= rough).unwrap_or(1.0) * power;
    // From whole multiples, so that zero is zero.
    let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
    (first..=last).map(|multiple| multiple as f64 * step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_range() {
        assert_eq!(ticks([-9.0, 11.0]), [-8.0, -6.0, -4.0, -2.0, 0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        for (low, high) in [(400.0, 4000.0), (-3e-6, 1e-6), (0.0, 1.0), (-7.0, -6.999)] {
            let all = ticks([low, high]);
            assert!((3..=12).contains(&all.len()), "{low} {high}: {all:?}");
            assert!(all.iter().all(|x| (low..=high).contains(x)));
        }
        assert!(ticks([1.0, 1.0]).is_empty() && ticks([0.0, f64::NAN]).is_empty());
    }

    #[test]
    fn a_point_lies_where_its_axes_say() {
        let mut chart = Chart::new([0.0, 10.0], [0.0, 1.0]);
        chart.point(0.0, 0.0, "#000");
        chart.point(10.0, 1.0, "#000");
        chart.key("a < b", "#123456");
        let svg = chart.svg("t & u", ["x", "y"]);
        assert!(svg.contains("cx=\"96.0\" cy=\"364.0\"") && svg.contains("cx=\"704.0\" cy=\"40.0\""), "{svg}");
        assert!(svg.contains("a &lt; b") && svg.contains("t &amp; u") && svg.contains("#123456"), "{svg}");
    }
}
