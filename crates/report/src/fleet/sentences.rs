//! Findings of a fleet, in sentences that terminal and page share.

use depthcal_io::{Fleet, FleetEffect, FleetOnDepth, FleetOutlier, FleetParameter, FleetReplication, FleetUnitOnDepth};

use crate::format::{count, join, number, p_equals, quantity};

/// Most parameters that are named in a sentence.
const MOST_NAMED: usize = 6;

/// Names with how many more there are.
fn named(names: &[&str]) -> String {
    match names.len().saturating_sub(MOST_NAMED) {
        0 => join(names),
        more => format!("{} and {more} more", names[..MOST_NAMED].join(", ")),
    }
}

/// The units and what was joined.
pub(super) fn joined(fleet: &Fleet) -> String {
    let frames: usize = fleet.units.iter().map(|u| u.frames).sum();
    let scored = fleet.units.iter().filter(|u| u.has_scores).count();
    let scores = match scored {
        0 => "none has scores, so that effects can be compared only where models have them".to_owned(),
        n if n == fleet.units.len() => "all have scores of the effects that their models lack".to_owned(),
        n => format!("{n} have scores of the effects that their models lack"),
    };
    format!(
        "{} with {} in all and {} in common; {scores}",
        count(fleet.units.len(), "unit"),
        count(frames, "frame"),
        count(fleet.parameters.len(), "parameter")
    )
}

/// Which parameters differ by unit.
pub(super) fn scatter(fleet: &Fleet) -> String {
    let (differ, alike): (Vec<&FleetParameter>, Vec<&FleetParameter>) =
        fleet.parameters.iter().partition(|p| p.differs_p_value < fleet.level);
    let names = |list: &[&FleetParameter]| named(&list.iter().map(|p| p.name.as_str()).collect::<Vec<_>>());
    match (differ.is_empty(), alike.is_empty()) {
        (true, _) => "no parameter is certain to differ between units".to_owned(),
        (false, true) => "all parameters differ between units".to_owned(),
        (false, false) => {
            format!("{} differ between units; no difference is certain in {}", names(&differ), names(&alike))
        }
    }
}

/// An effect that the units share.
pub(super) fn shared_effect(e: &FleetEffect) -> String {
    let values: Vec<String> = e
        .parameters
        .iter()
        .zip(&e.mean)
        .zip(&e.mean_std_dev)
        .map(|((name, mean), std)| format!("{name} {} ± {}", number(*mean), number(*std)))
        .collect();
    let size = e.size_mm.map_or_else(String::new, |mm| format!(", {}", quantity(mm, "mm rms")));
    let unit = match e.of_detectable {
        Some(share) if share < 1.0 => format!("; {} of the size that a unit alone would show", number(share)),
        Some(share) => format!("; {} times the size that a unit alone would show", number(share)),
        None => String::new(),
    };
    let rivals = match e.indistinguishable.is_empty() {
        true => String::new(),
        false => format!("; not told apart from {}", join(&e.indistinguishable)),
    };
    format!("shared: {} ({}{size}): {}{unit}{rivals}", e.with, p_equals(e.shared_p_value), values.join(", "))
}

/// A unit that is unlike the others.
pub(super) fn outlier(o: &FleetOutlier) -> String {
    if let ("error", [part]) = (o.within.as_str(), o.parts.as_slice()) {
        let (error, unit) = if part.parameter == "depth_rms_mm" { ("depth", "mm") } else { ("reprojection", "px") };
        return format!(
            "outlier: {}, whose {error} error of {} rms is {} times that of the others ({})",
            o.name,
            quantity(part.value, unit),
            number(part.value / part.expected),
            quantity(part.expected, unit)
        );
    }
    let parts: Vec<String> = o
        .parts
        .iter()
        .take(MOST_NAMED)
        .map(|p| {
            format!(
                "{} is {} where the others say {} ({} standard deviations)",
                p.parameter,
                number(p.value),
                number(p.expected),
                number(p.standardized)
            )
        })
        .collect();
    let within = if o.within == "model" { String::new() } else { format!(" in {}", o.within) };
    format!("outlier: {}{within} ({}): {}", o.name, p_equals(o.p_value), parts.join("; "))
}

/// Whether an effect of some units repeats in others.
pub(super) fn replication(r: &FleetReplication) -> String {
    let origin = match r.found_in.len() {
        1 => format!("found in {}", r.found_in[0]),
        n => format!("found in {}", count(n, "unit")),
    };
    let formula = r.formula.as_ref().map_or_else(String::new, |f| format!(" = {f}"));
    let Some((size, std)) = r.relative_size.zip(r.relative_size_std_dev) else {
        return format!(
            "not compared: {}{formula}, {origin}; no other unit has scored it: calibrate them with --score or --with",
            r.effect
        );
    };
    let how = match (r.confirmed, r.tested_in.len()) {
        (true, _) => "confirmed",
        (false, _) => "not confirmed",
    };
    let p = r.p_value.map_or_else(String::new, |p| format!(", {}", p_equals(p)));
    format!(
        "{how}: {}{formula}, {origin}; in the others it has {} ± {} of the size{p}",
        r.effect,
        number(size),
        number(std)
    )
}

/// Whether an effect with constants of the units' own does the same to depth in all of them; tested at a level for all units
/// together.
pub(super) fn on_depth(effect: &FleetOnDepth, level: f64) -> String {
    let units = effect.units.len() as f64;
    let differs = |unit: &&FleetUnitOnDepth| unit.p_value * units < level;
    let difference = |unit: &FleetUnitOnDepth| {
        let [size, of_noise] = [unit.difference_mm, unit.of_noise_mm].map(|mm| quantity(mm, "mm"));
        format!("{} differs by {size} rms (noise alone: {of_noise})", unit.name)
    };
    let differences: Vec<String> = effect.units.iter().filter(differs).map(difference).collect();
    let findings = match differences.is_empty() {
        true => "the units differ by no more than their uncertainties".to_owned(),
        false => join(&differences),
    };
    format!(
        "constants of their own: {} in {}, {} rms of depth on average; {findings}",
        effect.effect,
        count(effect.units.len(), "unit"),
        quantity(effect.mean_mm, "mm")
    )
}
