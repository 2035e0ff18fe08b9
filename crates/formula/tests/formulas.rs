//! Formulas as users write them: what is refused and how, and that pieces made of them are what the same equation in Rust is.

use std::sync::Arc;

use depthcal_formula::{FormulaEffect, FormulaFile, file_text};
use depthcal_model::hook::HookKind;
use depthcal_model::{AnyPiece, Context, On, Options, Register, StrayLight};

const ROW_GAIN: &str = r#"
[[effect]]
name = "row_gain"
hook = "depth"
adds_to = "inverse_depth"
of = "true"
formula = "a * y * log(rho / rho0)"
parameters = { a = "1/mm" }
constants = { rho0 = 0.00125 }
"#;

fn effect(text: &str) -> FormulaEffect {
    FormulaFile::parse(text).unwrap_or_else(|e| panic!("{e}")).effects()[0].clone()
}

/// An effect of depth of one formula.
fn depth(adds_to: &str, formula: &str, parameters: &str, constants: &str) -> Result<FormulaEffect, String> {
    let text = format!(
        "[[effect]]\nname = \"probe\"\nhook = \"depth\"\nadds_to = \"{adds_to}\"\nformula = \"{formula}\"\nparameters = {{ \
         {parameters} }}\nconstants = {{ {constants} }}\n"
    );
    FormulaFile::parse(&text).map(|file| file.effects()[0].clone()).map_err(|e| e.to_string())
}

fn refusal(adds_to: &str, formula: &str, parameters: &str, constants: &str) -> String {
    depth(adds_to, formula, parameters, constants).expect_err(formula)
}

#[test]
fn a_formula_has_the_values_of_its_equation() {
    let piece = effect(ROW_GAIN).piece(&Options::new());
    let (rho, y, a): (f64, f64, f64) = (1.0 / 700.0, -0.3, 2e-5);
    let mut out = [0.0];
    piece.evaluate(&[a], &[0.2, y, rho, 0.9], &[Context::default()], &mut out);
    let expected = rho + a * y * (rho / 0.00125).ln();
    assert!((out[0] - expected).abs() <= 1e-18, "{} {expected}", out[0]);
    assert_eq!(piece.form(), On::InverseDepth);
    assert_eq!((piece.parameters()[0].unit, piece.constants()[0].unit), ("1/mm", "1/mm"));
    assert_eq!(piece.equation(), "ρ + a y ln(ρ/ρ₀)");
    let other = effect(ROW_GAIN).piece(&Options::from([("rho0".to_owned(), 0.002)]));
    other.evaluate(&[a], &[0.2, y, rho, 0.9], &[Context::default()], &mut out);
    assert!((out[0] - (rho + a * y * (rho / 0.002).ln())).abs() <= 1e-18);
}

