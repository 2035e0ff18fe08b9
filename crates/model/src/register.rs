//! The register of pieces: names to pieces, for files and the command line.
//!
//! depthcal's own pieces are listed in the `mod.rs` of their folder, one line each, by the macro `pieces`.

use std::sync::Arc;

use thiserror::Error;

use crate::block::Block;
use crate::field::Field;
use crate::hook::{Depth, Hook, HookKind};
pub use crate::piece::Options;
use crate::piece::{AnyPiece, BoardSide, Piece, Placement, erase, placed};
use crate::spec::{FreeSubset, ModelSpec, PieceSpec, SpecError};
use crate::suggestion::did_you_mean;
use crate::target::Target;

type Make = Arc<dyn Fn(&Options) -> Arc<dyn AnyPiece> + Send + Sync>;

/// Why a model could not be made from its name.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RegisterError {
    /// No piece has this name.
    #[error("there is no piece named '{name}'{}; known are {}", did_you_mean(name, known), known.join(", "))]
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
        "'{given}' is no constant of '{name}'{}: write {name}@CONSTANT=NUMBER with one of its constants: {}",
        did_you_mean(given.split('=').next().unwrap_or_default(), known),
        if known.is_empty() { "it has none".to_owned() } else { known.join(", ") }
    )]
    UnknownConstant {
        /// The piece.
        name: String,
        /// The text or value given.
        given: String,
        /// Its constants.
        known: Vec<String>,
    },
    /// A constant outside the range of the piece.
    #[error("{name}@{key}={value} is out of range; the nearest that '{name}' can do is {nearest}")]
    OutOfRange {
        /// The piece.
        name: String,
        /// The constant.
        key: String,
        /// The text or value given.
        value: String,
        /// The nearest value in its range.
        nearest: String,
    },
    /// A place or a form that does not exist: [`SpecError::BadPlacement`].
    #[error(transparent)]
    BadPlacement(SpecError),
    /// A place or a form for a piece that has none.
    #[error("'{name}' takes no @of= and no @on=: only effects that act on depth do")]
    NoPlacement {
        /// The piece.
        name: String,
    },
    /// A subset names a parameter that the piece does not have.
    #[error("'{name}' has no parameter '{letter}'; a subset is written with the last letters of {}", parameters.join(", "))]
    UnknownParameter {
        /// The piece.
        name: String,
        /// The letter given.
        letter: char,
        /// Its parameters.
        parameters: Vec<String>,
    },
}

/// The pieces that are known, by name. [`Register::builtin`] has depthcal's own; [`Register::add`] takes others.
#[derive(Clone)]
pub struct Register {
    entries: Vec<(&'static str, HookKind, Make)>,
    /// Width and height of the board's markers, mm, where it is known.
    board_mm: Option<[f64; 2]>,
}

impl std::fmt::Debug for Register {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.names()).finish()
    }
}

