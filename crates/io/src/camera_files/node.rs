//! Mappings of a document as other programs write them, with errors that name file and field.

use std::path::Path;

use yaml_rust2::Yaml;

use super::error::CameraFileError;
use super::intrinsics::size_px;
use super::keys::{self, plain};

/// A mapping of a document, and where it is.
#[derive(Clone)]
pub(super) struct Node<'a> {
    pub path: &'a Path,
    value: &'a Yaml,
    /// Its name in errors; empty for the document.
    name: String,
}

impl<'a> Node<'a> {
    pub fn document(path: &'a Path, value: &'a Yaml) -> Self {
        Self { path, value, name: String::new() }
    }

    /// Name of a part of this mapping, as errors and `FILE#NAME` have it.
    pub fn name_of(&self, part: &str) -> String {
        [self.name.as_str(), part].into_iter().filter(|name| !name.is_empty()).collect::<Vec<_>>().join(".")
    }

    pub fn fault(&self, field: &str, problem: impl Into<String>) -> CameraFileError {
        let field = self.name_of(field);
        CameraFileError::Field { path: self.path.to_owned(), field, problem: problem.into() }
    }

    /// A model that is not read, and those that are.
    pub fn unsupported(&self, model: &str, known: &'static str) -> CameraFileError {
        CameraFileError::Model { path: self.path.to_owned(), model: model.to_owned(), known }
    }

    /// The refusal of a camera matrix or of focal lengths without a lens.
    pub fn without_lens(&self, pinhole: &str) -> CameraFileError {
        CameraFileError::NoLens { path: self.path.to_owned(), pinhole: self.name_of(pinhole), keys: self.owned_keys() }
    }