#[test]
fn what_is_wrong_is_shown_in_its_place() {
    let message = refusal("depth", "a * (z - 1000)", "a = \\\"1\\\"".replace('\\', "").as_str(), "");
    assert!(
        message.contains("line 5, column 17: the units clash: 'z' is in mm, but '1000' is a plain number"),
        "{message}"
    );
    assert!(message.contains("^^^^^^^^"), "{message}");
    let message = refusal("depth", "a * sin(z / p", "a = \"mm\"", "p = 100");
    assert!(message.contains("column 25: expected"), "{message}");
    let message = refusal("depth", "a * w", "a = \"mm\"", "");
    assert!(message.contains("'w' is no covariate, parameter or constant: declare it"), "{message}");
    let message = refusal("depth", "a * board_x", "a = \"1\"", "");
    assert!(message.contains("'board_x' is not known at hook 'depth'"), "{message}");
    let message = refusal("inverse_depth", "a * x", "a = \"mm\"", "");
    assert!(message.contains("the formula is in mm, but inverse_depth is in 1/mm"), "{message}");
    let message = refusal("depth", "a * x + 5 * b", "a = \"mm\", b = { unit = \"mm\", nominal = 1 }", "");
    assert!(message.contains("is 5.000e0 at the parameters' nominal values"), "{message}");
    let message = refusal("depth", "a * x", "a = \"mm\", b = \"1\"", "");
    assert!(message.contains("parameters.b: is not used"), "{message}");
    let message = refusal("depth", "a * sin(b * x)", "a = \"mm\", b = \"1\"", "");
    assert!(message.contains("changes nothing while the other parameters"), "{message}");
    let message = refusal("depth", "a * log(x)", "a = \"mm\"", "");
    assert!(message.contains("has no finite value at x = "), "{message}");
    let message = refusal("depth", "z * a", "a = \"1\", z = \"mm\"", "");
    assert!(message.contains("parameters.z: is the name of a covariate"), "{message}");
    let message = refusal("depth", "a * x", "a = \"cm\"", "");
    assert!(message.contains("lengths are in mm"), "{message}");
    let message = refusal("depth", "a * x * k", "a = \"mm\"", "k = { value = 1, search = \"period\" }");
    assert!(message.contains("constants.k.search: is possible only"), "{message}");
    let message = refusal("u", "a * x", "a = \"mm\"", "");
    assert!(message.contains("'u' is nothing that a formula of hook 'depth' adds to"), "{message}");
    let file = |text: &str| FormulaFile::parse(text).unwrap_err().to_string();
    assert!(file("").contains("has no effect"));
    assert!(file("[[effect]]\nname = \"a\"\n").contains("missing field"), "{}", file("[[effect]]\nname = \"a\"\n"));
    assert!(file(&format!("{ROW_GAIN}{ROW_GAIN}")).contains("two effects are named 'row_gain'"));
    assert!(file(&ROW_GAIN.replace("depth\"\nadds", "dept\"\nadds")).contains("unknown variant"));
    let taken = effect(&ROW_GAIN.replace("row_gain", "cyclic_depth")).register(&mut Register::builtin());
    assert!(taken.unwrap_err().to_string().contains("a piece of depthcal has this name"));
}

/// Formulas at every hook, in every form, with every function.
fn samples() -> Vec<FormulaEffect> {
    let mut all = Vec::new();
    for (adds_to, formula, parameters, constants) in [
        ("depth", "a*r^2 + b*r^4", "a = \"mm\", b = \"mm\"", ""),
        ("depth", "a*exp(-z/k)*cos(x) + b*tanh(y)", "a = \"mm\", b = \"mm\"", "k = 800"),
        ("depth", "a*incidence + b*max(x, y)*min(x, 0.1)", "a = \"mm\", b = \"mm\"", ""),
        ("depth", "a*sqrt(amplitude/a0) + b*log(surroundings/a0)", "a = \"mm\", b = \"mm\"", "a0 = 1000"),
        ("inverse_depth", "a*sin(2*pi*rho/p) + b*cos(2*pi*rho/p)", "a = \"1/mm\", b = \"1/mm\"", "p = 4e-5"),
        ("factor", "a*hinge(z - k) + b*abs(u - c)*step(v - c)", "a = \"1/mm\", b = \"1/px\"", "k = 900, c = 200"),
        ("factor", "a*(temperature_c - t0) + b*timestamp_s", "a = \"1/°C\", b = \"1/s\"", "t0 = 25"),
        ("factor", "a*atan(range/k) + b*tan(x)^3*(2^y)*(r + 1)^x", "a = \"1\", b = \"1\"", "k = 900"),
        ("depth", "a*r", "a = \"mm\"", ""),
        (
            "depth",
            "(x + 2)*spline(z, l, h, 0, a, b, c, (a + b)/2)",
            "a = \"mm\", b = \"mm\", c = \"mm\"",
            "l = 610, h = 2510",
        ),
    ] {
        all.push(depth(adds_to, formula, parameters, constants).unwrap_or_else(|e| panic!("{e}")));
    }
    for text in [
        "[[effect]]\nname = \"breathing\"\nhook = \"lens\"\nformula = \"b*rho*r^2\"\nparameters = { b = \"mm\" }",
        "[[effect]]\nname = \"shear\"\nhook = \"lens\"\nadds_to = \"xy\"\nformula = [\"a*x*y\", \"b*y*z/k\"]\n\
         parameters = { a = \"1\", b = \"1\" }\nconstants = { k = 1000 }",
        "[[effect]]\nname = \"lens_y\"\nhook = \"lens\"\nadds_to = \"y\"\nformula = \"a*x\"\nparameters = { a = \"1\" }",
        "[[effect]]\nname = \"rolling\"\nhook = \"pixel\"\nformula = [\"a*v\", \"b*u*v/k\"]\n\
         parameters = { a = \"1\", b = \"1\" }\nconstants = { k = 500 }",
        "[[effect]]\nname = \"row_shift\"\nhook = \"pixel\"\nadds_to = \"v\"\nformula = \"a\"\nparameters = { a = \"px\" }",
        "[[effect]]\nname = \"sag\"\nhook = \"board\"\nformula = \"a*sin(pi*board_x/w)\"\nparameters = { a = \"mm\" }\n\
         constants = { w = 400 }",
    ] {
        all.push(effect(text));
    }
    all
}

