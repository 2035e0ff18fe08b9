//! An effect with its size, and effects by name.

use serde::{Deserialize, Serialize};

use super::info::EffectInfo;
use super::table::{catalogue, of_whole_frames, uncatalogued};
use crate::error::SimulateError;

/// An effect and its size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Effect {
    /// Its name, one of [`catalogue`], [`uncatalogued`] or [`of_whole_frames`].
    pub name: String,
    /// Its size in the unit of its [`EffectInfo`]; a negative size reverses it.
    pub size: f64,
}

impl Effect {
    /// The effect called `name` at `size`.
    ///
    /// # Errors
    /// [`SimulateError::UnknownEffect`], [`SimulateError::BadEffectSize`].
    pub fn new(name: &str, size: f64) -> Result<Self, SimulateError> {
        let info = info(name)?;
        if !size.is_finite() {
            return Err(bad_size(info, &size.to_string()));
        }
        Ok(Self { name: name.to_owned(), size })
    }

    /// The effect called `name` at its default size.
    ///
    /// # Errors
    /// [`SimulateError::UnknownEffect`].
    pub fn with_default_size(name: &str) -> Result<Self, SimulateError> {
        let info = info(name)?;
        Ok(Self { name: name.to_owned(), size: info.default_size })
    }

    /// Parses `NAME` (the default size) or `NAME=SIZE`; `None` for the name `none`.
    ///
    /// # Errors
    /// [`SimulateError::UnknownEffect`], [`SimulateError::BadEffectSize`].
    pub fn parse(text: &str) -> Result<Option<Self>, SimulateError> {
        let (name, size) = match text.split_once('=') {
            Some((name, size)) => (name.trim(), Some(size.trim())),
            None => (text.trim(), None),
        };
        if name == "none" {
            return Ok(None);
        }
        let info = info(name)?;
        match size {
            None => Self::with_default_size(name).map(Some),
            Some(size) => {
                let number = size.parse().map_err(|_| bad_size(info, size))?;
                Self::new(name, number).map(Some)
            }
        }
    }

    /// The description of this effect.
    ///
    /// # Errors
    /// [`SimulateError::UnknownEffect`].
    pub fn info(&self) -> Result<&'static EffectInfo, SimulateError> {
        info(&self.name)
    }
}

pub(super) fn bad_size(info: &EffectInfo, size: &str) -> SimulateError {
    SimulateError::BadEffectSize { name: info.name.to_owned(), size: size.to_owned(), unit: info.unit }
}

fn info(name: &str) -> Result<&'static EffectInfo, SimulateError> {
    let names = |list: &[EffectInfo]| list.iter().map(|info| info.name).collect::<Vec<_>>().join(", ");
    catalogue().iter().chain(uncatalogued()).chain(of_whole_frames()).find(|info| info.name == name).ok_or_else(|| {
        SimulateError::UnknownEffect {
            name: name.to_owned(),
            catalogue: names(catalogue()),
            beyond: format!("{}, {}", names(uncatalogued()), names(of_whole_frames())),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effects_are_read_from_text() {
        assert_eq!(Effect::parse("none").unwrap(), None);
        assert_eq!(Effect::parse("board_bow=1.5").unwrap(), Some(Effect { name: "board_bow".into(), size: 1.5 }));
        assert_eq!(Effect::parse("thin_prism").unwrap(), Some(Effect::with_default_size("thin_prism").unwrap()));
        assert!(Effect::parse("edge_step").unwrap().is_some());
        let error = Effect::parse("board_bend").unwrap_err().to_string();
        assert!(error.contains("board_bend") && error.contains("focus_breathing") && error.contains("smooth_map"));
        let error = Effect::parse("board_bow=big").unwrap_err().to_string();
        assert!(error.contains("big") && error.contains("mm"), "{error}");
        assert!(Effect::parse("board_bow=nan").is_err());
    }

    #[test]
    fn the_catalogue_is_complete() {
        let names: Vec<_> = catalogue().iter().map(|info| info.name).collect();
        assert_eq!(names.len(), 17);
        assert!(uncatalogued().len() >= 5);
        assert!(uncatalogued().iter().all(|info| !names.contains(&info.name)));
    }
}
