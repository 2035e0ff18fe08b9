//! The lens models that can be asked for by name.

use depthcal_model::hook::HookKind;
use depthcal_model::{Block, Register, RegisterError, Role};

/// A lens model: a piece, and how many of its parameters are fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LensModel {
    /// Name on the command line and in files.
    pub name: &'static str,
    /// The piece; `None` for a camera without lens.
    piece: Option<&'static str>,
    /// Its first so many parameters are fitted, the others held at zero.
    pub parameters: usize,
}

/// The lens models that depthcal has, the simplest first.
pub const LENS_MODELS: [LensModel; 7] = [
    LensModel { name: "none", piece: None, parameters: 0 },
    LensModel { name: "division", piece: Some("division"), parameters: 1 },
    LensModel { name: "kannala-brandt", piece: Some(KANNALA_BRANDT), parameters: 4 },
    LensModel { name: "brown-conrady", piece: Some("brown_conrady"), parameters: 5 },
    LensModel { name: "opencv8", piece: Some(OPENCV), parameters: 8 },
    LensModel { name: "opencv12", piece: Some(OPENCV), parameters: 12 },
    LensModel { name: "opencv14", piece: Some(OPENCV), parameters: 14 },
];

/// The lens models of a register, the simplest first: [`LENS_MODELS`], and the lenses that a program has added.
pub fn lens_models(register: &Register) -> Vec<LensModel> {
    let known = Register::builtin();
    let added = register.names_at(HookKind::Lens).filter(|name| known.find(name).is_none());
    let added = added.filter_map(|name| {
        let piece = register.find(name).filter(|piece| piece.role() == Role::Model)?;
        Some(LensModel { name, piece: Some(name), parameters: piece.parameters().len() })
    });
    let mut models: Vec<LensModel> = LENS_MODELS.into_iter().chain(added).collect();
    models.sort_by_key(|model| model.parameters);
    models
}

/// Name of the piece of fisheye lenses, which at nominal parameters is the equidistant projection.
pub(crate) const KANNALA_BRANDT: &str = "kannala_brandt";
const OPENCV: &str = "opencv_lens";

/// The block of a lens model at its nominal values, by a name of [`LENS_MODELS`] or of a registered piece, with `-` or `_`;
/// `None` for `none`.
///
/// # Errors
///
/// [`RegisterError`] where neither a lens model nor a piece of lenses has this name.
pub fn lens_block(name: &str, register: &Register) -> Result<Option<Block>, RegisterError> {
    let named = LENS_MODELS.iter().find(|model| model.name.replace('-', "_") == name.replace('-', "_"));
    let Some(model) = named else {
        return register.block(name, Some(HookKind::Lens)).map(Some);
    };
    let Some(piece) = model.piece else { return Ok(None) };
    let mut block = register.block(piece, None)?;
    block.free.iter_mut().skip(model.parameters).for_each(|free| *free = false);
    Ok(Some(block))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lens_models_are_blocks_with_their_parameters_free() {
        let register = Register::builtin();
        for model in LENS_MODELS {
            let block = lens_block(model.name, &register).unwrap();
            let free = block.map_or(0, |b| b.free.iter().filter(|f| **f).count());
            assert_eq!(free, model.parameters, "{}", model.name);
        }
        assert_eq!(lens_block("opencv_lens", &register).unwrap().unwrap().free, [true; 14]);
        assert!(lens_block("opencv9", &register).unwrap_err().to_string().contains("kannala_brandt"));
    }
}
