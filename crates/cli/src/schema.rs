//! `schema`: JSON schemas of the files.

use clap::Args;
use depthcal_io::SchemaName;
use serde_json::{Value, json};

use super::failure::{Failure, input};
use super::voice::{document, is_json};

/// Writes the JSON schema of a file to standard output.
///
/// Editors complete and check a dataset.toml whose first line is `#:schema ./dataset.schema.json`, with the schema beside it.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal schema dataset > captures/dataset.schema.json    and `#:schema ./dataset.schema.json` as the first line of dataset.toml
  depthcal schema calibration")]
pub(super) struct Schema {
    /// The file.
    #[arg(value_parser = SchemaName::ALL.map(SchemaName::name))]
    name: String,
}

impl Schema {
    pub(super) fn run(&self) -> Result<Value, Failure> {
        let Some(name) = SchemaName::ALL.into_iter().find(|schema| schema.name() == self.name) else {
            return Err(Failure::Input(format!("there is no schema of {}", self.name)));
        };
        let schema = name.schema();
        if is_json() {
            return Ok(json!({ "schema": schema }));
        }
        let text = serde_json::to_string_pretty(&schema).map_err(input)? + "\n";
        document(text.as_bytes());
        Ok(Value::Null)
    }
}