impl Register {
    /// A register without pieces.
    pub fn empty() -> Self {
        Self { entries: Vec::new(), board_mm: None }
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

    /// Adds pieces of that name whose hook and parameters are known at run time only, such as formulas; `make` is given the
    /// constants that a file or the command line sets. A piece of the same name is replaced.
    pub fn add_any(
        &mut self,
        name: &'static str,
        hook: HookKind,
        make: impl Fn(&Options) -> Arc<dyn AnyPiece> + Send + Sync + 'static,
    ) {
        self.entries.retain(|(n, ..)| *n != name);
        self.entries.push((name, hook, Arc::new(make)));
    }

    /// The register without the piece of that name, for instance to see what a search finds when it lacks an effect.
    pub fn without(mut self, name: &str) -> Self {
        self.entries.retain(|(n, ..)| *n != name);
        self
    }

    /// The register for captures of one board: constants of pieces that are a side of its rectangle of markers have the board's
    /// values where none are given.
    pub fn for_board(mut self, target: &Target) -> Self {
        self.board_mm = Some(target.size_mm());
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
        let (_, _, make) = entry.ok_or_else(unknown)?;
        let piece = make(options);
        let Some([width, height]) = self.board_mm else { return Ok(piece) };
        let constants = piece.constants();
        let of_board = constants.iter().filter(|c| !options.contains_key(c.name)).filter_map(|c| {
            let size = match c.of_board? {
                BoardSide::Width => width,
                BoardSide::Height => height,
            };
            Some((c.name.to_owned(), size))
        });
        let of_board: Options = of_board.collect();
        if of_board.is_empty() {
            return Ok(piece);
        }
        Ok(make(&options.iter().map(|(k, v)| (k.clone(), *v)).chain(of_board).collect()))
    }

    /// The piece of that name in a place and a form.
    ///
    /// # Errors
    ///
    /// [`RegisterError::UnknownPiece`], [`RegisterError::NoPlacement`].
    pub fn placed_piece(
        &self,
        name: &str,
        options: &Options,
        placement: Placement,
    ) -> Result<Arc<dyn AnyPiece>, RegisterError> {
        placed(self.piece(name, options)?, placement)
            .ok_or_else(|| RegisterError::NoPlacement { name: name.to_owned() })
    }

    /// The specification of a depth model from text, all of whose names, subsets and constants this register has.
    ///
    /// # Errors
    ///
    /// [`RegisterError`], where a name, a subset or a constant is unknown.
    pub fn model_spec(&self, text: &str) -> Result<ModelSpec, RegisterError> {
        let spec = text.parse().map_err(|error| self.refuse(error))?;
        self.depth_blocks(&spec)?;
        Ok(spec)
    }

    /// The specification of a piece from text, whose name, subset and constants this register has.
    ///
    /// # Errors
    ///
    /// [`RegisterError`].
    pub fn piece_spec(&self, text: &str) -> Result<PieceSpec, RegisterError> {
        let spec = text.parse().map_err(|error| self.refuse(error))?;
        self.make(&spec, None)?;
        Ok(spec)
    }

    /// A stack of depth pieces from text, see [`ModelSpec`] and [`Register::depth_blocks`].
    ///
    /// # Errors
    ///
    /// [`RegisterError`], where a name, a subset or a constant is unknown.
    pub fn depth_model(&self, text: &str) -> Result<Vec<Block>, RegisterError> {
        self.depth_blocks(&text.parse().map_err(|error| self.refuse(error))?)
    }

    /// The blocks of a depth model, in order. Where it has a map of offsets ([`AnyPiece::is_offset_map`]) and says nothing of
    /// D, `projective:zw` comes first: a scale and an offset of ρ belong to the camera that such maps correct (c1 and c0 in
    /// eq. 5 of Herrera, Kannala, Heikkilä 2012). `none+disparity_decay` is the map and nothing else.
    ///
    /// # Errors
    ///
    /// [`RegisterError`], where a name, a subset or a constant is unknown.
    pub fn depth_blocks(&self, model: &ModelSpec) -> Result<Vec<Block>, RegisterError> {
        let is_offset_map = |spec: &PieceSpec| self.find(&spec.name).is_some_and(|piece| piece.is_offset_map());
        let is_alone = !model.bare && !model.has("projective");
        let d = PieceSpec { free: FreeSubset::Ending("zw".to_owned()), ..PieceSpec::new("projective") };
        let scale_and_offset = (is_alone && model.pieces.iter().any(is_offset_map)).then_some(&d);
        scale_and_offset.into_iter().chain(&model.pieces).map(|spec| self.make(spec, Some(HookKind::Depth))).collect()
    }

    /// One block from text, see [`PieceSpec`]; where `hook` is given the piece must act there.
    ///
    /// # Errors
    ///
    /// [`RegisterError`].
    pub fn block(&self, text: &str, hook: Option<HookKind>) -> Result<Block, RegisterError> {
        self.make(&text.parse().map_err(|error| self.refuse(error))?, hook)
    }

    /// The block of a specification, at nominal values; where `hook` is given the piece must act there.
    ///
    /// # Errors
    ///
    /// [`RegisterError`].
    pub fn make(&self, spec: &PieceSpec, hook: Option<HookKind>) -> Result<Block, RegisterError> {
        let name = || spec.name.clone();
        let known = self.piece(&spec.name, &Options::new())?.options();
        if let Some((key, value)) = spec.constants.iter().find(|(k, v)| !known.contains_key(*k) || v.is_nan()) {
            let given = format!("{key}={value}");
            return Err(RegisterError::UnknownConstant { name: name(), given, known: known.into_keys().collect() });
        }
        let mut block = Block::new(self.placed_piece(&spec.name, &spec.constants, spec.placement)?);
        let taken = block.piece().map(|p| p.options()).unwrap_or_default();
        if let Some((key, value)) = spec.constants.iter().find(|(key, value)| taken.get(*key) != Some(value)) {
            let nearest = taken.get(key).copied().unwrap_or(f64::NAN).to_string();
            return Err(RegisterError::OutOfRange {
                name: name(),
                key: key.clone(),
                value: value.to_string(),
                nearest,
            });
        }
        if let Some(expected) = hook.filter(|h| *h != block.hook()) {
            let hook = block.hook().name();
            return Err(RegisterError::WrongHook { name: name(), found: hook, expected: expected.name() });
        }
        block.free = spec.free.mask(block.parameters()).map_err(|letter| {
            let parameters = block.parameters().iter().map(|p| p.name.to_string()).collect();
            RegisterError::UnknownParameter { name: name(), letter, parameters }
        })?;
        Ok(block)
    }

    /// A specification for people: `cyclic_depth (period 300 mm)`.
    pub fn words(&self, spec: &PieceSpec) -> String {
        spec.words(self.find(&spec.name).as_deref())
    }

    /// A depth model for people: `projective + cyclic_depth (period 300 mm)`; `none` without pieces.
    pub fn model_words(&self, model: &ModelSpec) -> String {
        let words: Vec<String> = model.pieces.iter().map(|spec| self.words(spec)).collect();
        if words.is_empty() { "none".to_owned() } else { words.join(" + ") }
    }

    /// The piece of that name with default constants, for its description.
    pub fn find(&self, name: &str) -> Option<Arc<dyn AnyPiece>> {
        self.piece(name, &Options::new()).ok()
    }

    /// A parse error as the register's, which lists the known names.
    fn refuse(&self, error: SpecError) -> RegisterError {
        match error {
            SpecError::NoName { spec } => {
                RegisterError::UnknownPiece { name: spec, known: self.names().map(str::to_owned).collect() }
            }
            SpecError::BadPlacement { .. } => RegisterError::BadPlacement(error),
            SpecError::BadConstant { name, given } => match self.piece(&name, &Options::new()) {
                Err(unknown) => unknown,
                Ok(piece) => {
                    let known = piece.options().into_keys().collect();
                    RegisterError::UnknownConstant { name, given, known }
                }
            },
        }
    }
}

/// Declares the files of a folder of pieces and registers their pieces: `FILE: TYPE => ADD(MAKE)` for every file, with
/// [`Register::add`] or [`Register::add_field`] and the constructor from constants.
macro_rules! pieces {
    ($($file:ident: $piece:ident => $add:ident($make:expr),)*) => {
        $(mod $file; pub use $file::$piece;)*

        /// Adds the pieces of this folder to a register, in the order of their list.
        pub(crate) fn register(register: &mut crate::register::Register) {
            $(register.$add($make);)*
        }
    };
}
pub(crate) use pieces;
