//! YAML documents as other programs write them, with errors that name file and field.

use std::path::Path;

use yaml_rust2::parser::{Event, Parser};
use yaml_rust2::{Yaml, YamlLoader};

use super::error::CameraFileError;
use super::intrinsics::size_px;

/// A mapping of a document, and where it is.
#[derive(Clone, Copy)]
pub(super) struct Node<'a> {
    pub path: &'a Path,
    value: &'a Yaml,
    /// Its name in errors; empty for the document.
    name: &'a str,
}

/// Largest depth of lists and mappings in each other. Camera files have four; the parser's stack would not stand thousands.
const DEEPEST: usize = 32;
/// Largest text that is read, bytes. Cameras with all their numbers are some kilobytes; mrcal may append its optimisation.
const LARGEST: usize = 64 << 20;

/// Refuses what the loader takes on trust: depth, which it walks by recursion, and aliases, a few of which in each other are more
/// than any memory holds.
fn check_structure(body: &str, syntax: impl Fn(String) -> CameraFileError) -> Result<(), CameraFileError> {
    let mut parser = Parser::new_from_str(body);
    let mut depth = 0_usize;
    loop {
        let (event, mark) = parser.next_token().map_err(|e| syntax(format!("is no valid YAML: {e}")))?;
        let line = mark.line();
        match event {
            Event::SequenceStart(..) | Event::MappingStart(..) => depth += 1,
            Event::SequenceEnd | Event::MappingEnd => depth = depth.saturating_sub(1),
            Event::Alias(_) => {
                return Err(syntax(format!("line {line}: has an alias (*NAME): write the value itself")));
            }
            Event::StreamEnd => return Ok(()),
            _ => {}
        }
        if depth > DEEPEST {
            return Err(syntax(format!("line {line}: has more than {DEEPEST} lists or mappings in each other")));
        }
    }
}

/// The first document of a text. OpenCV's directive `%YAML:1.0`, which is no valid one, is left out.
pub(super) fn parse(path: &Path, text: &str) -> Result<Yaml, CameraFileError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let body = match text.strip_prefix("%YAML") {
        Some(rest) => rest.split_once('\n').map_or("", |(_, body)| body),
        None => text,
    };
    let syntax = |reason: String| CameraFileError::Syntax { path: path.to_owned(), reason };
    if body.len() > LARGEST {
        return Err(syntax(format!(
            "has more than {LARGEST} bytes, which is no camera: give the file of the camera alone"
        )));
    }
    check_structure(body, syntax)?;
    let documents = YamlLoader::load_from_str(body).map_err(|e| syntax(format!("is no valid YAML: {e}")))?;
    documents.into_iter().next().ok_or_else(|| syntax("is empty".to_owned()))
}

impl<'a> Node<'a> {
    pub fn document(path: &'a Path, value: &'a Yaml) -> Self {
        Self { path, value, name: "" }
    }

    pub fn fault(&self, field: &str, problem: impl Into<String>) -> CameraFileError {
        let field = if self.name.is_empty() { field.to_owned() } else { format!("{}.{field}", self.name) };
        CameraFileError::Field { path: self.path.to_owned(), field, problem: problem.into() }
    }

    fn value(&self, field: &str) -> Option<&'a Yaml> {
        let value = &self.value[field];
        (!value.is_badvalue() && !value.is_null()).then_some(value)
    }

    pub fn has(&self, field: &str) -> bool {
        self.value(field).is_some()
    }

    /// A mapping in this one.
    pub fn node(&self, field: &'a str) -> Option<Node<'a>> {
        let value = self.value(field)?;
        value.as_hash()?;
        Some(Node { path: self.path, value, name: field })
    }

    /// Names of all mappings in this one.
    pub fn mappings(&self) -> Vec<&'a str> {
        let Some(hash) = self.value.as_hash() else { return Vec::new() };
        hash.iter().filter(|(_, v)| v.as_hash().is_some()).filter_map(|(k, _)| k.as_str()).collect()
    }

    pub fn text(&self, field: &str) -> Option<&'a str> {
        self.value(field)?.as_str()
    }

    pub fn required_text(&self, field: &str) -> Result<&'a str, CameraFileError> {
        self.text(field).ok_or_else(|| self.fault(field, "is missing, expected a name"))
    }

    pub fn number(&self, field: &str) -> Option<f64> {
        number(self.value(field)?)
    }

    /// The numbers of a sequence, or of the `data` of a matrix; `None` where there is no such field.
    pub fn numbers(&self, field: &str) -> Result<Option<Vec<f64>>, CameraFileError> {
        let Some(value) = self.value(field) else { return Ok(None) };
        let list = if value.as_hash().is_some() { &value["data"] } else { value };
        let wrong = || self.fault(field, "is no list of finite numbers");
        let list = list.as_vec().ok_or_else(wrong)?;
        // Rows of a matrix may be lists of their own.
        let flat = list.iter().flat_map(|v| v.as_vec().map_or_else(|| std::slice::from_ref(v), Vec::as_slice));
        let numbers: Option<Vec<f64>> = flat.map(number).collect();
        numbers.filter(|n| n.iter().all(|v| v.is_finite())).map(Some).ok_or_else(wrong)
    }

    pub fn required_numbers(&self, field: &str) -> Result<Vec<f64>, CameraFileError> {
        self.numbers(field)?.ok_or_else(|| self.fault(field, "is missing, expected a list of numbers"))
    }

    /// So many numbers.
    pub fn array<const N: usize>(&self, field: &str) -> Result<[f64; N], CameraFileError> {
        let given = self.required_numbers(field)?;
        let count = given.len();
        given.try_into().map_err(|_| self.fault(field, format!("has {count} numbers, expected {N}")))
    }

    /// fx, fy, cx, cy and skew from a 3×3 matrix.
    pub fn camera_matrix(&self, field: &str) -> Result<[f64; 5], CameraFileError> {
        let [fx, skew, cx, _, fy, cy, ..] = self.array::<9>(field)?;
        if !(fx > 0.0 && fy > 0.0) {
            return Err(self.fault(field, format!("has the focal lengths {fx} and {fy}, expected positive ones")));
        }
        Ok([fx, fy, cx, cy, skew])
    }

    /// A width and a height, px, from two fields.
    pub fn size(&self, fields: [&str; 2]) -> Result<Option<[usize; 2]>, CameraFileError> {
        let fault = || self.fault(fields[0], format!("and `{}` are no size of an image in px", fields[1]));
        match fields.map(|field| self.number(field)) {
            [None, None] => Ok(None),
            [Some(width), Some(height)] => size_px(width, height).map(Some).ok_or_else(fault),
            _ => Err(fault()),
        }
    }

    /// A width and a height, px, in a list.
    pub fn size_list(&self, field: &str) -> Result<Option<[usize; 2]>, CameraFileError> {
        let Some(numbers) = self.numbers(field)? else { return Ok(None) };
        let size = if let [width, height] = numbers[..] { size_px(width, height) } else { None };
        size.map(Some).ok_or_else(|| self.fault(field, "is no width and height of an image in px"))
    }
}

fn number(value: &Yaml) -> Option<f64> {
    match value {
        Yaml::Integer(i) => Some(*i as f64),
        // Python writes "1." and "1e-05", which are strings to YAML 1.2's core schema or to strict parsers.
        Yaml::Real(text) | Yaml::String(text) => text.trim().parse().ok(),
        _ => None,
    }
}
