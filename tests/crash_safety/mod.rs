//! Commands that are killed at random moments leave earlier results, or complete new ones, and the next run is right.

#![cfg(all(unix, feature = "cli", feature = "detect"))]

mod case;
mod state;

use std::fs;
use std::path::Path;

use case::{Case, Tally, prepare};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const SEED: u64 = 1;

/// Every command that writes files, but for `import`, whose dataset is put into place as that of `simulate` is.
const CASES: [Case; 16] = [
    case(
        "board",
        "board --kind charuco --out out/board.pdf --columns 6",
        "board --kind charuco --out out/board.pdf",
        100,
    ),
    case(
        "export",
        "export in/other.json --format opencv --out out/camera.yml",
        "export in/calibration.json --format opencv --out out/camera.yml",
        80,
    ),
    case(
        "formula",
        "formula in/other.toml --rust --latex --plot --out out",
        "formula in/effect.toml --rust --latex --plot --out out",
        80,
    ),
    case("man", "", "man --out out", 60),
    case(
        "apply",
        "apply in/other.json in/dataset --cloud --out out",
        "apply in/calibration.json in/dataset --cloud --out out",
        120,
    ),
    case(
        "apply --register",
        "apply in/rig/calibration.json in/rig-dataset --register colour --out out",
        "apply in/rig/calibration.json in/rig-dataset --register colour --cloud --out out",
        40,
    ),
    Case {
        warm: false,
        ..case("detect", "detect in/dataset --out out --no-cache", "detect in/dataset --out out", 100)
    },
    Case { refuses: true, ..case("simulate", "", "simulate --frames 3 --out out", 80) },
    Case { refuses: true, ..case("simulate --rig", "", "simulate --rig infrared,colour --frames 2 --out out", 30) },
    case(
        "calibrate",
        "diagnose in/dataset --model none --no-discovery --folds 2 --out out",
        "calibrate in/dataset --out out",
        110,
    ),
    case(
        "calibrate (rig)",
        "calibrate in/rig-dataset --model none --out out",
        "calibrate in/rig-dataset --out out",
        20,
    ),
    case(
        "evaluate",
        "evaluate in/other.json in/dataset --out out",
        "evaluate in/calibration.json in/dataset --out out",
        60,
    ),
    case(
        "compare",
        "compare in/dataset --models none --learning 0 --folds 2 --out out",
        "compare in/dataset --models none,projective --learning 0 --folds 2 --out out",
        30,
    ),
    case(
        "diagnose",
        "calibrate in/dataset --model none --out out",
        "diagnose in/dataset --no-discovery --folds 2 --out out",
        25,
    ),
    case("fleet", "fleet in/units --level 0.5 --out out", "fleet in/units --out out", 62),
    case("demo", "", "demo --out out", 3),
];

const fn case(name: &'static str, before: &'static str, command: &'static str, weight: usize) -> Case {
    Case { name, before, command, warm: true, refuses: false, weight }
}

const EFFECT: &str = "[[effect]]\nname = \"row_gain\"\nhook = \"depth\"\nadds_to = \"inverse_depth\"\nof = \"measured\"\n\
    formula = \"a * y * log(rho / rho0)\"\nparameters = { a = { unit = \"1/mm\", value = 3e-5 } }\nconstants = { rho0 = 0.00125 }\n";

/// The inputs of the commands that are named.
fn make_inputs(folder: &Path, is_asked: &dyn Fn(&str) -> bool) {
    prepare(folder, "simulate --kind plywood1 --frames 7 --out in/dataset");
    let fit = |more: &str, file: &str| {
        prepare(folder, &format!("calibrate in/dataset --out in/fit {more}"));
        fs::copy(folder.join("in/fit/calibration.json"), folder.join(file)).unwrap();
    };
    fit("--model none", "in/other.json");
    fit("", "in/calibration.json");
    fs::write(folder.join("in/effect.toml"), EFFECT).unwrap();
    fs::write(folder.join("in/other.toml"), EFFECT.replace("a * y", "a * x")).unwrap();
    if is_asked("fleet") {
        for seed in 1..4 {
            prepare(folder, &format!("simulate --kind plywood1 --seed {seed} --out in/captures/{seed}"));
            prepare(folder, &format!("calibrate in/captures/{seed} --lens brown-conrady:full --out in/units/{seed}"));
        }
    }
    if is_asked("calibrate (rig)") || is_asked("apply --register") {
        prepare(folder, "simulate --rig infrared,colour --kind centered1 --frames 6 --out in/rig-dataset");
        prepare(folder, "calibrate in/rig-dataset --out in/rig");
    }
}

fn kill(is_asked: impl Fn(&str) -> bool, kills: impl Fn(&Case) -> usize) -> Vec<(&'static str, Tally)> {
    let folder = tempfile::tempdir().unwrap();
    make_inputs(folder.path(), &is_asked);
    let asked = CASES.iter().filter(|case| is_asked(case.name));
    let tallies = asked.map(|case| {
        let mut random = ChaCha8Rng::seed_from_u64(SEED);
        let tally = case.run(folder.path(), kills(case), &mut random);
        println!("{}", row(case.name, &tally));
        (case.name, tally)
    });
    tallies.collect()
}

fn row(name: &str, tally: &Tally) -> String {
    let Tally { kills, old, new, between, broken, with_temporary, not_healed } = tally;
    let (broken, not_healed) = (broken.len(), not_healed.len());
    format!("| {name} | {kills} | {old} | {new} | {between} | {broken} | {with_temporary} | {not_healed} |")
}

fn check(tallies: &[(&str, Tally)]) {
    let faults: Vec<String> = tallies
        .iter()
        .flat_map(|(name, tally)| {
            tally.broken.iter().chain(&tally.not_healed).map(move |fault| format!("{name}: {fault}"))
        })
        .collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn killed_commands_lose_nothing() {
    check(&kill(|name| ["board", "export", "apply", "calibrate", "evaluate", "simulate"].contains(&name), |_| 3));
}

/// The table of docs/trust.md. `DEPTHCAL_KILLS` sets the number of kills, `DEPTHCAL_KILLED` the commands, separated by commas.
#[test]
#[ignore = "takes up to an hour"]
fn killed_a_thousand_times() {
    let all: usize = std::env::var("DEPTHCAL_KILLS").map_or(1000, |text| text.parse().expect("a number"));
    let only = std::env::var("DEPTHCAL_KILLED").ok();
    let is_asked = |name: &str| only.as_ref().is_none_or(|only| only.split(',').any(|asked| asked == name));
    let weights: usize = CASES.iter().map(|case| case.weight).sum();
    println!(
        "| command | kills | outputs old | outputs new | in part | broken | temporary files left | not right after the next run |\n\
         |---|---|---|---|---|---|---|---|"
    );
    let tallies = kill(is_asked, |case| (case.weight * all).div_ceil(weights));
    let mut sum = Tally::default();
    for (_, tally) in &tallies {
        sum.kills += tally.kills;
        sum.old += tally.old;
        sum.new += tally.new;
        sum.between += tally.between;
        sum.with_temporary += tally.with_temporary;
        sum.broken.extend(tally.broken.iter().cloned());
        sum.not_healed.extend(tally.not_healed.iter().cloned());
    }
    println!("{}", row("all", &sum));
    check(&tallies);
}
