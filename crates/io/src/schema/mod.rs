//! JSON schemas (draft 2020-12) of the files that depthcal reads and writes.
//!
//! Schemas of result files come from the types that are written; that of `dataset.toml` is a file of its own, because its parser
//! gives better errors than a derived one and accepts what no derived type says (see its tests).

use depthcal_model::FormulaDefinition;
use schemars::generate::SchemaSettings;
use schemars::transform::RecursiveTransform;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde_json::{Value, json};

use crate::file::Versioned;
use crate::record::{
    Calibration, CameraDiagnosis, Comparison, Difference, Evaluation, Fleet, Observations, Prior, RigDiagnosis, Scores,
};

/// The files that have a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SchemaName {
    /// `dataset.toml`.
    Dataset,
    /// A file of formulas, `effects/NAME.toml`.
    Effects,
    /// `observations.json`.
    Observations,
    /// `calibration.json`.
    Calibration,
    /// `evaluation.json`.
    Evaluation,
    /// `diagnosis.json`.
    Diagnosis,
    /// `diagnosis.json` of a rig.
    RigDiagnosis,
    /// `comparison.json`.
    Comparison,
    /// `diff.json`.
    Difference,
    /// `fleet.json`.
    Fleet,
    /// `prior.json`.
    Prior,
    /// `scores.json`.
    Scores,
}

/// A file of formulas.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[expect(dead_code, reason = "only its schema is used")]
struct EffectFile {
    /// The effects.
    effect: Vec<FormulaDefinition>,
}

impl SchemaName {
    /// All files that have a schema.
    pub const ALL: [SchemaName; 12] = [
        SchemaName::Dataset,
        SchemaName::Effects,
        SchemaName::Observations,
        SchemaName::Calibration,
        SchemaName::Evaluation,
        SchemaName::Diagnosis,
        SchemaName::RigDiagnosis,
        SchemaName::Comparison,
        SchemaName::Difference,
        SchemaName::Fleet,
        SchemaName::Prior,
        SchemaName::Scores,
    ];

    /// The schema's name.
    pub fn name(self) -> &'static str {
        match self {
            SchemaName::Dataset => "dataset",
            SchemaName::Effects => "effects",
            SchemaName::Observations => "observations",
            SchemaName::Calibration => "calibration",
            SchemaName::Evaluation => "evaluation",
            SchemaName::Diagnosis => "diagnosis",
            SchemaName::RigDiagnosis => "rig_diagnosis",
            SchemaName::Comparison => "comparison",
            SchemaName::Difference => "diff",
            SchemaName::Fleet => "fleet",
            SchemaName::Prior => "prior",
            SchemaName::Scores => "scores",
        }
    }

    /// The schema.
    pub fn schema(self) -> Value {
        let mut schema = match self {
            // The file is part of the program and of its tests, so this cannot fail.
            SchemaName::Dataset => serde_json::from_str(include_str!("dataset.json")).unwrap_or_default(),
            SchemaName::Effects => of::<EffectFile>(),
            SchemaName::Observations => versioned::<Observations>(),
            SchemaName::Calibration => versioned::<Calibration>(),
            SchemaName::Evaluation => of::<Evaluation>(),
            SchemaName::Diagnosis => of::<CameraDiagnosis>(),
            SchemaName::RigDiagnosis => of::<RigDiagnosis>(),
            SchemaName::Comparison => of::<Comparison>(),
            SchemaName::Difference => of::<Difference>(),
            SchemaName::Fleet => of::<Fleet>(),
            SchemaName::Prior => versioned::<Prior>(),
            SchemaName::Scores => versioned::<Scores>(),
        };
        let file = match self {
            SchemaName::Dataset => "dataset.toml of depthcal".to_owned(),
            SchemaName::Effects => "Formulas of depthcal (effects/*.toml)".to_owned(),
            SchemaName::RigDiagnosis => "diagnosis.json of depthcal, of a rig".to_owned(),
            other => format!("{}.json of depthcal", other.name()),
        };
        schema["title"] = json!(file);
        schema
    }
}

/// The schema of what is written, which is stricter than what is read.
fn of<T: JsonSchema>() -> Value {
    let settings = SchemaSettings::draft2020_12().with_transform(RecursiveTransform(without_line_breaks));
    SchemaGenerator::from(settings).into_root_schema_for::<T>().to_value()
}

/// Descriptions come from doc comments: where their lines break says nothing, where their paragraphs end does.
fn without_line_breaks(schema: &mut Schema) {
    if let Some(Value::String(description)) = schema.get_mut("description") {
        *description =
            description.split("\n\n").map(|paragraph| paragraph.replace('\n', " ")).collect::<Vec<_>>().join("\n\n");
    }
}

/// With the fields that identify the file and its version.
fn versioned<T: Versioned + JsonSchema>() -> Value {
    let mut schema = of::<T>();
    schema["properties"]["format"] = json!({ "const": T::FORMAT, "description": "Identifies the kind of file." });
    schema["properties"]["version"] = json!({ "type": "integer", "minimum": T::OLDEST, "maximum": T::VERSION, "description": "Version of the file's format." });
    if let Some(required) = schema["required"].as_array_mut() {
        required.splice(0..0, [json!("format"), json!("version")]);
    }
    schema
}
