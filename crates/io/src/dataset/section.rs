//! Sections of a TOML file, with errors that have line, field and remedy.

use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::DatasetError;
use super::suggest::nearest;

/// A field of a section: its key, such as `columns`, and what to write there.
#[derive(Clone, Copy)]
pub(crate) struct Field {
    pub key: &'static str,
    pub remedy: &'static str,
}

/// The keys of every section of a file; sections of any name are called `NAME`.
pub(crate) type Keys = &'static [(&'static str, &'static [&'static str])];

/// The text of a file, and the path that names it in errors.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub path: &'a Path,
    pub text: &'a str,
}

impl<'a> Source<'a> {
    /// Line of a byte, from 1.
    pub fn line(&self, offset: usize) -> usize {
        1 + self.text.bytes().take(offset).filter(|byte| *byte == b'\n').count()
    }

    pub fn parse(&self) -> Result<DeTable<'a>, DatasetError> {
        DeTable::parse(self.text).map(Spanned::into_inner).map_err(|error| DatasetError::Toml {
            path: self.path.to_owned(),
            line: self.line(error.span().map_or(0, |span| span.start)),
            message: error.message().to_owned(),
        })
    }

    /// Refuses keys of `table` other than `known`. `section` is the table's name, empty for the file itself. A key of the same
    /// name in another section (`everywhere` has the keys of all sections) is suggested first, then the nearest key of this
    /// section.
    pub fn deny_unknown(
        &self,
        table: &DeTable<'_>,
        section: &str,
        known: &'static [&'static str],
        everywhere: Keys,
    ) -> Result<(), DatasetError> {
        let Some(key) = table.keys().find(|key| !known.contains(&key.get_ref().as_ref())) else { return Ok(()) };
        let name = key.get_ref().as_ref();
        let exact = everywhere.iter().find(|(_, keys)| keys.contains(&name)).map(|(section, _)| full(section, name));
        let here = || nearest(name, known.iter().copied()).map(|known| full(section, known));
        Err(DatasetError::UnknownKey {
            path: self.path.to_owned(),
            line: self.line(key.span().start),
            key: full(section, name),
            suggestion: exact.or_else(here),
            known,
        })
    }

    /// The section of that name with its keys, which are `known`; `None` where the file has none.
    pub fn section(
        &self,
        root: &'a DeTable<'a>,
        field: Field,
        known: &'static [&'static str],
        everywhere: Keys,
    ) -> Result<Option<Section<'a>>, DatasetError> {
        let Some(value) = root.get(field.key) else { return Ok(None) };
        self.subsection(value, field.key.to_owned(), field, known, everywhere).map(Some)
    }

    /// The table `value` as the section `name`, whose keys are `known`; `field` is what it should be.
    pub fn subsection(
        &self,
        value: &'a Spanned<DeValue<'a>>,
        name: String,
        field: Field,
        known: &'static [&'static str],
        everywhere: Keys,
    ) -> Result<Section<'a>, DatasetError> {
        let Some(table) = value.get_ref().as_table() else {
            return Err(self.field_error(value, name, field.remedy, "is not a section"));
        };
        self.deny_unknown(table, &name, known, everywhere)?;
        Ok(Section { source: *self, name, table })
    }

    pub fn field_error(
        &self,
        value: &Spanned<DeValue<'_>>,
        field: impl Into<String>,
        remedy: &'static str,
        problem: impl Into<String>,
    ) -> DatasetError {
        DatasetError::Field {
            path: self.path.to_owned(),
            line: self.line(value.span().start),
            field: field.into(),
            value: self.text.get(value.span()).unwrap_or("?").to_owned(),
            problem: problem.into(),
            remedy,
        }
    }

    pub fn missing(&self, field: Field) -> DatasetError {
        DatasetError::MissingField { path: self.path.to_owned(), field: field.key.to_owned(), remedy: field.remedy }
    }
}

/// Name of a key with its section.
fn full(section: &str, key: &str) -> String {
    if section.is_empty() { key.to_owned() } else { format!("{section}.{key}") }
}

/// One table of the file.
pub(crate) struct Section<'a> {
    pub source: Source<'a>,
    /// Its name, such as `board` or `cameras.colour`.
    pub name: String,
    pub table: &'a DeTable<'a>,
}

