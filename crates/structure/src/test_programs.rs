//! Files of `tests/` that no test program contains. Where a manifest lists the test programs itself (`autotests = false`), cargo
//! leaves out such a file without a word.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use syn::Item;
use toml::{Table, Value};

use crate::error::StructureError;
use crate::modules::parse;
use crate::sources::read_text;

/// Files and folders of `tests/` of the crate in `folder` that are neither a test program of its manifest nor a module of one.
///
/// # Errors
/// A manifest, a folder or a file that cannot be read or parsed.
pub fn check_test_programs(folder: &Path) -> Result<Vec<String>, StructureError> {
    let manifest = folder.join("Cargo.toml");
    let parsed: Table = read_text(&manifest)?.parse().map_err(|error: toml::de::Error| StructureError::Manifest {
        path: manifest,
        message: error.message().to_owned(),
    })?;
    if parsed.get("package").and_then(|package| package.get("autotests")) != Some(&Value::Boolean(false)) {
        return Ok(Vec::new());
    }
    let mut reached = HashSet::new();
    for program in parsed.get("test").and_then(Value::as_array).into_iter().flatten() {
        let text_of = |key: &str| program.get(key).and_then(Value::as_str);
        let name = text_of("name").unwrap_or_default();
        let path = text_of("path").map_or_else(|| Path::new("tests").join(format!("{name}.rs")), PathBuf::from);
        let modules = declared_modules(&folder.join(&path))?;
        reached.extend(path.file_stem().map(|stem| stem.to_string_lossy().into_owned()));
        reached.extend(modules);
    }
    let tests = folder.join("tests");
    let mut violations = Vec::new();
    for entry in std::fs::read_dir(&tests).map_err(|source| StructureError::Read { path: tests.clone(), source })? {
        let path = entry.map_err(|source| StructureError::Read { path: tests.clone(), source })?.path();
        let is_source = path.extension().is_some_and(|extension| extension == "rs") || path.join("mod.rs").exists();
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if is_source && !reached.contains(&name) {
            violations.push(format!("tests/{name} is never run: declare it in a test program, `mod {name};`"));
        }
    }
    violations.sort();
    Ok(violations)
}

/// Names of the modules that a test program has in files of their own.
fn declared_modules(path: &Path) -> Result<Vec<String>, StructureError> {
    let name = |item: Item| match item {
        Item::Mod(module) if module.content.is_none() => Some(module.ident.to_string()),
        _ => None,
    };
    Ok(parse(path, &read_text(path)?)?.into_iter().filter_map(name).collect())
}
