//! `--rrd`: a recording for the rerun viewer, where depthcal was built with it.

use std::path::PathBuf;

use clap::Args;
use depthcal_model::Camera;

use super::failure::Failure;
use depthcal_calibration::judge::camera::EvaluatedCamera;
use depthcal_calibration::observe::CameraFrames;

/// The file of a recording.
#[derive(Debug, Args)]
pub(super) struct Recording {
    /// Writes a recording for the rerun viewer: boards, camera, images, depth, and point clouds before and after correction,
    /// frame by frame. Requires a depthcal that was built with `--features rerun`.
    #[arg(long, value_name = "FILE")]
    rrd: Option<PathBuf>,
}

impl Recording {
    /// Refuses --rrd where this depthcal cannot write it, before any work is done.
    pub(super) fn check(&self) -> Result<(), Failure> {
        match &self.rrd {
            Some(path) if !cfg!(feature = "rerun") => Err(Failure::Input(format!(
                "--rrd {}: this depthcal was built without the feature 'rerun'; build one that has it with \
                 `cargo install --path . --features rerun`, or leave --rrd out",
                path.display()
            ))),
            _ => Ok(()),
        }
    }

    /// Refuses --rrd for a dataset of several cameras, before any work is done.
    pub(super) fn refuse_for_rig(&self) -> Result<(), Failure> {
        match &self.rrd {
            Some(path) => Err(Failure::Input(format!(
                "--rrd {}: a recording shows one camera, and this dataset has several: leave --rrd out (report.html shows the rig in 3D), \
                 or declare one of its cameras as a dataset of its own",
                path.display()
            ))),
            None => Ok(()),
        }
    }

    /// Writes the recording if one was asked for; returns its path.
    #[cfg(feature = "rerun")]
    pub(super) fn write(
        &self,
        camera: &Camera,
        captures: &[(&CameraFrames, &EvaluatedCamera)],
    ) -> Result<Option<PathBuf>, Failure> {
        let Some(path) = &self.rrd else { return Ok(None) };
        let busy = crate::progress::Progress::busy("recording");
        let captures: Vec<depthcal_report::rerun::RecordedCapture<'_>> = captures
            .iter()
            .map(|(capture, evaluated)| depthcal_report::rerun::RecordedCapture { capture, evaluated })
            .collect();
        depthcal_report::rerun::write(path, camera, &captures).map_err(super::failure::input)?;
        drop(busy);
        super::voice::say!("written: {} (open it with `rerun {0}`)", path.display());
        Ok(Some(path.clone()))
    }

    /// Without the feature, [`Recording::check`] has refused every --rrd already.
    #[cfg(not(feature = "rerun"))]
    pub(super) fn write(
        &self,
        _: &Camera,
        _: &[(&CameraFrames, &EvaluatedCamera)],
    ) -> Result<Option<PathBuf>, Failure> {
        Ok(None)
    }
}
