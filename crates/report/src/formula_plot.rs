//! A picture of a formula: its value over its covariates, as SVG.

use depthcal_formula::{FormulaCovariate, FormulaEffect};
use depthcal_model::AddsTo;
use depthcal_model::hook::HookKind;

use crate::chart::Chart;
use crate::format::significant;

/// Points of a line.
const POINTS: usize = 240;
/// Lines for a second covariate.
const LINES: usize = 5;

/// A line of the picture.
struct Line {
    /// The output that it shows.
    output: usize,
    /// Number of the second covariate's value.
    number: usize,
    points: Vec<(f64, f64)>,
}

/// The value of a formula over its first covariate, with its parameters at their typical deviations from nominal; one line for
/// each of five values of the second covariate, others at the middle of their range. SVG, without references to anything else.
pub fn formula_plot(effect: &FormulaEffect) -> String {
    let function = effect.function();
    let parameters = effect.definition().parameters.values().map(|parameter| parameter.table().nominal);
    let theta: Vec<f64> = match effect.values() {
        Some(values) => values,
        None => parameters.zip(effect.scales()).map(|(nominal, scale)| nominal + scale).collect(),
    };
    let covariates = function.covariates();
    let range = |index: usize| covariates.get(index).map_or([0.0, 1.0], |c| c.typical_range());
    let [from, to] = range(0);
    let lines = if covariates.len() > 1 { LINES } else { 1 };
    let at_line = |line: usize| {
        let [low, high] = range(1);
        if lines == 1 { 0.5 * (low + high) } else { low + (high - low) * line as f64 / (lines - 1) as f64 }
    };
    let curve = |line: usize, which: usize| -> Vec<(f64, f64)> {
        let mut values: Vec<f64> = (0..covariates.len()).map(|i| 0.5 * (range(i)[0] + range(i)[1])).collect();
        if let Some(second) = values.get_mut(1) {
            *second = at_line(line);
        }
        let point = |i: usize| {
            let x = from + (to - from) * i as f64 / (POINTS - 1) as f64;
            if let Some(first) = values.first_mut() {
                *first = x;
            }
            (x, function.values(&theta, &values)[which])
        };
        (0..POINTS).map(point).collect()
    };
    let outputs = effect.definition().formula.texts().len();
    let numbered = (0..outputs).flat_map(|output| (0..lines).map(move |number| (output, number)));
    let curves: Vec<Line> =
        numbered.map(|(output, number)| Line { output, number, points: curve(number, output) }).collect();
    let values = || curves.iter().flat_map(|line| &line.points).map(|(_, y)| *y).filter(|y| y.is_finite());
    let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    let (low, high) = if low < high { (low, high) } else { (low.min(0.0) - 1.0, high.max(0.0) + 1.0) };
    let margin = 0.05 * (high - low);

    let label =
        |line: usize| covariates.get(1).map(|second| format!("{} = {}", second.name(), significant(at_line(line), 3)));
    draw(effect, Chart::new([from, to], [low - margin, high + margin]), &curves, label)
}

/// The unit of what a formula adds.
fn unit(effect: &FormulaEffect) -> &'static str {
    match (effect.hook(), effect.adds_to()) {
        (HookKind::Depth, AddsTo::Depth) | (HookKind::Board, _) => "added, mm",
        (HookKind::Depth, AddsTo::InverseDepth) => "added to inverse depth, 1/mm",
        (_, AddsTo::Factor) => "added to the factor",
        (HookKind::Pixel, _) => "added, px",
        _ => "added, normalised coordinates",
    }
}

/// The colour of one of several lines: from blue to orange, which all eyes tell apart.
pub(crate) fn line_colour(line: usize, lines: usize) -> String {
    let share = if lines > 1 { line as f64 / (lines - 1) as f64 } else { 0.0 };
    let mix = |a: f64, b: f64| (a + (b - a) * share) as u8;
    format!("#{:02X}{:02X}{:02X}", mix(31.0, 230.0), mix(119.0, 120.0), mix(180.0, 20.0))
}

fn draw(effect: &FormulaEffect, mut chart: Chart, curves: &[Line], label: impl Fn(usize) -> Option<String>) -> String {
    let lines = curves.iter().map(|line| line.number + 1).max().unwrap_or(1);
    for Line { output, number: line, points } in curves {
        let colour = line_colour(*line, lines);
        let points = points.iter().copied().filter(|(_, y)| y.is_finite());
        chart.line(points, &colour, if *output == 0 { 2 } else { 1 });
        if let Some(text) = label(*line).filter(|_| *output == 0) {
            chart.key(&text, &colour);
        }
    }
    let over = effect.covariates().first().map_or("", |c: &FormulaCovariate| c.words());
    chart.svg(&effect.text(), [over, unit(effect)])
}

#[cfg(test)]
mod tests {
    use depthcal_formula::FormulaFile;

    use super::*;

    #[test]
    fn the_picture_has_a_line_for_each_value_of_the_second_covariate() {
        let text = "[[effect]]\nname = \"probe\"\nhook = \"depth\"\nformula = \"a*y*log(z/k)\"\nparameters = { a = \"mm\" }\n\
                    constants = { k = 800 }";
        let file = FormulaFile::parse(text).unwrap();
        let svg = formula_plot(&file.effects()[0]);
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{svg}");
        assert!(svg.contains("z + a y ln(z/k)") && svg.contains("z = 400") && svg.contains("z = 4000"), "{svg}");
        // Five lines, and a key for each.
        assert_eq!(svg.matches("stroke-width=\"2\"").count(), 10, "{svg}");
    }
}
