//! Names in options: pieces with subsets and constants, models, lenses, and formats.

use depthcal_io::{CameraFormat, Paper};
use depthcal_model::{ModelSpec, PieceSpec, Register};

/// Parses the text as everything that an option may take; what is printed is parsed as the same.
pub fn spec(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let register = Register::builtin();
    if let Ok(spec) = text.parse::<PieceSpec>() {
        assert_eq!(spec.to_string().parse::<PieceSpec>().as_ref(), Ok(&spec));
        let _ = register.make(&spec, None);
        let _ = register.words(&spec);
    }
    if let Ok(spec) = text.parse::<ModelSpec>() {
        assert_eq!(spec.to_string().parse::<ModelSpec>().as_ref(), Ok(&spec));
        let _ = register.depth_blocks(&spec);
        let _ = register.model_words(&spec);
    }
    let _ = text.parse::<CameraFormat>();
    let _ = text.parse::<Paper>();
}
