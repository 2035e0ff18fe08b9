//! Result files that are read again: calibrations and all others.

use std::path::Path;

use depthcal_calibration::camera_record::camera_from_record;
use depthcal_io::{
    Calibration, CameraFormat, Comparison, Diagnosis, Evaluation, ExportCamera, FileError, Fleet, Observations, Prior,
    Scores,
};
use depthcal_model::Register;

use super::memory_folder;

/// Reads a calibration, writes it and reads it again; makes the camera of it, and exports it.
pub fn calibration(bytes: &[u8]) {
    let path = memory_folder::file("calibration.json", bytes);
    let Ok(calibration) = Calibration::read(&path) else { return };
    let written = memory_folder::path("written.json");
    calibration.write(&written).expect("a calibration that was read is written");
    assert_eq!(calibration, Calibration::read(&written).expect("a calibration that was written is read"));
    let Ok(camera) = camera_from_record(&calibration.camera, &Register::builtin()) else { return };
    // COLMAP's file is the shortest.
    let _ = ExportCamera::new(&camera, &calibration).export(CameraFormat::Colmap);
}

/// Reads the bytes as every other record, and writes and reads again what is one.
#[allow(clippy::redundant_closure, reason = "readers are generic over the path, closures are not")]
pub fn records(bytes: &[u8]) {
    let path = memory_folder::file("record.json", bytes);
    again(&path, |p| Comparison::read(p), |record, p| record.write(p));
    again(&path, |p| Evaluation::read(p), |record, p| record.write(p));
    again(&path, |p| Fleet::read(p), |record, p| record.write(p));
    again(&path, |p| Observations::read(p), |record, p| record.write(p));
    again(&path, |p| Prior::read(p), |record, p| record.write(p));
    again(&path, |p| Diagnosis::read(p), |record, p| record.write(p));
    again(&path, |p| Scores::read(p), |record, p| record.write(p));
}

fn again<T: PartialEq + std::fmt::Debug>(
    path: &Path,
    read: impl Fn(&Path) -> Result<T, FileError>,
    write: impl Fn(&T, &Path) -> Result<(), FileError>,
) {
    let Ok(record) = read(path) else { return };
    let written = memory_folder::path("written.json");
    write(&record, &written).expect("a record that was read is written");
    assert_eq!(record, read(&written).expect("a record that was written is read"));
}
