//! The difference of two calibrations in sentences that terminal, page and JSON share.

use depthcal_io::{CameraDifference, ClearestDifference, DepthDifference, Difference, DifferenceSize};

use crate::format::{count, join, number, p_equals, quantity, signed};

/// A distance: from one metre on in metres.
pub(super) fn distance(mm: f64) -> String {
    if mm < 1000.0 { quantity(mm, "mm") } else { quantity(mm / 1000.0, "m") }
}

/// The verdict: whether and where the calibrations differ by more than their uncertainties, one sentence per quantity and camera.
pub fn difference_sentences(d: &Difference) -> Vec<String> {
    let mut sentences = Vec::new();
    for camera in &d.cameras {
        let of_camera = [depth_sentence(camera), projection_sentence(camera), extrinsics_sentence(camera, d.level)];
        let name = if d.cameras.len() > 1 { format!("Camera {}: ", camera.name) } else { String::new() };
        sentences.extend(of_camera.into_iter().flatten().map(|sentence| match name.is_empty() {
            true => sentence,
            false => format!("{name}{}{}", sentence[..1].to_lowercase(), &sentence[1..]),
        }));
    }
    if !d.not_compared.is_empty() {
        sentences.push(format!("Only one of the two has {}.", join(&d.not_compared)));
    }
    sentences
}

/// Limits of the verdict.
pub(super) fn notes(d: &Difference) -> Vec<String> {
    let mut notes = Vec::new();
    if d.common_frames > 0 {
        notes.push(format!(
            "Both were fitted to {}. Their noise is common, so that a difference within the uncertainties is no evidence that both \
             are right.",
            count(d.common_frames, "common frame")
        ));
    }
    let exact = |name: &str, side: fn(&CameraDifference) -> bool| {
        let all = d.cameras.iter().all(side);
        (!all).then(|| format!("{name} states no covariance and is taken as exact."))
    };
    notes.extend(exact(&d.first, |camera| camera.first.has_covariance));
    notes.extend(exact(&d.second, |camera| camera.second.has_covariance));
    notes
}

/// Runs of distances at which depth differs, as first and last place in the list.
fn runs(depth: &[DepthDifference]) -> Vec<[usize; 2]> {
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for (i, _) in depth.iter().enumerate().filter(|(_, d)| d.size.differs) {
        match runs.last_mut() {
            Some([_, last]) if *last + 1 == i => *last = i,
            _ => runs.push([i, i]),
        }
    }
    runs
}

/// Where depth differs, in words.
fn where_it_differs(depth: &[DepthDifference], runs: &[[usize; 2]]) -> String {
    let last = depth.len() - 1;
    let place = |i: usize| distance(depth[i].distance_mm);
    let part = |[from, to]: &[usize; 2]| match (*from == 0, *to == last) {
        (true, true) => "at all distances".to_owned(),
        (false, true) => format!("beyond {}", place(*from)),
        (true, false) => format!("up to {}", place(*to)),
        (false, false) if from == to => format!("at {}", place(*from)),
        (false, false) => format!("from {} to {}", place(*from), place(*to)),
    };
    join(&runs.iter().map(part).collect::<Vec<_>>())
}

/// Whether the boards of both calibrations cover a distance; true where these are not known.
fn is_covered(camera: &CameraDifference, mm: f64) -> bool {
    let covers = |side: Option<[f64; 2]>| side.is_none_or(|[near, far]| (near..=far).contains(&mm));
    covers(camera.first.covered_mm) && covers(camera.second.covered_mm)
}

fn expected(size: &DifferenceSize, unit: &str) -> String {
    let expected = size.expected_rms.map(|rms| format!("uncertainties: {}", quantity(rms, unit)));
    let p = size.p_value.map(p_equals);
    join_some([expected, p])
}

