//! The tables of pieces in docs/ against the register. `UPDATE_DOCS=1 cargo test -p depthcal-model --test documents` writes
//! them again.

use std::fmt::Write;
use std::path::PathBuf;

use depthcal_model::hook::HookKind;
use depthcal_model::{AnyPiece, Context, Covariate, Register, pinhole};

fn document(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs")).join(name)
}

/// The text before, within and after the lines `<!-- MARK: begin … -->` and `<!-- MARK: end -->`.
fn parts<'a>(text: &'a str, mark: &str) -> [&'a str; 3] {
    let begin = text.find(&format!("<!-- {mark}: begin")).expect("the table's first marker");
    let table = begin + text[begin..].find('\n').expect("a line after the first marker") + 1;
    let end = text.find(&format!("<!-- {mark}: end -->")).expect("the table's last marker");
    [&text[..table], &text[table..end], &text[end..]]
}

/// Names of the parameters, without the nodes of fields, grouped by unit: `a (1/mm), b (1)`.
fn parameters<'a>(list: impl Iterator<Item = (&'a str, &'a str)>) -> String {
    let mut groups: Vec<(Vec<&str>, &str)> = Vec::new();
    for (name, unit) in list {
        let name = name.split('[').next().unwrap_or(name);
        if groups.iter().any(|(names, _)| names.contains(&name)) {
            continue;
        }
        match groups.last_mut() {
            Some((names, last)) if *last == unit => names.push(name),
            _ => groups.push((vec![name], unit)),
        }
    }
    let words: Vec<String> = groups.iter().map(|(names, unit)| format!("{} ({unit})", names.join(", "))).collect();
    words.join("; ")
}

fn row(piece: &dyn AnyPiece) -> String {
    // The camera and the data set these for fields.
    let of_camera = ["width_px", "height_px", "near_mm", "far_mm"];
    let constants = piece.constants();
    let constants = constants.iter().filter(|c| !of_camera.contains(&c.name));
    let constants: Vec<String> = constants.map(|c| format!("`{}={}`", c.name, c.default)).collect();
    let needs: Vec<&str> = piece.needs().iter().map(|c| c.name()).collect();
    let cell = |list: Vec<String>| if list.is_empty() { "–".to_owned() } else { list.join(", ") };
    format!(
        "| `{}` | {} | {} | {} | {} | {} | {} |\n",
        piece.name(),
        piece.hook().name(),
        piece.summary(),
        piece.equation(),
        parameters(piece.parameters().iter().map(|p| (p.name.as_ref(), p.unit))),
        cell(constants),
        cell(needs.into_iter().map(str::to_owned).collect())
    )
}

fn table(register: &Register) -> String {
    let mut table = String::from(
        "| piece | hook | what it describes | equation | parameters (unit) | constants | needs |\n|---|---|---|---|---|---|---|\n",
    );
    let rows_at =
        |hook: HookKind| register.names_at(hook).map(|name| row(&*register.find(name).unwrap())).collect::<String>();
    table += &rows_at(HookKind::Board);
    table += &rows_at(HookKind::Lens);
    let parameters_of_pinhole = parameters(pinhole::PARAMETERS.iter().map(|p| (p.name.as_ref(), p.unit)));
    let (name, summary, equation) = (pinhole::NAME, pinhole::SUMMARY, pinhole::EQUATION);
    writeln!(
        table,
        "| `{name}` | {} | {summary} | {equation} | {parameters_of_pinhole} | – | – |",
        HookKind::Pixel.name()
    )
    .unwrap();
    table += &rows_at(HookKind::Pixel);
    table += &rows_at(HookKind::Depth);
    table
}

/// The generated table is the written one; with UPDATE_DOCS it is written.
fn check(name: &str, mark: &str, expected: &str) {
    let path = document(name);
    let text = std::fs::read_to_string(&path).unwrap();
    let [before, written, after] = parts(&text, mark);
    if written != expected && std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, format!("{before}{expected}{after}")).unwrap();
        return;
    }
    assert_eq!(written, expected, "docs/{name} does not have the pieces of the register: run this with UPDATE_DOCS=1");
}

#[test]
fn model_has_every_piece_of_the_register() {
    check("model.md", "pieces", &table(&Register::builtin()));
}

/// The stage of the correction that a depth piece becomes, by what it depends on and its shape over depth.
#[derive(Clone, Copy, PartialEq)]
enum Stage {
    Moebius,
    Curve,
    Separable,
    Frame,
    Amplitude,
    Incidence,
    Surroundings,
    StrayLight,
}

