//! Calibrations: cameras with their uncertainty, from fits or files.

use std::path::PathBuf;
use std::sync::Arc;

use depthcal_calibration::camera_record::{camera_from_record, piece_records};
use depthcal_calibration::task::GivenCamera;
use depthcal_io::{
    CAMERA, Calibration as Record, CameraFormat, CameraRecord, CovarianceRecord, ExportCamera, ExtrinsicsRecord,
    FileLens, FileReference, FitRecord, FrameRecord, Intrinsics,
};
use depthcal_model::{Block, Camera, Pattern, Register, Target};
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

/// A camera of a rig as a record of its own.
fn alone(rig: &Record, camera: &CameraRecord) -> Record {
    let prefix = format!("{}/", camera.name);
    let covariance = rig.covariance.as_ref().map(|covariance| {
        // Extrinsics, their drift and the time offset are of the rig.
        let is_own = |name: &&str| name.split_once('.').is_some_and(|(piece, _)| camera.piece(piece).is_some());
        let in_camera = |parameter: &String| parameter.strip_prefix(&prefix).filter(is_own).map(str::to_owned);
        let named = covariance.parameters.iter().enumerate().filter_map(|(row, name)| Some((row, in_camera(name)?)));
        let (rows, parameters): (Vec<usize>, Vec<String>) = named.unzip();
        let row = |i: &usize| rows.iter().map(|j| covariance.matrix[*i][*j]).collect();
        CovarianceRecord { parameters, matrix: rows.iter().map(row).collect() }
    });
    let covariance = covariance.filter(|covariance| !covariance.parameters.is_empty());
    let camera_from_rig = camera.camera_from_rig.camera_from_rig();
    let frames = rig.frames.iter().map(|frame| {
        if camera.camera_from_rig == ExtrinsicsRecord::REFERENCE {
            return frame.clone();
        }
        let pose = camera_from_rig * frame.rig_from_board();
        let q = pose.rotation.quaternion();
        let translation_mm = pose.translation.vector.into();
        FrameRecord { rotation: [q.w, q.i, q.j, q.k], translation_mm, ..frame.clone() }
    });
    let camera =
        CameraRecord { name: CAMERA.to_owned(), camera_from_rig: ExtrinsicsRecord::REFERENCE, ..camera.clone() };
    let fit = FitRecord {
        reprojection_rms_px: camera.reprojection_rms_px.unwrap_or(rig.fit.reprojection_rms_px),
        depth_rms_mm: camera.depth_rms_mm,
        frames_used: camera.frames_used,
        ..rig.fit.clone()
    };
    Record { camera, covariance, frames: frames.collect(), others: Vec::new(), fit, ..rig.clone() }
}

/// The record of a camera that is known and was not fitted here: it has no frames, and no board that matters.
fn of_known(camera: &Camera, origin: String) -> Record {
    let pieces = piece_records(&camera.map_blocks(Block::hold), &vec![None; camera.theta().len()]);
    let given = "given, not fitted".to_owned();
    Record {
        camera: CameraRecord::unnamed([camera.width, camera.height], pieces),
        others: Vec::new(),
        covariance: None,
        fit: FitRecord {
            estimator: "given".to_owned(),
            model: "none".to_owned(),
            termination: given,
            ..FitRecord::default()
        },
        frames: Vec::new(),
        dataset: FileReference { path: origin, digest: String::new() },
        target: Target { pattern: Pattern::Chessboard, columns: 2, rows: 2, spacing_mm: 1.0 },
        observations: None,
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
    /// Reads a `calibration.json`, or a camera file of another program; `effects` are those of Python that it names, `size` is
    /// that of the images where the file has none.
    #[staticmethod]
    #[pyo3(signature = (path, effects, size))]
    fn read(path: PathBuf, effects: Vec<PyRef<'_, Effect>>, size: Option<[usize; 2]>) -> PyResult<Self> {
        let register = register_with(&effects)?;
        let path = if path.is_dir() { path.join("calibration.json") } else { path };
        let in_file = |error: &dyn std::fmt::Display| input(format!("{}: {error}", path.display()));
        match GivenCamera::read(&path).map_err(Failure::from)? {
            GivenCamera::Calibration(_, record) => {
                let camera = camera_from_record(&record.camera, &register).map_err(|error| in_file(&error))?;
                Ok(Self::new(*record, camera, register))
            }
            GivenCamera::Intrinsics(_, intrinsics) => {
                let size = match (intrinsics.size, size) {
                    (Some(of_file), Some(given)) if of_file != given => {
                        let [width, height] = of_file;
                        return Err(in_file(&format!("has images of {width}x{height} px: leave size out")).into());
                    }
                    (Some(size), _) | (None, Some(size)) => size,
                    (None, None) => {
                        let problem = "does not say how large the images are: give size=(width, height)";
                        return Err(in_file(&problem).into());
                    }
                };
                let camera = intrinsics.camera(size, &register).map_err(|error| in_file(&error))?;
                Ok(Self::new(of_known(&camera, path.display().to_string()), camera, register))
            }
        }
    }

    /// A camera with known numbers: fx, fy, cx, cy and skew (px), OpenCV's distortion coefficients or, with `is_fisheye`, the
    /// four of its fisheye lens.
    #[staticmethod]
    fn known(size: [usize; 2], pinhole: [f64; 5], distortion: Vec<f64>, is_fisheye: bool) -> PyResult<Self> {
        let lens = match (distortion.as_slice(), is_fisheye) {
            ([], _) => None,
            ([a, b, c, d], true) => Some(FileLens::fisheye([*a, *b, *c, *d])),
            (_, true) => {
                let given = distortion.len();
                return Err(
                    input(format!("distortion has {given} coefficients: a fisheye lens has 4, k1 to k4")).into()
                );
            }
            (all, false) => Some(FileLens::opencv(all).ok_or_else(|| {
                input(format!("distortion has {} coefficients: OpenCV's models have 4, 5, 8, 12 or 14", all.len()))
            })?),
        };
        let is_length = |value: f64| value > 0.0 && value.is_finite();
        if !(is_length(pinhole[0]) && is_length(pinhole[1]))
            || pinhole.iter().chain(&distortion).any(|v| !v.is_finite())
        {
            return Err(
                input("the matrix or the distortion has focal lengths that are not above 0, or no numbers").into()
            );
        }
        let register = Register::builtin();
        let intrinsics = Intrinsics { size: Some(size), pinhole, lens };
        let camera = intrinsics.camera(size, &register).map_err(input)?;
        Ok(Self::new(of_known(&camera, "known numbers".to_owned()), camera, register))
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

    /// One camera of a rig as a calibration of its own, with its part of the covariance and the poses that its frames have in it.
    fn camera(&self, name: &str) -> PyResult<Self> {
        let camera = self.record.cameras().find(|camera| camera.name == name && !self.record.is_short());
        let camera = camera.ok_or_else(|| self.no_camera(name))?;
        Ok(Self::of_record(alone(&self.record, camera), self.register.clone())?)
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