    /// All keys, in the file's order.
    pub fn keys(&self) -> Vec<&'a str> {
        self.value.as_hash().map_or_else(Vec::new, |hash| hash.keys().filter_map(Yaml::as_str).collect())
    }

    pub fn owned_keys(&self) -> Vec<String> {
        self.keys().into_iter().map(str::to_owned).collect()
    }

    /// The key of a quantity, in whatever spelling, that has a value.
    pub fn key(&self, table: &[&str]) -> Option<&'a str> {
        let keys = self.keys();
        let spelled = |quantity: &&str| keys.iter().copied().find(|key| plain(key) == **quantity && self.has(key));
        table.iter().find_map(spelled)
    }

    fn value(&self, field: &str) -> Option<&'a Yaml> {
        let value = &self.value[field];
        (!value.is_badvalue() && !value.is_null()).then_some(value)
    }

    pub fn has(&self, field: &str) -> bool {
        self.value(field).is_some()
    }

    /// Whether a field is a list, or a matrix with `data`.
    pub fn is_list(&self, field: &str) -> bool {
        self.value(field).is_some_and(|value| value.as_vec().is_some() || value["data"].as_vec().is_some())
    }

    /// A mapping in this one.
    pub fn node(&self, field: &str) -> Option<Node<'a>> {
        let value = self.value(field)?;
        value.as_hash()?;
        Some(Node { path: self.path, value, name: self.name_of(field) })
    }

    /// The mappings in a list of this one, or the only one.
    pub fn nodes(&self, field: &str) -> Vec<Node<'a>> {
        match self.value(field).filter(|value| value.as_vec().is_some()) {
            Some(list) => self.listed(list, field),
            None => self.node(field).into_iter().collect(),
        }
    }

    /// The mappings in this one, or in a list of a document.
    pub fn children(&self) -> Vec<Node<'a>> {
        if self.value.as_vec().is_some() {
            return self.listed(self.value, "");
        }
        self.keys().into_iter().flat_map(|key| self.nodes(key)).collect()
    }

    /// The mappings in a list.
    fn listed(&self, list: &'a Yaml, field: &str) -> Vec<Node<'a>> {
        let numbered = list.as_vec().into_iter().flatten().enumerate().filter(|(_, value)| value.as_hash().is_some());
        let name = |i: usize| self.name_of(&format!("{field}[{i}]"));
        numbered.map(|(i, value)| Node { path: self.path, value, name: name(i) }).collect()
    }

    pub fn text(&self, field: &str) -> Option<&'a str> {
        self.value(field)?.as_str()
    }

    pub fn required_text(&self, field: &str) -> Result<&'a str, CameraFileError> {
        self.text(field).ok_or_else(|| self.fault(field, "is missing, expected a name"))
    }

    /// Whether a field is `true`, or a number other than 0.
    pub fn is_set(&self, field: &str) -> bool {
        self.value(field).is_some_and(|v| v.as_bool() == Some(true) || number(v).is_some_and(|flag| flag != 0.0))
    }

    pub fn number(&self, field: &str) -> Option<f64> {
        number(self.value(field)?)
    }

    /// A quantity in whatever spelling; `None` where there is none.
    pub fn quantity(&self, table: &[&str]) -> Result<Option<f64>, CameraFileError> {
        let Some(key) = self.key(table) else { return Ok(None) };
        let finite = self.number(key).filter(|value| value.is_finite());
        finite.map(Some).ok_or_else(|| self.fault(key, "is no finite number"))
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
        let [fx, skew, cx, below, fy, cy, bottom @ ..] = self.array::<9>(field)?;
        if bottom != [0.0, 0.0, 1.0] || below != 0.0 {
            let transposed =
                if [skew, cx, cy] == [0.0; 3] { ", but looks transposed: write it row by row" } else { "" };
            return Err(self.fault(field, format!("is no camera matrix fx s cx, 0 fy cy, 0 0 1{transposed}")));
        }
        self.focal_lengths(field, [fx, fy])?;
        Ok([fx, fy, cx, cy, skew])
    }

    /// Checks that the focal lengths in a field are positive.
    pub fn focal_lengths(&self, field: &str, [fx, fy]: [f64; 2]) -> Result<(), CameraFileError> {
        if fx == 0.0 && fy == 0.0 {
            return Err(
                self.fault(field, "is zero, as drivers write for a camera without a calibration: calibrate it first")
            );
        }
        if !(fx > 0.0 && fy > 0.0) {
            return Err(self.fault(field, format!("has the focal lengths {fx} and {fy}, expected positive ones")));
        }
        Ok(())
    }

    /// fx, fy, cx, cy and skew from fields of their own.
    pub fn named_pinhole(&self) -> Result<[f64; 5], CameraFileError> {
        let required = |table: &[&str]| {
            self.quantity(table)?.ok_or_else(|| self.fault(table[0], "is missing, expected a number of px"))
        };
        let [fx, fy, cx, cy] = [required(keys::FX)?, required(keys::FY)?, required(keys::CX)?, required(keys::CY)?];
        self.focal_lengths(self.key(keys::FX).unwrap_or("fx"), [fx, fy])?;
        Ok([fx, fy, cx, cy, self.quantity(&["skew"])?.unwrap_or(0.0)])
    }

    /// Width and height of the image, px, in any spelling; `None` where there are none.
    pub fn size(&self) -> Result<Option<[usize; 2]>, CameraFileError> {
        if let [Some(width), Some(height)] = [self.key(keys::WIDTH), self.key(keys::HEIGHT)] {
            let fault = || self.fault(width, format!("and `{height}` are no size of an image in px"));
            let size = self.number(width).zip(self.number(height)).and_then(|(w, h)| size_px(w, h));
            return size.map(Some).ok_or_else(fault);
        }
        if let Some(alone) = self.key(keys::WIDTH).or(self.key(keys::HEIGHT)) {
            return Err(self.fault(alone, "stands alone: give width and height, or neither"));
        }
        let Some(field) = self.key(keys::SIZE) else { return Ok(None) };
        if let Some(size) = self.node(field).filter(|_| !self.is_list(field)) {
            return size.size();
        }
        self.size_list(field)
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
