//! The page of a fleet.

use std::fmt::Write;

use depthcal_io::{Fleet, Prior};

use super::sentences::{joined, on_depth, outlier, replication, scatter, shared_effect};
use crate::content::Content;
use crate::format::{capital, count, number, p_value, quantity, shown_unit};
use crate::html::escape;
use crate::input::{Made, ReportError};
use crate::made::made;
use crate::{figures, page};

/// Renders a fleet as one self-contained HTML file.
///
/// # Errors
///
/// [`ReportError::Nothing`] without units.
pub fn render_fleet(fleet: &Fleet, prior: &Prior, how: &Made) -> Result<String, ReportError> {
    if fleet.units.is_empty() {
        return Err(ReportError::Nothing);
    }
    let mut content = Content::default();
    first_screen(&mut content, fleet);
    parameters(&mut content, fleet);
    effects(&mut content, fleet);
    units(&mut content, fleet);
    next_unit(&mut content, prior);
    page::render(&format!("Fleet of {}", count(fleet.units.len(), "unit")), &made(how), &content)
}

fn first_screen(content: &mut Content, fleet: &Fleet) {
    let mut findings: Vec<String> = fleet.effects.iter().filter(|e| e.shared).map(shared_effect).collect();
    findings.extend(fleet.replications.iter().map(replication));
    findings.extend(fleet.on_depth.iter().map(|compared| on_depth(compared, fleet.level)));
    findings.extend(fleet.outliers.iter().map(outlier));
    if fleet.outliers.is_empty() {
        findings.push("no unit is unlike the others".to_owned());
    }
    let items: String = findings.iter().map(|s| format!("<li>{}</li>\n", escape(&capital(s)))).collect();
    let left_out: String = fleet
        .left_out
        .iter()
        .map(|l| format!("<p>Left out: {} ({}).</p>\n", escape(&l.calibration), escape(&l.reason)))
        .collect();
    content.open_verdict(&format!("{}.", escape(&capital(&scatter(fleet)))));
    let _ = writeln!(
        content.body,
        "<div class=\"story\"><p>{}.</p>\n<ul>{items}</ul>{left_out}</div>",
        escape(&capital(&joined(fleet)))
    );
    content.close();
}

fn parameters(content: &mut Content, fleet: &Fleet) {
    let intro = "Shared mean and scatter between units by restricted maximum likelihood of the random-effects model, with the whole \
                 covariance of every unit. Units that are outliers are not in them. p-values are corrected for the number of parameters.";
    content.open("parameters", ["Parameters", "What units share, and how they differ"], intro);
    let mut rows = String::new();
    for p in &fleet.parameters {
        let mark = if p.differs_p_value < fleet.level { "<span class=\"hint\">differs</span>" } else { "" };
        let std_dev = escape(&quantity(p.mean_std_dev, shown_unit(&p.unit)));
        let shared = p.shared_p_value.map_or_else(|| "–".to_owned(), p_value);
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\"><code>{}</code>{mark}</th><td><b>{}</b> <span class=\"interval\">± {std_dev}</span></td>\
             <td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&p.name),
            number(p.mean),
            number(p.between_units),
            number(p.of_noise),
            p_value(p.differs_p_value),
            escape(&shared),
        );
    }
    let _ = writeln!(
        content.body,
        "<div class=\"scroll\" tabindex=\"0\"><table><thead><tr><th scope=\"col\">parameter</th><th scope=\"col\">shared mean</th>\
         <th scope=\"col\">scatter between units</th><th scope=\"col\">expected from noise</th><th scope=\"col\">p, units do not \
         differ</th><th scope=\"col\">p, mean is nominal</th></tr></thead><tbody>{rows}</tbody></table></div>"
    );
    let list = [figures::fleet_parameters(fleet)];
    content.picker("parameter-picker", "Parameter", &list, 0);
    content.grid(&list, "one");
    content.close();
}

