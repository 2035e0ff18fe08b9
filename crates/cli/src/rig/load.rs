//! Reading a dataset of several cameras.

use std::path::Path;

use depthcal_calibration::load::{LoadedRig, load_rig};
use depthcal_report::format::count;

use crate::common::{Reading, print_pairing};
use crate::failure::{Failure, input};
use crate::progress::Progress;
use crate::session::Session;
use crate::voice::say;

/// Reads a dataset and prints in how many frames each camera found the board.
pub(crate) fn load(path: &Path, reading: &Reading, session: &Session) -> Result<LoadedRig, Failure> {
    let busy = Progress::busy("reading");
    let rig = load_rig(path, &reading.options(session)).map_err(input)?;
    drop(busy);
    say!("{}: {}", rig.dataset.name, count(rig.cameras.len(), "camera"));
    for (camera, loaded) in rig.capture.cameras.iter().zip(&rig.cameras) {
        let strays = loaded.dataset.strays.len();
        let (found, dropped) = (loaded.capture.frames.len(), loaded.capture.dropped.len() - strays);
        if camera.has_markers() {
            let cached = if loaded.from_cache { " (cached)" } else { "" };
            say!("  {}: the board was found in {found} of {}{cached}", camera.name, count(found + dropped, "frame"));
        } else {
            say!("  {}: {} of depth without images", camera.name, count(found, "frame"));
        }
        print_pairing(&loaded.dataset);
        for frame in &loaded.capture.dropped {
            say!("    not used: {} ({})", frame.name, frame.reason);
        }
        if let Some(measured) = loaded.circle_diameter.filter(|m| m.declared_mm.is_none()) {
            say!("    {measured}");
        }
    }
    Ok(rig)
}
