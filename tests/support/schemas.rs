//! Files that commands write, held against their schemas.

use std::path::Path;

use depthcal::io::SchemaName;

/// Expects that a file is what the schema `name` says.
pub fn follows(path: impl AsRef<Path>, name: &str) {
    let path = path.as_ref();
    let schema = SchemaName::ALL.into_iter().find(|schema| schema.name() == name).expect("a schema").schema();
    let validator = jsonschema::validator_for(&schema).expect("a valid schema");
    let text = std::fs::read_to_string(path).expect("a file that was written");
    let value = if path.extension().is_some_and(|extension| extension == "toml") {
        let toml: toml::Value = toml::from_str(&text).expect("TOML");
        serde_json::to_value(toml).expect("JSON")
    } else {
        serde_json::from_str(&text).expect("JSON")
    };
    let faults: Vec<String> =
        validator.iter_errors(&value).map(|error| format!("{}: {error}", error.instance_path())).collect();
    assert!(faults.is_empty(), "{}: {}", path.display(), faults.join("\n"));
}
