//! Effects: what can be wrong with the camera or the board, each rendered where it happens.
//!
//! Every effect has one size in a natural unit. Its other properties (a period, a direction, a time constant) have
//! nominal values and vary from one unit of the camera to the next, see [`crate::Simulation::unit`].
//!
//! Depth sizes called *rms* are the root mean square of the effect on depth, before the projective distortion, over the
//! **reference volume**: frontal surfaces at depths from 400 to 1200 mm, evenly, over all pixels of the image.

mod beyond;
mod board;
mod drift;
mod lens;
mod light;
mod range;
mod registration;
#[cfg(test)]
mod size_tests;
mod sizing;
mod table;
mod triangulation;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::board::Board;
use crate::camera::CameraTruth;
use crate::error::SimulateError;
use crate::instrument::Instrument;
pub(crate) use sizing::Context;
pub use table::{catalogue, uncatalogued};

/// An effect and its size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Effect {
    /// Its name, one of [`catalogue`] or [`uncatalogued`].
    pub name: String,
    /// Its size in the unit of its [`EffectInfo`]; a negative size reverses it.
    pub size: f64,
}

/// What is known about an effect.
#[derive(Debug, Clone, Copy)]
pub struct EffectInfo {
    /// Its name.
    pub name: &'static str,
    /// Where it acts: `board`, `lens`, `pixel` or `depth`.
    pub hook: &'static str,
    /// Unit of its size: `mm` or `px`.
    pub unit: &'static str,
    /// A size that is clearly visible and still realistic.
    pub default_size: f64,
    /// What exactly the size measures.
    pub size_is: &'static str,
    /// Its form.
    pub form: &'static str,
    install: Install,
}

/// Puts an effect of a size into the instrument and returns its parameters.
type Install = fn(&Context, f64, &mut Instrument) -> Result<Parameters, SimulateError>;

/// Parameters of an effect by name.
pub type Parameters = BTreeMap<String, f64>;

/// An effect as it was rendered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectTruth {
    /// Its name.
    pub name: String,
    /// Its size.
    pub size: f64,
    /// Unit of the size.
    pub unit: String,
    /// Everything that its form needs.
    pub parameters: Parameters,
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

    /// Reads `NAME` or `NAME=SIZE`. The name `none` is no effect.
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

    /// What is known about this effect.
    ///
    /// # Errors
    /// [`SimulateError::UnknownEffect`].
    pub fn info(&self) -> Result<&'static EffectInfo, SimulateError> {
        info(&self.name)
    }
}

fn bad_size(info: &EffectInfo, size: &str) -> SimulateError {
    SimulateError::BadEffectSize { name: info.name.to_owned(), size: size.to_owned(), unit: info.unit }
}

fn info(name: &str) -> Result<&'static EffectInfo, SimulateError> {
    let names = |list: &[EffectInfo]| list.iter().map(|info| info.name).collect::<Vec<_>>().join(", ");
    catalogue().iter().chain(uncatalogued()).find(|info| info.name == name).ok_or_else(|| {
        SimulateError::UnknownEffect {
            name: name.to_owned(),
            catalogue: names(catalogue()),
            beyond: names(uncatalogued()),
        }
    })
}

/// Camera and board with all of `effects`.
pub(crate) fn install(
    camera: &CameraTruth,
    board: &Board,
    effects: &[Effect],
    unit: u64,
    seed: u64,
) -> Result<(Instrument, Vec<EffectTruth>), SimulateError> {
    let mut instrument = Instrument::new(camera, board);
    let install_one = |effect: &Effect| {
        let info = effect.info()?;
        if !effect.size.is_finite() {
            return Err(bad_size(info, &effect.size.to_string()));
        }
        let context = Context::new(camera, board, info.name, unit, seed);
        let parameters = (info.install)(&context, effect.size, &mut instrument)?;
        Ok(EffectTruth { name: info.name.to_owned(), size: effect.size, unit: info.unit.to_owned(), parameters })
    };
    let truths = effects.iter().map(install_one).collect::<Result<_, _>>()?;
    Ok((instrument, truths))
}

/// Parameters from pairs of name and value.
fn parameters<const N: usize>(pairs: [(&str, f64); N]) -> Parameters {
    pairs.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
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
