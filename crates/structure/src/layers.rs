//! The declared order of the workspace's crates, held against their manifests.

use std::path::Path;

use toml::{Table, Value};

use crate::error::StructureError;
use crate::sources::read_text;

/// A crate of the workspace and its folder.
pub struct Layer {
    /// Name of the package.
    pub package: &'static str,
    /// Folder below the workspace's root; empty for the root package.
    pub folder: &'static str,
}

const fn layer(package: &'static str, folder: &'static str) -> Layer {
    Layer { package, folder }
}

/// From top to bottom: a crate may depend on those below it only.
pub const LAYERS: [Layer; 20] = [
    layer("depthcal-studies", "studies"),
    layer("depthcal-benches", "benches"),
    layer("depthcal-oracles", "crates/oracles"),
    layer("depthcal", ""),
    layer("depthcal-python", "crates/python"),
    layer("depthcal-cli", "crates/cli"),
    layer("depthcal-live", "crates/live"),
    layer("depthcal-report", "crates/report"),
    layer("depthcal-fleet", "crates/fleet"),
    layer("depthcal-correction", "crates/correction"),
    layer("depthcal-calibration", "crates/calibration"),
    layer("depthcal-simulate", "crates/simulate"),
    layer("depthcal-import", "crates/import"),
    layer("depthcal-detect", "crates/detect"),
    layer("depthcal-io", "crates/io"),
    layer("depthcal-solver", "crates/solver"),
    layer("depthcal-formula", "crates/formula"),
    layer("depthcal-model", "crates/model"),
    layer("depthcal-statistics", "crates/statistics"),
    layer("depthcal-structure", "crates/structure"),
];

/// Pairs that the order allows and the architecture does not: the solver knows no cameras, the simulator shares no code with
/// what is fitted.
const APART: [(&str, &str); 8] = [
    ("depthcal-solver", "depthcal-model"),
    ("depthcal-solver", "depthcal-formula"),
    ("depthcal-simulate", "depthcal-formula"),
    ("depthcal-simulate", "depthcal-detect"),
    ("depthcal-simulate", "depthcal-io"),
    ("depthcal-simulate", "depthcal-solver"),
    ("depthcal-simulate", "depthcal-model"),
    ("depthcal-simulate", "depthcal-statistics"),
];

/// Crates from outside that only some of ours may link.
const CONFINED: [(&str, &[&str]); 6] = [
    ("opencv", &["depthcal-detect", "depthcal-studies"]),
    ("clap", &["depthcal-cli", "depthcal-report"]),
    ("clap_complete", &["depthcal-cli", "depthcal-report"]),
    ("clap_mangen", &["depthcal-cli", "depthcal-report"]),
    ("indicatif", &["depthcal-cli", "depthcal-report"]),
    ("plotly", &["depthcal-cli", "depthcal-report"]),
];

/// Violations of the order by the manifests of the workspace in `root`. Layers that do not exist are skipped; a crate of the
/// workspace that is no layer is a violation.
///
/// # Errors
/// A manifest that cannot be read.
pub fn check_layers(root: &Path) -> Result<Vec<String>, StructureError> {
    let mut violations = Vec::new();
    for layer in &LAYERS {
        let path = root.join(layer.folder).join("Cargo.toml");
        if path.exists() {
            let of_manifest = check_manifest(layer.package, &read_text(&path)?)
                .map_err(|message| StructureError::Manifest { path, message })?;
            violations.extend(of_manifest);
        }
    }
    let crates = root.join("crates");
    for entry in std::fs::read_dir(&crates).into_iter().flatten().flatten() {
        let folder = format!("crates/{}", entry.file_name().to_string_lossy());
        if entry.path().join("Cargo.toml").exists() && LAYERS.iter().all(|l| l.folder != folder) {
            violations.push(format!("{folder} has no place in the order of crates: add it to LAYERS"));
        }
    }
    Ok(violations)
}

/// Violations in the text of one manifest. Dependencies of tests are free.
pub fn check_manifest(package: &str, text: &str) -> Result<Vec<String>, String> {
    let manifest: Table = text.parse().map_err(|e: toml::de::Error| e.message().to_owned())?;
    let place = |name: &str| LAYERS.iter().position(|l| l.package == name);
    let ours = place(package);
    let mut violations = Vec::new();
    for dependency in dependencies(&manifest) {
        if let Some(theirs) = place(&dependency)
            && ours.is_none_or(|ours| theirs <= ours)
        {
            violations.push(format!("{package} depends on {dependency}, which is not below it"));
        }
        if dependency == "depthcal-structure" {
            violations.push(format!("{package} depends on {dependency}, which is for tests"));
        }
        if APART.contains(&(package, dependency.as_str())) {
            violations.push(format!("{package} depends on {dependency}; they must not know each other"));
        }
        for (confined, allowed) in CONFINED {
            if dependency == confined && !allowed.contains(&package) {
                violations.push(format!("{package} depends on {dependency}, which is for {} only", allowed.join(", ")));
            }
        }
    }
    Ok(violations)
}

/// Names of the packages that a manifest depends on, for any target, those of tests excepted.
fn dependencies(manifest: &Table) -> Vec<String> {
    let targets = manifest.get("target").and_then(Value::as_table).into_iter().flatten();
    let tables = std::iter::once(manifest).chain(targets.filter_map(|(_, t)| t.as_table()));
    let mut names = Vec::new();
    for table in tables {
        for section in ["dependencies", "build-dependencies"] {
            for (key, value) in table.get(section).and_then(Value::as_table).into_iter().flatten() {
                names.push(value.get("package").and_then(Value::as_str).unwrap_or(key).to_owned());
            }
        }
    }
    names
}