fn inputs(hook: HookKind) -> (usize, usize) {
    match hook {
        HookKind::Lens => (5, 2),
        HookKind::Depth => (4, 1),
        HookKind::Pixel => (2, 2),
        _ => (3, 3),
    }
}

/// Observations at a hook, more than one chunk of them.
fn observations(hook: HookKind) -> (Vec<f64>, Vec<Context>) {
    let mut states = Vec::new();
    let mut contexts = Vec::new();
    for i in 0..70 {
        let t = f64::from(i) / 70.0;
        let (x, y, rho) = (0.6 * t - 0.31, 0.41 - 0.7 * t * t, 1.0 / (500.0 + 2500.0 * t));
        states.extend(match hook {
            HookKind::Lens => vec![x, y, rho, 1.01 * x, 0.99 * y],
            HookKind::Depth => vec![x, y, rho, 1.0 - 0.5 * t],
            HookKind::Pixel => vec![640.0 * t, 480.0 - 400.0 * t],
            _ => vec![300.0 * t, 200.0 - 150.0 * t, 0.5],
        });
        contexts.push(Context {
            pixel: [640.0 * t, 480.0 - 400.0 * t],
            amplitude: 300.0 + 900.0 * t,
            surround: 1200.0 - 800.0 * t,
            stray: StrayLight::UNKNOWN,
            time_s: 100.0 * t,
            temperature_c: 30.0 - 5.0 * t,
            ..Context::default()
        });
    }
    (states, contexts)
}

/// B-splines reproduce straight lines whose coefficients are the line's values at the knots, and are constant beyond the ends.
#[test]
fn a_spline_with_a_line_of_coefficients_is_the_line() {
    let effect =
        depth("depth", "spline(z, 500, 1100, a - b, a, a + b, a + 2*b, a + 3*b)", "a = \"mm\", b = \"mm\"", "");
    let message = effect.unwrap_err().to_string();
    assert!(message.contains("'z' is in mm, but '500' is a plain number"), "{message}");
    let constants = "l = 500, h = 1100";
    let formula = "spline(z, l, h, a - b, a, a + b, a + 2*b, a + 3*b)";
    let effect = depth("depth", formula, "a = \"mm\", b = \"mm\"", constants).unwrap();
    assert_eq!(effect.text(), "z + spline(z, l, h, a − b, …, a + 3 b)");
    let function = effect.function();
    for (z, expected) in
        [(400.0, 7.0), (500.0, 7.0), (620.0, 7.8), (800.0, 9.0), (1000.0, 7.0 + 10.0 / 3.0), (1400.0, 11.0)]
    {
        let value = function.values(&[7.0, 2.0], &[z])[0];
        assert!((value - expected).abs() < 1e-12, "{z}: {value}");
    }
}

fn theta(piece: &dyn AnyPiece) -> Vec<f64> {
    piece.parameters().iter().enumerate().map(|(i, p)| p.nominal + p.scale * (1.0 - 0.3 * i as f64)).collect()
}

