//! The register of pieces: names to pieces, for files and the command line.

use std::collections::BTreeMap;
use std::sync::Arc;

use thiserror::Error;

use crate::camera::Block;
use crate::field::Field;
use crate::hook::{Depth, Hook, HookKind};
use crate::piece::{AnyPiece, Piece, erase};
use crate::{board, depth, lens, pixel};

/// Constants of a piece by name, as [`AnyPiece::options`] gives them.
pub type Options = BTreeMap<String, f64>;

/// Depth pieces that move ρ by an amount of their own at every pixel and cannot scale it.
const OFFSET_MAPS: [&str; 2] = ["disparity_decay", "free_map"];

type Make = Arc<dyn Fn(&Options) -> Arc<dyn AnyPiece> + Send + Sync>;

/// Why a model could not be made from its name.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RegisterError {
    /// No piece has this name.
    #[error("there is no piece named '{name}'; known are {}", known.join(", "))]
    UnknownPiece {
        /// The name asked for.
        name: String,
        /// All names.
        known: Vec<String>,
    },
    /// A piece cannot be used where it was asked for.
    #[error("'{name}' acts on the {found}, not on the {expected}")]
    WrongHook {
        /// The piece.
        name: String,
        /// Where it acts.
        found: &'static str,
        /// Where it was to act.
        expected: &'static str,
    },
    /// A constant that the piece does not have, or without a number.
    #[error(
        "'{given}' is no constant of '{name}': write {name}@CONSTANT=NUMBER with one of its constants: {}",
        if known.is_empty() { "it has none".to_owned() } else { known.join(", ") }
    )]
    UnknownConstant {
        /// The piece.
        name: String,
        /// What was given.
        given: String,
        /// Its constants.
        known: Vec<String>,
    },
    /// A constant outside what the piece can do.
    #[error("{name}@{key}={value} is out of range; the nearest that '{name}' can do is {nearest}")]
    OutOfRange {
        /// The piece.
        name: String,
        /// The constant.
        key: String,
        /// What was given.
        value: String,
        /// What is possible.
        nearest: String,
    },
    /// A subset names a parameter that the piece does not have.
    #[error("'{name}' has no parameter '{letter}'; a subset is written with the last letters of {}", parameters.join(", "))]
    UnknownParameter {
        /// The piece.
        name: String,
        /// What was asked for.
        letter: char,
        /// Its parameters.
        parameters: Vec<String>,
    },
}

/// Names to pieces. [`Register::builtin`] has depthcal's own; [`Register::add`] takes others.
#[derive(Clone)]
pub struct Register {
    entries: Vec<(&'static str, HookKind, Make)>,
}

impl std::fmt::Debug for Register {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.names()).finish()
    }
}

impl Register {
    /// A register without pieces.
    pub fn empty() -> Self {
        Self { entries: Vec::new() }
    }

    /// All pieces that depthcal has: one line each.
    pub fn builtin() -> Self {
        let mut register = Self::empty();
        register.add(|_| board::BoardBow);
        register.add(|_| board::PrintScale);
        register.add(|_| lens::BrownConrady);
        register.add(|_| lens::ThinPrism);
        register.add(|_| lens::RationalDistortion);
        register.add(|_| lens::TiltedSensor);
        register.add(|_| lens::FocusBreathing);
        register.add(|_| pixel::DepthRegistration);
        register.add(|_| depth::Projective);
        register.add(depth::ProjectorDistortion::with_options);
        register.add(depth::DisparityRipple::with_options);
        register.add(|_| depth::RangeOffset);
        register.add(|_| depth::QuadraticDepth);
        register.add(depth::CyclicDepth::with_options);
        register.add(|_| depth::RadialRange);
        register.add(|_| depth::IncidenceBias);
        register.add(depth::ReflectivityBias::with_options);
        register.add(|_| depth::SignalMixing);
        register.add(depth::TemporalDrift::with_options);
        register.add(depth::TemperatureDrift::with_options);
        register.add_field(depth::FreeMap::field);
        register.add_field(depth::Bspline::field);
        register.add_field(depth::Multiplier::field);
        register.add_field(depth::DisparityDecay::field);
        register.add_field(depth::PolynomialMap::field);
        register
    }