fn effects(content: &mut Content, fleet: &Fleet) {
    if fleet.effects.is_empty() {
        return;
    }
    let intro = "Effects that models lack, from the scores of all units together: the shared mean of every effect's parameters, and whether \
                 units differ in it. Found effects are certain given those found before them; the detectable size is that which a unit \
                 alone would show with 80 % probability.";
    content.open("effects", ["Effects", "Effects over all units"], intro);
    let mut rows = String::new();
    for e in &fleet.effects {
        let hint = match (e.shared, &e.explained_by) {
            (true, _) => "<span class=\"hint\">shared</span>".to_owned(),
            (false, Some(other)) => format!("<span class=\"hint\">explained by {}</span>", escape(other)),
            (false, None) => String::new(),
        };
        let optional = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), number);
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\"><code>{}</code>{hint}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&e.with),
            e.units.len(),
            e.in_models,
            optional(e.size_mm),
            optional(e.of_detectable),
            p_value(e.shared_p_value),
            p_value(e.differs_p_value),
        );
    }
    let _ = writeln!(
        content.body,
        "<div class=\"scroll\" tabindex=\"0\"><table><thead><tr><th scope=\"col\">effect</th><th scope=\"col\">units</th><th \
         scope=\"col\">in models</th><th scope=\"col\">shared size, rms / mm</th><th scope=\"col\">of the detectable size</th><th \
         scope=\"col\">p, nothing shared</th><th scope=\"col\">p, units do not differ</th></tr></thead><tbody>{rows}</tbody></table></div>"
    );
    let list = [figures::fleet_effects(fleet)];
    content.picker("effect-picker", "Effect", &list, 0);
    content.grid(&list, "one");
    content.close();
}

fn units(content: &mut Content, fleet: &Fleet) {
    let intro = "Errors of every unit on its fitted frames, and the p-value of its departure in the parameters from what the others predict, \
                 uncorrected. A unit whose error is at least twice that of the others, and four robust standard deviations larger, is an \
                 outlier whatever its parameters say.";
    content.open("units", ["Units", "All units"], intro);
    let mut rows = String::new();
    for (i, unit) in fleet.units.iter().enumerate() {
        let departures: Vec<String> = fleet
            .outliers
            .iter()
            .filter(|o| o.unit == i)
            .flat_map(|o| o.parts.iter().map(|p| escape(&p.parameter).clone()))
            .collect();
        let text =
            if departures.is_empty() { "–".to_owned() } else { format!("outlier in {}", departures.join(", ")) };
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"text\">{text}</td></tr>",
            escape(&unit.name),
            unit.frames,
            unit.depth_rms_mm.map_or_else(|| "–".to_owned(), number),
            unit.reprojection_rms_px.map_or_else(|| "–".to_owned(), number),
            p_value(unit.p_value),
        );
    }
    let _ = writeln!(
        content.body,
        "<div class=\"scroll\" tabindex=\"0\"><table><thead><tr><th scope=\"col\">unit</th><th scope=\"col\">frames</th><th \
         scope=\"col\">depth error, rms / mm</th><th scope=\"col\">reprojection error, rms / px</th><th scope=\"col\">p</th><th \
         scope=\"col\" class=\"text\">finding</th></tr></thead><tbody>{rows}</tbody></table></div>"
    );
    content.close();
}

fn next_unit(content: &mut Content, prior: &Prior) {
    let with = match prior.with.is_empty() {
        true => String::new(),
        false => format!(" --with {}", escape(&prior.with.join(","))),
    };
    let intro = format!(
        "What {} say of the next one is in <code>prior.json</code>: <code>depthcal calibrate DATASET --prior prior.json{with}</code>.",
        count(prior.units, "unit")
    );
    content.open("next", ["Next unit", "The next unit"], &intro);
    let mut rows = String::new();
    for (i, name) in prior.parameters.iter().enumerate() {
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\"><code>{}</code></th><td>{}</td><td>{}</td></tr>",
            escape(name),
            number(prior.mean[i]),
            number(prior.covariance[i][i].sqrt())
        );
    }
    let _ = writeln!(
        content.body,
        "<div class=\"scroll\" tabindex=\"0\"><table><thead><tr><th scope=\"col\">parameter</th><th scope=\"col\">mean</th><th \
         scope=\"col\">standard deviation of the prior</th></tr></thead><tbody>{rows}</tbody></table></div>"
    );
    content.close();
}
