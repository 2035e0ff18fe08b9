//! The lens models that can be asked for by name.

use depthcal_model::{Block, Register, RegisterError};

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

/// All lens models, the simplest first.
pub const LENS_MODELS: [LensModel; 7] = [
    LensModel { name: "none", piece: None, parameters: 0 },
    LensModel { name: "division", piece: Some("division"), parameters: 1 },
    LensModel { name: "kannala-brandt", piece: Some(KANNALA_BRANDT), parameters: 4 },
    LensModel { name: "brown-conrady", piece: Some("brown_conrady"), parameters: 5 },
    LensModel { name: "opencv8", piece: Some(OPENCV), parameters: 8 },
    LensModel { name: "opencv12", piece: Some(OPENCV), parameters: 12 },
    LensModel { name: "opencv14", piece: Some(OPENCV), parameters: 14 },
];

/// Name of the piece of fisheye lenses, which at nominal parameters is the equidistant projection.
pub(crate) const KANNALA_BRANDT: &str = "kannala_brandt";
const OPENCV: &str = "opencv_lens";

/// The block of a lens model at its nominal values, by a name of [`LENS_MODELS`] or of a registered piece, with `-` or `_`;
/// `None` for `none`.
///
/// # Errors
///
/// [`RegisterError`] where neither a lens model nor a piece has this name.
pub fn lens_block(name: &str, register: &Register) -> Result<Option<Block>, RegisterError> {
    let named = LENS_MODELS.iter().find(|model| model.name.replace('-', "_") == name.replace('-', "_"));
    let Some(model) = named else { return register.block(name, None).map(Some) };
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