    /// Adds a piece; `make` is given the constants that a file or the command line sets. A piece of the same name is
    /// replaced.
    pub fn add<H: Hook, const P: usize, M: Piece<H, P>>(
        &mut self,
        make: impl Fn(&Options) -> M + Send + Sync + 'static,
    ) {
        self.entries.retain(|(name, ..)| *name != M::NAME);
        self.entries.push((M::NAME, H::KIND, Arc::new(move |options: &Options| erase::<H, P, M>(make(options)))));
    }

    /// Adds a piece of depth whose parameters are fields over the image, as [`Register::add`] does.
    pub fn add_field<const P: usize, M: Piece<Depth, P>>(
        &mut self,
        make: impl Fn(&Options) -> Field<M, P> + Send + Sync + 'static,
    ) {
        self.entries.retain(|(name, ..)| *name != M::NAME);
        let make: Make = Arc::new(move |options: &Options| Arc::new(make(options)));
        self.entries.push((M::NAME, HookKind::Depth, make));
    }

    /// The register without the piece of that name: to ask what a search does when it does not know an effect.
    pub fn without(mut self, name: &str) -> Self {
        self.entries.retain(|(n, ..)| *n != name);
        self
    }

    /// All names, in the order of registration.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.entries.iter().map(|(name, ..)| *name)
    }

    /// Names of the pieces at a hook.
    pub fn names_at(&self, hook: HookKind) -> impl Iterator<Item = &'static str> {
        self.entries.iter().filter(move |(_, h, _)| *h == hook).map(|(name, ..)| *name)
    }

    /// The piece of that name.
    ///
    /// # Errors
    ///
    /// [`RegisterError::UnknownPiece`].
    pub fn piece(&self, name: &str, options: &Options) -> Result<Arc<dyn AnyPiece>, RegisterError> {
        let entry = self.entries.iter().find(|(n, ..)| *n == name);
        let unknown =
            || RegisterError::UnknownPiece { name: name.to_owned(), known: self.names().map(str::to_owned).collect() };
        entry.map(|(_, _, make)| make(options)).ok_or_else(unknown)
    }

    /// A stack of depth pieces from its name: `none`, `projective`, `projective:xw` (only these parameters free),
    /// `projective+bspline`, … Maps of offsets in ρ get `projective:zw` where the stack says nothing of D: a scale and an
    /// offset of ρ belong to the camera that they correct (c1 and c0 in eq. 5 of Herrera, Kannala, Heikkilä 2012).
    /// `none+disparity_decay` is the map and nothing else.
    ///
    /// # Errors
    ///
    /// [`RegisterError`], where a name or a subset is unknown.
    pub fn depth_model(&self, name: &str) -> Result<Vec<Block>, RegisterError> {
        let parts: Vec<&str> = name.split('+').map(str::trim).collect();
        let names = |part: &&str, piece: &str| part.split([':', '@']).next() == Some(piece);
        let is_offset = parts.iter().any(|p| OFFSET_MAPS.iter().any(|map| names(p, map)));
        let is_alone = !parts.iter().any(|p| names(p, "projective") || *p == "none");
        let own = (is_offset && is_alone).then_some("projective:zw");
        let pieces = own.into_iter().chain(parts.into_iter().filter(|p| *p != "none"));
        pieces.map(|part| self.block(part, Some(HookKind::Depth))).collect()
    }

    /// One block from `NAME`, `NAME:SUBSET` (only these parameters free) or `NAME@CONSTANT=VALUE` (a constant of the
    /// piece, several with further `@`); where `hook` is given the piece must act there.
    ///
    /// # Errors
    ///
    /// [`RegisterError`].
    pub fn block(&self, name: &str, hook: Option<HookKind>) -> Result<Block, RegisterError> {
        let mut parts = name.split('@');
        let name = parts.next().unwrap_or_default();
        let (name, subset) = name.split_once(':').map_or((name, None), |(n, s)| (n, Some(s)));
        let known = self.piece(name, &Options::new())?.options();
        let mut options = Options::new();
        for part in parts {
            let constant = part.split_once('=').and_then(|(k, v)| Some((k.trim(), v.trim().parse::<f64>().ok()?)));
            match constant.filter(|(key, value)| known.contains_key(*key) && !value.is_nan()) {
                Some((key, value)) => _ = options.insert(key.to_owned(), value),
                None => {
                    let (name, known) = (name.to_owned(), known.into_keys().collect());
                    return Err(RegisterError::UnknownConstant { name, given: part.to_owned(), known });
                }
            }
        }
        let mut block = Block::new(self.piece(name, &options)?);
        let taken = block.piece().map(|p| p.options()).unwrap_or_default();
        if let Some((key, value)) = options.iter().find(|(key, value)| taken.get(*key) != Some(value)) {
            let nearest = taken.get(key).copied().unwrap_or(f64::NAN);
            return Err(RegisterError::OutOfRange {
                name: name.to_owned(),
                key: key.clone(),
                value: value.to_string(),
                nearest: nearest.to_string(),
            });
        }
        if let Some(expected) = hook.filter(|h| *h != block.hook()) {
            let found = block.hook().name();
            return Err(RegisterError::WrongHook { name: name.to_owned(), found, expected: expected.name() });
        }
        if let Some(subset) = subset {
            let free: Vec<bool> =
                block.parameters().iter().map(|p| subset.chars().any(|c| p.name.ends_with(c))).collect();
            let unknown = subset.chars().find(|c| !block.parameters().iter().any(|p| p.name.ends_with(*c)));
            if let Some(letter) = unknown {
                let parameters = block.parameters().iter().map(|p| p.name.to_string()).collect();
                return Err(RegisterError::UnknownParameter { name: name.to_owned(), letter, parameters });
            }
            block.free = free;
        }
        Ok(block)
    }
}

