//! A formula drawn through the residuals that it describes, as SVG.

use depthcal_formula::FormulaCovariate;
use depthcal_io::{DiagnosisComponent, DiagnosisComponentBin};

use crate::chart::Chart;
use crate::format::significant;
use crate::formula_plot::line_colour;

/// Half the length of the bars at the ends of an interval, as a share of the range.
const CAP: f64 = 0.004;

/// Mean residuals without a formula, with their 95 % intervals, and the formula as a line through them; one colour for each part
/// of the range of a second covariate. SVG without references to anything else; `None` where there is nothing to draw.
pub fn component_plot(components: &[DiagnosisComponent]) -> Option<String> {
    let bins = || components.iter().flat_map(|c| &c.bins);
    let ends = |value: &dyn Fn(&DiagnosisComponentBin) -> [f64; 2]| {
        bins().map(value).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], [a, b]| [low.min(a), high.max(b)])
    };
    let [from, to] = ends(&|b| [b.at; 2]);
    let [low, high] = ends(&|b| {
        let [low, high] = interval(b);
        [low.min(b.formula_mm), high.max(b.formula_mm)]
    });
    if !(from < to && low < high) {
        return None;
    }
    let (across, up) = (0.02 * (to - from), 0.05 * (high - low));
    Some(draw(components, [from - across, to + across], [low - up, high + up]))
}

/// The 95 % interval of a bin's residual; the residual alone where its error is unknown.
fn interval(bin: &DiagnosisComponentBin) -> [f64; 2] {
    let half = 1.96 * bin.standard_error_mm.unwrap_or(0.0);
    [bin.residual_mm - half, bin.residual_mm + half]
}

fn draw(components: &[DiagnosisComponent], across: [f64; 2], up: [f64; 2]) -> String {
    let mut chart = Chart::new(across, up);
    let cap = CAP * (across[1] - across[0]);
    for (i, component) in components.iter().enumerate() {
        let colour = line_colour(i, components.len());
        for bin in &component.bins {
            let ([below, above], x) = (interval(bin), bin.at);
            let ends = [(x - cap, below), (x + cap, below), (x, below), (x, above), (x - cap, above), (x + cap, above)];
            chart.line(ends, &colour, 1);
            chart.point(x, bin.residual_mm, &colour);
        }
        chart.line(component.bins.iter().map(|bin| (bin.at, bin.formula_mm)), &colour, 2);
        if let Some(part) = &component.part_of {
            let [a, b] = part.range;
            chart.key(&format!("{} {} to {}", part.covariate, significant(a, 2), significant(b, 2)), &colour);
        }
    }
    let name = components.first().map_or("", |c| c.over.as_str());
    let over = FormulaCovariate::of(name).map_or(name, |c| c.words());
    chart.svg("", [over, "depth that the model lacks, mm"])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn component(slope: f64) -> DiagnosisComponent {
        let bin = |i: i32| {
            let covariate = 0.1 * f64::from(i);
            let formula_mm = slope * covariate;
            DiagnosisComponentBin {
                at: covariate,
                residual_mm: formula_mm + 0.05,
                standard_error_mm: Some(0.1),
                formula_mm,
            }
        };
        DiagnosisComponent { over: "y".to_owned(), part_of: None, bins: (0..10).map(bin).collect() }
    }

    #[test]
    fn every_bin_is_a_point_and_every_part_a_line() {
        let svg = component_plot(&[component(1.0), component(-2.0)]).unwrap();
        assert_eq!(svg.matches("<circle").count(), 20, "{svg}");
        assert!(!svg.contains("href"), "no reference to anything else");
        for i in 0..2 {
            assert!(svg.contains(&line_colour(i, 2)), "{}", line_colour(i, 2));
        }
    }

    #[test]
    fn nothing_is_drawn_of_nothing() {
        assert_eq!(component_plot(&[]), None);
    }
}