#[test]
fn derivatives_match_differences() {
    for effect in samples() {
        let piece = effect.piece(&Options::new());
        let (n_in, n_out) = inputs(piece.hook());
        let (states, contexts) = observations(piece.hook());
        let (theta, n) = (theta(&*piece), contexts.len());
        let p = theta.len();
        let (mut out, mut d_state, mut d_theta) =
            (vec![0.0; n * n_out], vec![0.0; n * n_out * n_in], vec![0.0; n * n_out * p]);
        piece.linearize(&theta, &states, &contexts, &mut out, &mut d_state, Some(&mut d_theta));
        let value = |theta: &[f64], states: &[f64]| {
            let mut out = vec![0.0; n * n_out];
            piece.evaluate(theta, states, &contexts, &mut out);
            out
        };
        assert_eq!(value(&theta, &states), out, "{}", effect.text());
        // Single observations take another way through the instructions.
        let mut one = vec![0.0; n_out];
        piece.evaluate(&theta, &states[..n_in], &contexts[..1], &mut one);
        assert_eq!(one, out[..n_out], "{}", effect.text());
        let near = |derivative: f64, ends: [f64; 2], h: f64, what: &str| {
            let expected = (ends[1] - ends[0]) / (2.0 * h);
            let rounding = 1e-15 * ends[0].abs().max(1e-3) / h;
            assert!(
                (derivative - expected).abs() <= 2e-5 * expected.abs() + 4.0 * rounding,
                "{} {what}: {derivative} {expected}",
                effect.text()
            );
        };
        for i in 0..n_in {
            // Cosines stay within (0, 1].
            let h = |k: usize| 1e-5 * states[k * n_in + i].abs().max(1e-6);
            let moved = |sign: f64| {
                let mut states = states.clone();
                (0..n).for_each(|k| states[k * n_in + i] += sign * h(k));
                value(&theta, &states)
            };
            let ends = [moved(-1.0), moved(1.0)];
            for k in 0..n * n_out {
                near(d_state[k * n_in + i], [ends[0][k], ends[1][k]], h(k / n_out), &format!("state {i}, {k}"));
            }
        }
        for i in 0..p {
            let h = 1e-3 * piece.parameters()[i].scale;
            let moved = |sign: f64| {
                let mut theta = theta.clone();
                theta[i] += sign * h;
                value(&theta, &states)
            };
            let ends = [moved(-1.0), moved(1.0)];
            for k in 0..n * n_out {
                near(d_theta[k * p + i], [ends[0][k], ends[1][k]], h, &format!("parameter {i}, {k}"));
            }
        }
        // At nominal parameters nothing changes, and the short way gives the derivatives of the long one.
        let nominal: Vec<f64> = piece.parameters().iter().map(|p| p.nominal).collect();
        piece.linearize(&nominal, &states, &contexts, &mut out, &mut d_state, Some(&mut d_theta));
        let first = [out.clone(), d_state.clone(), d_theta.clone()].concat();
        piece.linearize_at_nominal(&nominal, &states, &contexts, &mut out, &mut d_state, &mut d_theta);
        for (i, (a, b)) in first.iter().zip([out, d_state, d_theta].concat()).enumerate() {
            assert!((a - b).abs() <= 1e-12 * a.abs().max(1e-9), "{}, {i}: {a} {b}", effect.text());
        }
    }
}

#[test]
fn nothing_is_added_where_a_covariate_is_unknown() {
    let piece = depth("depth", "a*log(amplitude/k)", "a = \"mm\"", "k = 1000").unwrap().piece(&Options::new());
    let (rho, contexts) =
        (1.0 / 900.0, [0.0, f64::NAN, 500.0].map(|amplitude| Context { amplitude, ..Context::default() }));
    let states = [0.1, 0.2, rho, 0.9].repeat(3);
    let (mut out, mut d_state, mut d_theta) = ([0.0; 3], [0.0; 12], [0.0; 3]);
    piece.linearize(&[3.0], &states, &contexts, &mut out, &mut d_state, Some(&mut d_theta));
    assert_eq!(out[..2], [rho, rho]);
    assert_eq!((&d_state[..4], d_theta[0]), (&[0.0, 0.0, 1.0, 0.0][..], 0.0));
    assert!(out[2] != rho && d_theta[2] != 0.0);
}