impl Default for Register {
    fn default() -> Self {
        Self::builtin()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_subsets_and_constants() {
        let register = Register::builtin();
        let d = register.block("projective:xw", None).unwrap();
        assert_eq!(d.free, [true, false, false, true]);
        assert_eq!(register.depth_model("none").unwrap().len(), 0);
        let stack = register.depth_model("projective+cyclic_depth@period_mm=250").unwrap();
        assert_eq!(stack[1].piece().unwrap().options()["period_mm"], 250.0);
    }

    #[test]
    fn maps_of_offsets_get_scale_and_offset_unless_the_stack_says_otherwise() {
        let register = Register::builtin();
        let names = |model: &str| -> Vec<String> {
            register.depth_model(model).unwrap().iter().map(|b| b.name().to_owned()).collect()
        };
        let stack = register.depth_model("disparity_decay@columns=10").unwrap();
        assert_eq!(stack[0].free, [false, false, true, true]);
        assert_eq!(stack[1].piece().unwrap().options()["columns"], 10.0);
        assert_eq!(names("free_map"), ["projective", "free_map"]);
        assert_eq!(names("projective:xw+disparity_decay"), ["projective", "disparity_decay"]);
        assert_eq!(names("none+disparity_decay"), ["disparity_decay"]);
        assert_eq!(names("bspline"), ["bspline"]);
    }

    #[test]
    fn what_is_unknown_is_refused_with_what_is_known() {
        let register = Register::builtin();
        let message = |name: &str| register.depth_model(name).unwrap_err().to_string();
        assert!(message("projectiv").contains("projective"), "{}", message("projectiv"));
        assert!(message("projective:q").contains("dx, dy, dz, dw"), "{}", message("projective:q"));
        assert!(message("cyclic_depth@period=3").contains("period_mm"), "{}", message("cyclic_depth@period=3"));
        assert!(message("cyclic_depth@period_mm=x").contains("period_mm"));
        assert!(message("board_bow").contains("acts on the board"), "{}", message("board_bow"));
    }
}