const STAGES: [(Stage, &str, &str); 8] = [
    (
        Stage::Moebius,
        "affine in ρ or in z at every pixel",
        "Möbius map z = z_m + (z_m (p + r z_m) + q) / (1 − r z_m), tables of p, q, r where they vary; neighbouring stages become one",
    ),
    (Stage::Curve, "the same at all pixels", "table over depth, 4096 nodes per octave, 64 mm to 16 m"),
    (
        Stage::Separable,
        "any other function of pixel and depth; a whole camera whose focus breathes",
        "sum of at most six products c_k(pixel) φ_k(depth), found by empirical interpolation (Barrault et al. 2004), inverted by \
         Newton's method in tables of φ",
    ),
    (Stage::Frame, "the same at all pixels of a frame", "Möbius map, coefficients per frame"),
    (Stage::Amplitude, "depends on the amplitude", "table over the 16-bit amplitude"),
    (
        Stage::Incidence,
        "depends on the angle of incidence",
        "table over its cosine, which is taken from the surface around the pixel",
    ),
    (
        Stage::Surroundings,
        "depends on the amplitude around the pixel",
        "none: all pixels are inverted by the camera, which takes the amplitude around each from the frame's infrared image",
    ),
    (
        Stage::StrayLight,
        "depends on the light of the whole frame",
        "light of the frame, once per frame; then fixed-point iteration at every pixel, phases and angles as polynomials",
    ),
];

fn stage(piece: &dyn AnyPiece) -> Stage {
    match piece.needs() {
        [] => {}
        [Covariate::Time] | [Covariate::Temperature] => return Stage::Frame,
        [Covariate::Amplitude] => return Stage::Amplitude,
        [Covariate::Incidence] => return Stage::Incidence,
        needs if needs.contains(&Covariate::Surroundings) => return Stage::Surroundings,
        [Covariate::StrayLight] => return Stage::StrayLight,
        other => panic!("{}: no stage for {other:?}", piece.name()),
    }
    let off = |i: usize| 0.3 * (1.0 + 0.4 * (i as f64).sin());
    let theta: Vec<f64> = piece.parameters().iter().enumerate().map(|(i, p)| p.nominal + off(i) * p.scale).collect();
    // Where in the image, pixel and ray, and at which depth.
    let places = [([37.0, 45.0], [-0.31, -0.22]), ([511.0, 306.0], [0.24, 0.13])];
    let measured = |(pixel, [x, y]): ([f64; 2], [f64; 2]), rho: f64| {
        let mut out = [0.0];
        piece.evaluate(&theta, &[x, y, rho, 1.0], &[Context { pixel, ..Context::default() }], &mut out);
        out[0]
    };
    let depths_mm = [413.0, 907.0, 1733.0];
    let is_line = |x: [f64; 3], y: [f64; 3]| {
        let between = y[0] + (y[2] - y[0]) * (x[1] - x[0]) / (x[2] - x[0]);
        (between - y[1]).abs() <= 1e-11 * y[1].abs()
    };
    let is_affine = places.iter().all(|place| {
        let rho = depths_mm.map(|z| 1.0 / z);
        let rho_measured = rho.map(|rho| measured(*place, rho));
        is_line(rho, rho_measured) || is_line(depths_mm, rho_measured.map(|rho| 1.0 / rho))
    });
    let is_alike = depths_mm.iter().all(|z| measured(places[0], 1.0 / z) == measured(places[1], 1.0 / z));
    match (is_affine, is_alike) {
        (true, _) => Stage::Moebius,
        (false, true) => Stage::Curve,
        (false, false) => Stage::Separable,
    }
}

#[test]
fn correction_has_every_depth_piece_in_its_row() {
    let register = Register::builtin();
    let mut stages: Vec<(String, Stage)> = Vec::new();
    for name in register.names_at(HookKind::Depth) {
        let piece = register.find(name).unwrap();
        if piece.options().contains_key("bins") {
            let text = format!("{name}@bins=1");
            let one = register.block(&text, None).unwrap();
            stages.push((text, stage(&**one.piece().unwrap())));
        }
        stages.push((name.to_owned(), stage(&*piece)));
    }
    let mut table = String::from("| what the piece is | stage | built-in pieces |\n|---|---|---|\n");
    for (stage, what, how) in STAGES {
        let names: Vec<String> =
            stages.iter().filter(|(_, s)| *s == stage).map(|(name, _)| format!("`{name}`")).collect();
        writeln!(table, "| {what} | {how} | {} |", names.join(", ")).unwrap();
    }
    check("correction.md", "stages", &table);
}