impl<'a> Section<'a> {
    pub fn get(&self, field: Field) -> Option<&'a Spanned<DeValue<'a>>> {
        self.table.get(field.key)
    }

    /// Says what is wrong with the value of a field.
    pub fn fault(&self, value: &Spanned<DeValue<'_>>, field: Field, problem: impl Into<String>) -> DatasetError {
        self.source.field_error(value, full(&self.name, field.key), field.remedy, problem)
    }

    /// Says that a field is missing.
    pub fn missing(&self, field: Field) -> DatasetError {
        let field_name = full(&self.name, field.key);
        DatasetError::MissingField { path: self.source.path.to_owned(), field: field_name, remedy: field.remedy }
    }

    pub fn required(&self, field: Field) -> Result<&'a Spanned<DeValue<'a>>, DatasetError> {
        self.get(field).ok_or_else(|| self.missing(field))
    }

    pub fn string(&self, field: Field) -> Result<Option<&'a str>, DatasetError> {
        let Some(value) = self.get(field) else { return Ok(None) };
        match value.get_ref().as_str() {
            Some(text) if !text.trim().is_empty() => Ok(Some(text)),
            Some(_) => Err(self.fault(value, field, "is empty")),
            None => Err(self.fault(value, field, "is not a string")),
        }
    }

    pub fn boolean(&self, field: Field) -> Result<Option<bool>, DatasetError> {
        let Some(value) = self.get(field) else { return Ok(None) };
        match value.get_ref().as_bool() {
            Some(flag) => Ok(Some(flag)),
            None => Err(self.fault(value, field, "is neither true nor false")),
        }
    }

    /// A finite number.
    fn finite(&self, value: &Spanned<DeValue<'_>>, field: Field) -> Result<f64, DatasetError> {
        let number = match value.get_ref() {
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|i| i as f64),
            _ => None,
        };
        match number {
            Some(number) if f64::is_finite(number) => Ok(number),
            Some(_) => Err(self.fault(value, field, "is not finite")),
            None => Err(self.fault(value, field, "is not a number")),
        }
    }

    /// A number greater than 0 and within `plausible`.
    pub fn positive(&self, field: Field, plausible: std::ops::RangeInclusive<f64>) -> Result<f64, DatasetError> {
        let value = self.required(field)?;
        let number = self.finite(value, field)?;
        if number <= 0.0 {
            Err(self.fault(value, field, "must be greater than 0"))
        } else if !plausible.contains(&number) {
            let problem = format!("is outside {} … {}", plausible.start(), plausible.end());
            Err(self.fault(value, field, problem))
        } else {
            Ok(number)
        }
    }

    /// A number of at most `limit` in absolute value.
    pub fn bounded(&self, field: Field, limit: f64) -> Result<Option<f64>, DatasetError> {
        self.get(field).map(|value| self.within(value, field, limit)).transpose()
    }

    fn within(&self, value: &Spanned<DeValue<'_>>, field: Field, limit: f64) -> Result<f64, DatasetError> {
        let number = self.finite(value, field)?;
        if number.abs() <= limit {
            Ok(number)
        } else {
            Err(self.fault(value, field, format!("is outside -{limit} … {limit}")))
        }
    }

    /// An array of numbers of at most `limit` in absolute value.
    pub fn numbers(&self, field: Field, limit: f64) -> Result<Option<Vec<f64>>, DatasetError> {
        let Some(value) = self.get(field) else { return Ok(None) };
        let Some(array) = value.get_ref().as_array() else {
            return Err(self.fault(value, field, "is not an array of numbers"));
        };
        array.iter().map(|element| self.within(element, field, limit)).collect::<Result<_, _>>().map(Some)
    }

    /// A whole number within `plausible`.
    pub fn count(&self, field: Field, plausible: std::ops::RangeInclusive<usize>) -> Result<usize, DatasetError> {
        let value = self.required(field)?;
        let Some(integer) = value.get_ref().as_integer() else {
            return Err(self.fault(value, field, "is not a whole number"));
        };
        match usize::from_str_radix(integer.as_str(), integer.radix()) {
            Ok(count) if plausible.contains(&count) => Ok(count),
            _ => {
                let problem = format!("is outside {} … {}", plausible.start(), plausible.end());
                Err(self.fault(value, field, problem))
            }
        }
    }
}
