use std::path::PathBuf;

use clap::Args;

use super::common::{Failure, Reading, input};

/// Finds the board in every image of a dataset and caches what was found.
#[derive(Debug, Args)]
pub(super) struct Detect {
    /// Folder with a dataset.toml.
    dataset: PathBuf,
    /// Folder that receives observations.json.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

impl Detect {
    pub(super) fn run(&self) -> Result<(), Failure> {
        let loaded = self.reading.load(&self.dataset)?;
        let markers: usize = loaded.capture.frames.iter().map(|f| f.markers.len()).sum();
        println!("{markers} markers");
        if let Some(out) = &self.out {
            loaded.observations().write(out.join("observations.json")).map_err(input)?;
        }
        Ok(())
    }
}
