//! Sections of a TOML file, with errors that have line, field and remedy.

use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::DatasetError;
use super::suggest::nearest;

/// A field: its name with its section, such as `board.columns`, and what to write there.
#[derive(Clone, Copy)]
pub(crate) struct Field {
    pub name: &'static str,
    pub remedy: &'static str,
}

impl Field {
    fn key(&self) -> &'static str {
        self.name.rsplit('.').next().unwrap_or(self.name)
    }
}

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

    /// Refuses keys of `table` other than `known`. `section` ends with a dot, or is empty for the file itself. A field
    /// of the same name in another section (`everywhere` has all fields with their sections) is suggested first, then
    /// the nearest key of this section.
    pub fn deny_unknown(
        &self,
        table: &DeTable<'_>,
        section: &str,
        known: &'static [&'static str],
        everywhere: &[&'static str],
    ) -> Result<(), DatasetError> {
        let Some(key) = table.keys().find(|key| !known.contains(&key.get_ref().as_ref())) else { return Ok(()) };
        let name = key.get_ref().as_ref();
        let exact =
            everywhere.iter().find(|field| field.rsplit('.').next() == Some(name)).map(|field| field.to_string());
        let here = || nearest(name, known.iter().copied()).map(|known| format!("{section}{known}"));
        Err(DatasetError::UnknownKey {
            path: self.path.to_owned(),
            line: self.line(key.span().start),
            key: format!("{section}{name}"),
            suggestion: exact.or_else(here),
            known,
        })
    }

    pub fn field_error(&self, value: &Spanned<DeValue<'_>>, field: Field, problem: impl Into<String>) -> DatasetError {
        DatasetError::Field {
            path: self.path.to_owned(),
            line: self.line(value.span().start),
            field: field.name,
            value: self.text.get(value.span()).unwrap_or("?").to_owned(),
            problem: problem.into(),
            remedy: field.remedy,
        }
    }

    pub fn missing(&self, field: Field) -> DatasetError {
        DatasetError::MissingField { path: self.path.to_owned(), field: field.name, remedy: field.remedy }
    }
}

/// One table of the file.
pub(crate) struct Section<'a> {
    pub source: Source<'a>,
    pub table: &'a DeTable<'a>,
}

impl<'a> Section<'a> {
    pub fn get(&self, field: Field) -> Option<&'a Spanned<DeValue<'a>>> {
        self.table.get(field.key())
    }

    pub fn required(&self, field: Field) -> Result<&'a Spanned<DeValue<'a>>, DatasetError> {
        self.get(field).ok_or_else(|| self.source.missing(field))
    }

    pub fn string(&self, field: Field) -> Result<Option<&'a str>, DatasetError> {
        let Some(value) = self.get(field) else { return Ok(None) };
        match value.get_ref().as_str() {
            Some(text) if !text.trim().is_empty() => Ok(Some(text)),
            Some(_) => Err(self.source.field_error(value, field, "is empty")),
            None => Err(self.source.field_error(value, field, "is not a string")),
        }
    }

    pub fn boolean(&self, field: Field) -> Result<Option<bool>, DatasetError> {
        let Some(value) = self.get(field) else { return Ok(None) };
        match value.get_ref().as_bool() {
            Some(flag) => Ok(Some(flag)),
            None => Err(self.source.field_error(value, field, "is neither true nor false")),
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
            Some(_) => Err(self.source.field_error(value, field, "is not finite")),
            None => Err(self.source.field_error(value, field, "is not a number")),
        }
    }

    /// A number greater than 0 and within `plausible`.
    pub fn positive(&self, field: Field, plausible: std::ops::RangeInclusive<f64>) -> Result<f64, DatasetError> {
        let value = self.required(field)?;
        let number = self.finite(value, field)?;
        if number <= 0.0 {
            Err(self.source.field_error(value, field, "must be greater than 0"))
        } else if !plausible.contains(&number) {
            let problem = format!("is outside {} … {}", plausible.start(), plausible.end());
            Err(self.source.field_error(value, field, problem))
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
            Err(self.source.field_error(value, field, format!("is outside -{limit} … {limit}")))
        }
    }

    /// An array of numbers of at most `limit` in absolute value.
    pub fn numbers(&self, field: Field, limit: f64) -> Result<Option<Vec<f64>>, DatasetError> {
        let Some(value) = self.get(field) else { return Ok(None) };
        let Some(array) = value.get_ref().as_array() else {
            return Err(self.source.field_error(value, field, "is not an array of numbers"));
        };
        array.iter().map(|element| self.within(element, field, limit)).collect::<Result<_, _>>().map(Some)
    }

    /// A whole number within `plausible`.
    pub fn count(&self, field: Field, plausible: std::ops::RangeInclusive<usize>) -> Result<usize, DatasetError> {
        let value = self.required(field)?;
        let Some(integer) = value.get_ref().as_integer() else {
            return Err(self.source.field_error(value, field, "is not a whole number"));
        };
        match usize::from_str_radix(integer.as_str(), integer.radix()) {
            Ok(count) if plausible.contains(&count) => Ok(count),
            _ => {
                let problem = format!("is outside {} … {}", plausible.start(), plausible.end());
                Err(self.source.field_error(value, field, problem))
            }
        }
    }
}
