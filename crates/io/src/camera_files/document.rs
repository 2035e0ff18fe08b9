//! Texts of other programs as documents: YAML, JSON, XML and `ost.ini`, recognised by their contents.

use std::path::Path;

use serde_json::Value;
use yaml_rust2::Yaml;
use yaml_rust2::yaml::Hash;

use super::error::CameraFileError;
use super::yaml::DEEPEST;
use super::{mrcal, ost, xml, yaml};

/// Largest text that is read, bytes. Cameras with all their numbers are some kilobytes; mrcal may append its optimisation.
const LARGEST: usize = 64 << 20;

/// The document of a text. Keys with a dot, as ORB-SLAM has them, are mappings: `Camera1.fx` is `fx` of `Camera1`.
pub(super) fn parse(path: &Path, text: &str) -> Result<Yaml, CameraFileError> {
    let syntax = |reason: String| CameraFileError::Syntax { path: path.to_owned(), reason };
    if text.len() > LARGEST {
        return Err(syntax(format!(
            "has more than {LARGEST} bytes, which is no camera: give the file of the camera alone"
        )));
    }
    if xml::is_one(text) {
        return xml::parse(text).map_err(syntax);
    }
    if ost::is_one(text) {
        return Ok(ost::parse(text));
    }
    let json =
        if text.trim_start().starts_with(['{', '[']) { serde_json::from_str::<Value>(text) } else { Ok(Value::Null) };
    let fault = match json {
        Ok(Value::Null) => None,
        Ok(value) => {
            let too_deep = || syntax(format!("has more than {DEEPEST} lists or objects in each other"));
            return from_json(value, 0).map(nested).ok_or_else(too_deep);
        }
        Err(fault) => Some(fault),
    };
    // Python's dictionaries are no JSON, but YAML; of a file called .json the fault of the JSON is told.
    let is_json = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    let body = if text.contains("lensmodel") { mrcal::without_binary(text) } else { text.to_owned() };
    yaml::parse(&body).map(nested).map_err(|reason| match fault {
        Some(fault) if is_json => syntax(format!("is no valid JSON: {fault}")),
        _ => syntax(reason),
    })
}

/// A JSON value; `None` where it is too deep.
fn from_json(value: Value, depth: usize) -> Option<Yaml> {
    if depth > DEEPEST {
        return None;
    }
    Some(match value {
        Value::Null => Yaml::Null,
        Value::Bool(flag) => Yaml::Boolean(flag),
        Value::Number(number) => Yaml::Real(number.to_string()),
        Value::String(text) => Yaml::String(text),
        Value::Array(list) => Yaml::Array(list.into_iter().map(|v| from_json(v, depth + 1)).collect::<Option<_>>()?),
        Value::Object(fields) => {
            let field = |(key, v)| Some((Yaml::String(key), from_json(v, depth + 1)?));
            Yaml::Hash(fields.into_iter().map(field).collect::<Option<Hash>>()?)
        }
    })
}

/// The document with mappings for the parts of its keys.
fn nested(document: Yaml) -> Yaml {
    let Yaml::Hash(fields) = document else { return document };
    let mut out = Hash::new();
    for (key, value) in fields {
        let parts = key.as_str().and_then(|key| key.split_once('.')).map(|(a, b)| (a.to_owned(), b.to_owned()));
        let Some((first, second)) = parts else {
            out.insert(key, value);
            continue;
        };
        let outer = out.entry(Yaml::String(first)).or_insert_with(|| Yaml::Hash(Hash::new()));
        match outer {
            Yaml::Hash(outer) => {
                outer.insert(Yaml::String(second), value);
            }
            _ => {
                out.insert(key, value);
            }
        }
    }
    Yaml::Hash(out)
}
