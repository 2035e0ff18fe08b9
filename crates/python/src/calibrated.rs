//! Calibrations: cameras with their uncertainty, from fits or files.

use std::path::PathBuf;
use std::sync::Arc;

use depthcal_calibration::camera_record::camera_from_record;
use depthcal_io::{Calibration as Record, CameraFormat, CameraRecord, ExportCamera, ExtrinsicsRecord};
use depthcal_model::{Camera, Register};
use nalgebra::Vector3;
use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::arrays::numbers;
use crate::effect::Effect;
use crate::failure::{Failure, input};
use crate::request::{json, register_with};
use crate::running::run;

/// A calibrated camera.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Calibration {
    pub record: Arc<Record>,
    pub camera: Arc<Camera>,
    pub register: Register,
}

impl Calibration {
    pub fn new(record: Record, camera: Camera, register: Register) -> Self {
        Self { record: Arc::new(record), camera: Arc::new(camera), register }
    }

    /// A calibration from its record: of one camera, or of a rig, whose camera is then the reference.
    pub fn of_record(record: Record, register: Register) -> Result<Self, Failure> {
        let camera = camera_from_record(&record.camera, &register).map_err(input)?;
        Ok(Self::new(record, camera, register))
    }

    /// Says that a rig has no camera of this name, and which it has.
    pub fn no_camera(&self, name: &str) -> Failure {
        let known = self.cameras().join(", ");
        let known = if known.is_empty() { "none: it is of one camera" } else { &known };
        input(format!("the calibration has no camera '{name}'; it has {known}"))
    }
}

/// Rows (n, k) of an array.
fn rows<const K: usize>(what: &str, given: &Bound<'_, PyAny>) -> Result<Vec<[f64; K]>, Failure> {
    let values = numbers(what, given)?;
    match values.shape() {
        [_, columns] if *columns == K => Ok(values.slice()?.as_chunks::<K>().0.to_vec()),
        shape => Err(input(format!("{what} have the shape {shape:?}: give an array (n, {K})"))),
    }
}

#[pymethods]
impl Calibration {
    /// Reads a `calibration.json`; `effects` are those of Python that it names.
    #[staticmethod]
    fn read(path: PathBuf, effects: Vec<PyRef<'_, Effect>>) -> PyResult<Self> {
        let register = register_with(&effects)?;
        let record = Record::read(&path).map_err(input)?;
        let camera = camera_from_record(&record.camera, &register)
            .map_err(|error| input(format!("{}: {error}", path.display())))?;
        Ok(Self::new(record, camera, register))
    }

    /// A calibration from the JSON of its record, as [`Calibration::json`] gives it.
    #[staticmethod]
    fn parse(text: &str, effects: Vec<PyRef<'_, Effect>>) -> PyResult<Self> {
        let register = register_with(&effects)?;
        let record: Record = serde_json::from_str(text).map_err(|e| input(format!("calibration: {e}")))?;
        Ok(Self::of_record(record, register)?)
    }

    /// Names of the cameras of a rig, the reference first; none of one camera.
    fn cameras(&self) -> Vec<String> {
        let cameras = self.record.cameras().filter(|_| !self.record.is_short());
        cameras.map(|camera| camera.name.clone()).collect()
    }

    /// One camera of a rig as a calibration of its own, without what it has in common with the others: covariance, poses.
    fn camera(&self, name: &str) -> PyResult<Self> {
        let camera = self.record.cameras().find(|camera| camera.name == name && !self.record.is_short());
        let camera = camera.ok_or_else(|| self.no_camera(name))?;
        let (name, extrinsics) = (depthcal_io::CAMERA.to_owned(), ExtrinsicsRecord::REFERENCE);
        let camera = CameraRecord { name, camera_from_rig: extrinsics, ..camera.clone() };
        let (covariance, frames, others) = (None, Vec::new(), Vec::new());
        let record = Record { camera, covariance, frames, others, ..(*self.record).clone() };
        Ok(Self::of_record(record, self.register.clone())?)
    }

    /// Writes a `calibration.json`.
    fn write(&self, path: PathBuf) -> PyResult<()> {
        Ok(self.record.write(path).map_err(input)?)
    }

    /// The record as JSON.
    fn json(&self) -> PyResult<String> {
        json(&*self.record)
    }

    /// The text of a camera file of another program, and warnings of what it cannot hold.
    fn export(&self, py: Python<'_>, format: &str) -> PyResult<(String, Vec<String>)> {
        let format: CameraFormat = format.parse().map_err(input)?;
        let export = run(py, None, |_| ExportCamera::new(&self.camera, &self.record).export(format).map_err(input))?;
        Ok((export.text, export.warnings.iter().map(ToString::to_string).collect()))
    }

    /// Names of the formats that `export` writes.
    #[staticmethod]
    fn formats() -> Vec<&'static str> {
        CameraFormat::ALL.map(CameraFormat::name).to_vec()
    }

    /// Width and height, px.
    #[getter]
    fn size(&self) -> (usize, usize) {
        (self.camera.width, self.camera.height)
    }

    /// Pixels (n, 2) of points (n, 3) in mm; NaN where a point has none.
    fn project<'py>(&self, py: Python<'py>, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = rows::<3>("points", points)?;
        let camera = &self.camera;
        let pixels: Vec<f64> = py.detach(|| {
            let pixel = |p: &[f64; 3]| camera.project(&Vector3::from(*p)).unwrap_or([f64::NAN; 2]);
            points.iter().flat_map(pixel).collect()
        });
        pixels.into_pyarray(py).reshape([points.len(), 2])
    }

    /// Rays (X/Z, Y/Z) (n, 2) of pixels (n, 2) at a depth; NaN where a pixel has none.
    fn rays<'py>(
        &self,
        py: Python<'py>,
        pixels: &Bound<'py, PyAny>,
        depth_mm: f64,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let pixels = rows::<2>("pixels", pixels)?;
        let camera = &self.camera;
        let rays: Vec<f64> = py.detach(|| {
            let ray = |p: &[f64; 2]| camera.ray(*p, 1.0 / depth_mm).unwrap_or([f64::NAN; 2]);
            pixels.iter().flat_map(ray).collect()
        });
        rays.into_pyarray(py).reshape([pixels.len(), 2])
    }
}