fn join_some(parts: [Option<String>; 2]) -> String {
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// The part of the image in which a pixel lies.
fn part_of_image(camera: &CameraDifference, clearest: &ClearestDifference) -> String {
    let third = |x: f64, size: usize| (3.0 * x / size as f64).floor().clamp(0.0, 2.0) as usize;
    let [column, row] = [third(clearest.u, camera.width), third(clearest.v, camera.height)];
    let words = [
        ["the upper left", "the top", "the upper right"],
        ["the left", "the middle", "the right"],
        ["the lower left", "the bottom", "the lower right"],
    ];
    format!("at {} of the image", words[row][column])
}

fn clearest(camera: &CameraDifference, size: &DifferenceSize, shown: impl Fn(f64) -> String, unit: &str) -> String {
    size.clearest.as_ref().map_or_else(String::new, |c| {
        let std_dev = if c.std_dev > 0.0 { format!(" ± {}", number(c.std_dev)) } else { String::new() };
        format!(", most clearly {} ({}{std_dev} {unit})", part_of_image(camera, c), shown(c.difference))
    })
}

fn depth_sentence(camera: &CameraDifference) -> Option<String> {
    let depth = &camera.depth;
    let (first, last) = (depth.first()?, depth.last()?);
    let covered: Vec<&DepthDifference> = depth.iter().filter(|d| is_covered(camera, d.distance_mm)).collect();
    let range = format!("from {} to {}", distance(first.distance_mm), distance(last.distance_mm));
    let largest = |list: &[&DepthDifference]| {
        let order = |d: &DepthDifference| d.size.expected_rms.map_or(d.size.rms, |expected| d.size.rms / expected);
        list.iter().copied().max_by(|a, b| order(a).total_cmp(&order(b))).cloned()
    };
    let all: Vec<&DepthDifference> = depth.iter().collect();
    if depth.iter().all(|d| d.size.p_value.is_none()) {
        let worst = largest(if covered.is_empty() { &all } else { &covered })?;
        return Some(format!(
            "Corrected depth differs by {} rms at {}; neither calibration says how certain it is.",
            quantity(worst.size.rms, "mm"),
            distance(worst.distance_mm)
        ));
    }
    let runs = runs(depth);
    if runs.is_empty() {
        let worst = largest(if covered.is_empty() { &all } else { &covered })?;
        return Some(format!(
            "Corrected depth agrees within the uncertainties {range}: {} rms over the image at {} ({}).",
            quantity(worst.size.rms, "mm"),
            distance(worst.distance_mm),
            expected(&worst.size, "mm")
        ));
    }
    let differing: Vec<&DepthDifference> = depth.iter().filter(|d| d.size.differs).collect();
    let inside: Vec<&DepthDifference> =
        differing.iter().copied().filter(|d| is_covered(camera, d.distance_mm)).collect();
    let worst = largest(if inside.is_empty() { &differing } else { &inside })?;
    let outside =
        if inside.is_empty() { " These distances lie beyond the boards of at least one of the two." } else { "" };
    Some(format!(
        "Corrected depth differs by more than the uncertainties {}: {} rms over the image at {} ({}){}.{outside}",
        where_it_differs(depth, &runs),
        quantity(worst.size.rms, "mm"),
        distance(worst.distance_mm),
        expected(&worst.size, "mm"),
        clearest(camera, &worst.size, signed, "mm"),
    ))
}

fn projection_sentence(camera: &CameraDifference) -> Option<String> {
    let order = |size: &DifferenceSize| size.p_value.map_or(-size.rms, |p| p);
    let worst = camera.projection.iter().min_by(|a, b| order(&a.size).total_cmp(&order(&b.size)))?;
    let size = &worst.size;
    let distance_words = worst.distance_mm.map_or_else(String::new, |mm| format!(" at {}", distance(mm)));
    let rms = quantity(size.rms, "px");
    Some(match (size.p_value, size.differs) {
        (None, _) => format!("Projection differs by {rms} rms over the image{distance_words}."),
        (Some(_), false) => {
            format!(
                "Projection agrees within the uncertainties: {rms} rms over the image{distance_words} ({}).",
                expected(size, "px")
            )
        }
        (Some(_), true) => format!(
            "Projection differs by more than the uncertainties: {rms} rms over the image{distance_words} ({}){}.",
            expected(size, "px"),
            clearest(camera, size, number, "px")
        ),
    })
}

fn extrinsics_sentence(camera: &CameraDifference, level: f64) -> Option<String> {
    let e = camera.extrinsics.as_ref()?;
    let length = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let sizes = format!(
        "{} and {}",
        quantity(length(&e.translation_mm), "mm"),
        quantity(1e3 * length(&e.rotation_rad), "mrad")
    );
    Some(match e.p_value {
        None => format!("Extrinsics differ by {sizes}."),
        Some(p) if p < level => format!("Extrinsics differ by more than the uncertainties: {sizes} ({}).", p_equals(p)),
        Some(p) => format!("Extrinsics agree within the uncertainties: {sizes} ({}).", p_equals(p)),
    })
}
