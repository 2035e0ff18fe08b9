//! An effect with its size, and effects by name.

use serde::{Deserialize, Serialize};

use super::info::EffectInfo;
use super::place::{Form, Place};
use super::table::{catalogue, of_whole_frames, uncatalogued};
use crate::error::SimulateError;

/// An effect and its size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Effect {
    /// Its name, one of [`catalogue`], [`uncatalogued`] or [`of_whole_frames`].
    pub name: String,
    /// Its size in the unit of its [`EffectInfo`]; a negative size reverses it.
    pub size: f64,
    /// For a depth effect, where it acts; where its own form has it if `None`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<(Place, Form)>,
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
        Ok(Self { name: name.to_owned(), size, place: None })
    }

    /// The effect called `name` at its default size.
    ///
    /// # Errors
    /// [`SimulateError::UnknownEffect`].
    pub fn with_default_size(name: &str) -> Result<Self, SimulateError> {
        let info = info(name)?;
        Ok(Self { name: name.to_owned(), size: info.default_size, place: None })
    }

    /// The depth effect in another place and form, with the same size at 1 m.
    ///
    /// # Errors
    /// [`SimulateError::NoPlace`] for an effect that does not act on depth.
    pub fn placed(self, place: Place, form: Form) -> Result<Self, SimulateError> {
        match self.info()?.hook {
            "depth" if of_whole_frames().iter().all(|info| info.name != self.name) => {
                Ok(Self { place: Some((place, form)), ..self })
            }
            _ => Err(SimulateError::NoPlace { text: self.name }),
        }
    }

    /// Parses `NAME` (the default size) or `NAME=SIZE`, for a depth effect followed by `@of=true` or `@of=measured` and
    /// `@on=depth`, `@on=factor` or `@on=inverse_depth`, both; `None` for the name `none`.
    ///
    /// # Errors
    /// [`SimulateError::UnknownEffect`], [`SimulateError::BadEffectSize`], [`SimulateError::NoPlace`].
    pub fn parse(text: &str) -> Result<Option<Self>, SimulateError> {
        let Some((effect, place)) = text.split_once('@') else { return Self::parse_size(text) };
        let bad = || SimulateError::NoPlace { text: text.to_owned() };
        let (state, on) = place.split_once('@').ok_or_else(bad)?;
        let named = Place::ALL.into_iter().find(|p| state.strip_prefix("of=") == Some(p.name()));
        let form = Form::ALL.into_iter().find(|f| on.strip_prefix("on=") == Some(f.name()));
        let (place, form) = named.zip(form).ok_or_else(bad)?;
        Self::parse_size(effect)?.map(|effect| effect.placed(place, form)).transpose()
    }

    fn parse_size(text: &str) -> Result<Option<Self>, SimulateError> {
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
        assert_eq!(
            Effect::parse("board_bow=1.5").unwrap(),
            Some(Effect { name: "board_bow".into(), size: 1.5, place: None })
        );
        assert_eq!(Effect::parse("thin_prism").unwrap(), Some(Effect::with_default_size("thin_prism").unwrap()));
        assert!(Effect::parse("edge_step").unwrap().is_some());
        let error = Effect::parse("board_bend").unwrap_err().to_string();
        assert!(error.contains("board_bend") && error.contains("focus_breathing") && error.contains("smooth_map"));
        let error = Effect::parse("board_bow=big").unwrap_err().to_string();
        assert!(error.contains("big") && error.contains("mm"), "{error}");
        assert!(Effect::parse("board_bow=nan").is_err());
        let placed = Effect::parse("cyclic_depth=3@of=measured@on=factor").unwrap().unwrap();
        assert_eq!((placed.size, placed.place), (3.0, Some((Place::Measured, Form::Factor))));
        for text in ["cyclic_depth@of=measured", "cyclic_depth@of=other@on=depth", "board_bow@of=true@on=depth"] {
            let error = Effect::parse(text).unwrap_err().to_string();
            assert!(error.contains("@of="), "{error}");
        }
    }

    #[test]
    fn the_catalogue_is_complete() {
        let names: Vec<_> = catalogue().iter().map(|info| info.name).collect();
        assert_eq!(names.len(), 18);
        assert!(uncatalogued().len() >= 5);
        assert!(uncatalogued().iter().all(|info| !names.contains(&info.name)));
    }
}