#[test]
fn the_catalogues_equations_as_formulas_are_the_same_pieces() {
    let register = Register::builtin();
    let constants = |list: &str| list.to_owned();
    for (name, adds_to, formula, parameters, list) in [
        ("quadratic_depth", "depth", "q2*z^2 + q3*z^3", "q2 = \"1/mm\", q3 = \"1/mm²\"", constants("")),
        (
            "disparity_ripple",
            "inverse_depth",
            "a*sin(2*pi*rho/period) + b*cos(2*pi*rho/period)",
            "a = \"1/mm\", b = \"1/mm\"",
            constants("period = 4e-5"),
        ),
        (
            "reflectivity_bias",
            "depth",
            "b1*log(amplitude/k) + b2*log(amplitude/k)^2 + b3*log(amplitude/k)^3",
            "b1 = \"mm\", b2 = \"mm\", b3 = \"mm\"",
            constants("k = 1000"),
        ),
    ] {
        let built_in: Arc<dyn AnyPiece> = register.find(name).unwrap();
        let formula = depth(adds_to, formula, parameters, &list).unwrap().piece(&Options::new());
        let (states, contexts) = observations(HookKind::Depth);
        let theta = theta(&*built_in);
        let (n, p) = (contexts.len(), theta.len());
        let run = |piece: &dyn AnyPiece| {
            let (mut out, mut d_state, mut d_theta) = (vec![0.0; n], vec![0.0; 4 * n], vec![0.0; p * n]);
            piece.linearize(&theta, &states, &contexts, &mut out, &mut d_state, Some(&mut d_theta));
            [out, d_state, d_theta].concat()
        };
        for (i, (a, b)) in run(&*built_in).iter().zip(run(&*formula)).enumerate() {
            // Sines of a zero crossing are rounding errors of their argument.
            assert!((a - b).abs() <= 1e-12 * a.abs() + 1e-13, "{name}, {i}: {a} {b}");
        }
    }
}

#[test]
fn files_and_records_carry_formulas_whole() {
    let all = samples();
    let text = file_text(&all[9..10]);
    let again = FormulaFile::parse(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert_eq!(again.effects()[0], all[9]);
    for effect in &all {
        let json = serde_json::to_string(effect.definition()).unwrap();
        assert_eq!(FormulaEffect::new(serde_json::from_str(&json).unwrap()).as_ref(), Ok(effect), "{json}");
    }
}

#[test]
fn formulas_in_print() {
    let effect = depth("depth", "-a*(x - 1e-4)^2/(b0 + z)*exp(-z/k) + a*sqrt(r)", "a = \"mm\"", "b0 = 3, k = 2");
    // The constants have no unit of their own: b0 and k are in mm, so the first term has no unit but that of 1.
    let message = effect.unwrap_err();
    assert!(message.contains("units clash"), "{message}");
    let effect =
        depth("depth", "-a*(x - 1e-4)^2*k/(b0 + z)*exp(-z/k) + a*sqrt(r)", "a = \"mm\"", "b0 = 3, k = 2").unwrap();
    assert_eq!(effect.text(), "z − a (x − 1·10⁻⁴)² k/(b₀ + z) exp(−z/k) + a √(r)");
    assert_eq!(
        effect.latex(),
        "z - \\frac{a \\, \\left(x - 1 \\cdot 10^{-4}\\right)^{2} \\, k}{b_{0} + z} \\, \\exp\\left(-\\frac{z}{k}\\right) + a \\, \
         \\sqrt{r}"
    );
    let mathml = effect.mathml();
    assert!(mathml.starts_with("<math xmlns="), "{mathml}");
    assert!(mathml.contains("<msub><mi>b</mi><mi>0</mi></msub>") && mathml.contains("<msqrt>"), "{mathml}");
}
