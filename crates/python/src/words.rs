//! Messages in the words of those who gave folders, or arrays.

use depthcal_calibration::load::Loaded;
use depthcal_io::DATASET_FILE;

use crate::failure::Failure;

/// Names in the library's messages, which are those of `dataset.toml`, and those of arguments; longer ones come first.
const OF_ARRAYS: [(&str, &str); 6] = [
    ("[board] in dataset.toml", "the Board"),
    ("[camera] in dataset.toml", "the intrinsics"),
    ("depth.unit_mm", "unit_mm"),
    ("board.spacing_mm", "the Board's spacing_mm"),
    ("in dataset.toml", "in the arguments"),
    ("dataset.toml", "the arguments"),
];

/// How a caller gave a dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Words {
    /// As a folder with a `dataset.toml`.
    Files,
    /// As arrays.
    Arrays,
}

impl Words {
    /// The words for a dataset: of arrays where no file declares it.
    pub fn for_dataset(loaded: &Loaded) -> Self {
        let is_file = |root: &std::path::Path| root.join(DATASET_FILE).is_file() || root.is_file();
        match loaded.cameras.iter().any(|camera| is_file(&camera.declared.root)) {
            true => Self::Files,
            false => Self::Arrays,
        }
    }

    /// A message in these words.
    pub fn of(self, message: String) -> String {
        match self {
            Self::Files => message,
            Self::Arrays => OF_ARRAYS.iter().fold(message, |text, (file, argument)| text.replace(file, argument)),
        }
    }

    /// A failure in these words.
    pub fn of_failure(self, failure: Failure) -> Failure {
        match failure {
            Failure::Input(text) => Failure::Input(self.of(text)),
            Failure::Untrusted(text) => Failure::Untrusted(self.of(text)),
            python @ Failure::Python(_) => python,
        }
    }
}
