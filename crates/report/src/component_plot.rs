//! A formula drawn through the residuals that it describes, as SVG.

use depthcal_formula::FormulaCovariate;
use depthcal_io::{DiagnosisComponent, DiagnosisComponentBin};
use plotters::prelude::*;

use crate::format::{number, significant};
use crate::formula_plot::line_colour;

/// Width and height of the picture.
const SIZE: (u32, u32) = (720, 420);
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
    let mut svg = String::new();
    // The canvas is text in memory: drawing on it cannot fail, and a picture that lacks a part is no reason to stop.
    let _ = draw(&mut svg, components, [from - across, to + across], [low - up, high + up]);
    Some(svg)
}

/// The 95 % interval of a bin's residual; the residual alone where its error is unknown.
fn interval(bin: &DiagnosisComponentBin) -> [f64; 2] {
    let half = 1.96 * bin.standard_error_mm.unwrap_or(0.0);
    [bin.residual_mm - half, bin.residual_mm + half]
}

fn draw(
    svg: &mut String,
    components: &[DiagnosisComponent],
    [from, to]: [f64; 2],
    [low, high]: [f64; 2],
) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(84)
        .build_cartesian_2d(from..to, low..high)?;
    let name = components.first().map_or("", |c| c.over.as_str());
    let over = FormulaCovariate::of(name).map_or(name, |c| c.words());
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .x_desc(over)
        .y_desc("depth that the model lacks, mm")
        .x_label_formatter(&|x| number(if x.abs() < 1e-9 * (to - from) { 0.0 } else { *x }))
        .y_label_formatter(&|y| number(*y))
        .draw()?;
    let cap = CAP * (to - from);
    for (i, component) in components.iter().enumerate() {
        let colour = line_colour(i, components.len());
        chart.draw_series(component.bins.iter().map(|bin| {
            let ([below, above], x) = (interval(bin), bin.at);
            PathElement::new(
                [(x - cap, below), (x + cap, below), (x, below), (x, above), (x - cap, above), (x + cap, above)],
                colour.stroke_width(1),
            )
        }))?;
        chart
            .draw_series(component.bins.iter().map(|bin| Circle::new((bin.at, bin.residual_mm), 3, colour.filled())))?;
        let line = component.bins.iter().map(|bin| (bin.at, bin.formula_mm));
        let drawn = chart.draw_series(LineSeries::new(line, colour.stroke_width(2)))?;
        if let Some(part) = &component.part_of {
            let [a, b] = part.range;
            drawn
                .label(format!("{} {} to {}", part.covariate, significant(a, 2), significant(b, 2)))
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
        }
    }
    if components.iter().any(|c| c.part_of.is_some()) {
        chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3)).draw()?;
    }
    area.present()?;
    Ok(())
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
        let colour = |i| {
            let RGBColor(r, g, b) = line_colour(i, 2);
            format!("#{r:02X}{g:02X}{b:02X}")
        };
        for i in 0..2 {
            assert!(svg.contains(&colour(i)), "{}", colour(i));
        }
    }

    #[test]
    fn nothing_is_drawn_of_nothing() {
        assert_eq!(component_plot(&[]), None);
    }
}
