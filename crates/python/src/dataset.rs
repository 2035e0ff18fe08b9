//! Datasets: folders, or arrays in memory.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_calibration::load::{
    DatasetInMemory, FrameInMemory, GivenMarkers, LoadOptions, Loaded, LoadedCamera, default_cache, load_from_memory,
    load_with_markers,
};
use depthcal_calibration::observe::{DetectedFrame, MarkerObservation, RawFrame};
use depthcal_io::{CameraHint, DepthFrame, DepthValues, FrameMetadata, IntrinsicNumbers};
use depthcal_model::{Register, Target};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::argument;
use crate::failure::{Failure, input};
use crate::images::{depth_frame, gray_image};
use crate::markers::{MarkerArrays, check_all, check_inside, count_without_numbers, markers_of};
use crate::pickled;
use crate::request::json;
use crate::running::{run, run_in};
use crate::words::Words;

/// A dataset of one camera or of several with its markers.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Dataset {
    pub loaded: Arc<Loaded>,
}

/// Reads the dataset in a folder. `markers` are those of another program by frame.
#[pyfunction]
#[pyo3(signature = (path, markers, cache, refresh, image_memory_mib, progress))]
pub(crate) fn load(
    py: Python<'_>,
    path: PathBuf,
    markers: Option<Vec<(String, MarkerArrays<'_>)>>,
    cache: bool,
    refresh: bool,
    image_memory_mib: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Dataset> {
    let given = markers;
    let markers: Option<GivenMarkers> = match &given {
        None => None,
        Some(list) => {
            let frames = list.iter().map(|(name, arrays)| Ok((name.clone(), markers_of(name, arrays)?)));
            Some(frames.collect::<Result<_, Failure>>()?)
        }
    };
    let counts = given.iter().flatten().map(|(name, arrays)| Ok((name.clone(), count_without_numbers(arrays)?)));
    let counts = counts.collect::<PyResult<Vec<_>>>()?;
    let loaded = run(py, progress.as_ref(), move |progress| {
        let options = LoadOptions {
            cache: if cache { default_cache() } else { None },
            refresh,
            markers: None,
            register: Register::builtin(),
            image_memory: image_memory_mib << 20,
            progress: progress.clone(),
        };
        match &markers {
            None => depthcal_calibration::load::load(&path, &options),
            Some(markers) => load_with_markers(&path, markers, &options),
        }
        .map_err(input)
    })?;
    if let ([camera], false) = (&loaded.cameras[..], counts.is_empty()) {
        let capture = &camera.capture;
        counts.iter().try_for_each(|(frame, count)| check_all(frame, *count, capture.target.len()))?;
        let size = (capture.width, capture.height);
        capture.frames.iter().try_for_each(|frame| check_inside(&frame.name, &frame.markers, size))?;
    }
    Ok(Dataset { loaded: Arc::new(loaded) })
}

/// A frame in memory: name, image, depth, markers, time in s, temperature in °C.
type FrameArrays<'py> =
    (String, Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>, MarkerArrays<'py>, Option<f64>, Option<f64>);

/// Focal lengths, centre, skew (px), distortion.
type Intrinsics = (f64, f64, f64, f64, f64, Vec<f64>);

/// A dataset from arrays. `camera` has the arguments `size`, `unit_mm`, `intrinsics`, `lens` and `fixed`.
#[pyfunction]
pub(crate) fn from_memory(
    py: Python<'_>,
    name: String,
    board: &str,
    camera: &Bound<'_, PyDict>,
    frames: Vec<FrameArrays<'_>>,
) -> PyResult<Dataset> {
    let target = target_of(board)?;
    let size: (usize, usize) = argument(camera, "size")?;
    let unit_mm: Option<f64> = argument(camera, "unit_mm")?;
    if let Some(unit) = unit_mm.filter(|unit| !(unit.is_finite() && *unit > 0.0)) {
        return Err(input(format!("unit_mm is {unit}: give the millimetres per step, such as 1 or 0.25")).into());
    }
    let frames = frames.into_iter().map(|(name, image, depth, markers, timestamp_s, temperature_c)| {
        Ok(FrameInMemory {
            image: image.map(|image| gray_image(&format!("frame '{name}': the image"), &image)).transpose()?,
            depth: depth.map(|depth| depth_of(&name, &depth, unit_mm)).transpose()?,
            markers: placed_markers(&name, &markers, &target, size)?,
            metadata: FrameMetadata { timestamp_s, temperature_c, ..FrameMetadata::default() },
            name,
        })
    });
    let frames = frames.collect::<Result<Vec<_>, Failure>>()?;
    if unit_mm.is_none() && frames.iter().any(|frame| frame.depth.is_some()) {
        return Err(input(
            "unit_mm is missing: give the millimetres per step of the depth images; it is never guessed",
        )
        .into());
    }
    let hint = camera_hint(camera)?;
    let given = DatasetInMemory { name, target, size, depth_unit_mm: unit_mm, camera: hint, frames };
    let loaded = run_in(Words::Arrays, py, None, move |_| load_from_memory(given).map_err(input))?;
    Ok(Dataset { loaded: Arc::new(loaded) })
}

/// A dataset of several cameras from datasets of one each, the reference first, with `camera_from_rig` where it is known: the
/// rows of (R | t).
#[pyfunction]
pub(crate) fn from_cameras(
    name: String,
    cameras: Vec<(String, PyRef<'_, Dataset>, Option<[f64; 12]>)>,
) -> PyResult<Dataset> {
    let mut parts: Vec<LoadedCamera> = Vec::new();
    for (camera, dataset, camera_from_rig) in cameras {
        let fault = |problem: String| input(format!("camera '{camera}': {problem}"));
        if camera.is_empty() || camera.contains(['/', '.', ':']) {
            return Err(fault("a name has letters, digits, _ and - alone".to_owned()).into());
        }
        let mut part = dataset.only_camera().map_err(|_| fault("its dataset has several cameras".to_owned()))?.clone();
        if let Some(first) = parts.first().filter(|first| first.capture.target != part.capture.target) {
            let (this, other) = (json(&part.capture.target)?, json(&first.capture.target)?);
            return Err(fault(format!(
                "its board is {this}, that of '{}' is {other}: one board is for all",
                first.name()
            ))
            .into());
        }
        part.declared.title = format!("{name}/{camera}");
        part.capture.name.clone_from(&part.declared.title);
        part.declared.name = camera;
        part.declared.camera_from_rig = camera_from_rig;
        parts.push(part);
    }
    if parts.len() < 2 {
        return Err(input("give the datasets of at least two cameras by their names").into());
    }
    Ok(Dataset { loaded: Arc::new(Loaded { name, cameras: parts }) })
}

/// The intrinsics and the lens of the arguments; `None` where neither is given.
fn camera_hint(camera: &Bound<'_, PyDict>) -> PyResult<Option<CameraHint>> {
    let intrinsics: Option<Intrinsics> = argument(camera, "intrinsics")?;
    let numbers =
        intrinsics.map(|(fx, fy, cx, cy, skew, distortion)| IntrinsicNumbers { fx, fy, cx, cy, skew, distortion });
    let lens: Option<String> = argument(camera, "lens")?;
    let fixed = argument(camera, "fixed")?;
    Ok((numbers.is_some() || lens.is_some()).then_some(CameraHint { numbers, lens, fixed, ..CameraHint::default() }))
}

/// The markers of a frame, within the image, and all of the board where they have no numbers.
fn placed_markers(
    frame: &str,
    given: &MarkerArrays<'_>,
    target: &Target,
    size: (usize, usize),
) -> Result<Vec<MarkerObservation>, Failure> {
    let markers = markers_of(frame, given)?;
    check_all(frame, count_without_numbers(given)?, target.len())?;
    if markers.iter().all(|marker| marker.pixel.iter().all(|place| place.is_finite())) {
        check_inside(frame, &markers, size)?;
    }
    Ok(markers)
}

/// The depth of a frame, in a unit that its type of values can have.
fn depth_of(frame: &str, given: &Bound<'_, PyAny>, unit_mm: Option<f64>) -> Result<DepthFrame, Failure> {
    let depth = depth_frame(&format!("frame '{frame}': the depth image"), given)?;
    unit_mm.map_or(Ok(()), |unit_mm| depth.check_unit(Path::new(frame), unit_mm)).map_err(input)?;
    Ok(depth)
}

/// The board of a JSON text.
pub(crate) fn target_of(board: &str) -> Result<Target, Failure> {
    let target: Target = serde_json::from_str(board).map_err(|e| input(format!("board: {e}")))?;
    if target.is_empty() || target.columns < 2 || target.rows < 2 {
        return Err(input(format!(
            "board: {} columns and {} rows: give at least 2 of each",
            target.columns, target.rows
        )));
    }
    if !(target.spacing_mm.is_finite() && target.spacing_mm > 0.0) {
        return Err(input(format!("board: spacing_mm is {}: give the spacing of the grid in mm", target.spacing_mm)));
    }
    Ok(target)
}

impl Dataset {
    /// The camera of a dataset that has one.
    fn only_camera(&self) -> Result<&LoadedCamera, Failure> {
        match self.loaded.cameras.as_slice() {
            [camera] => Ok(camera),
            cameras => {
                let names: Vec<&str> = cameras.iter().map(LoadedCamera::name).collect();
                Err(input(format!("the dataset has several cameras, {}: take one by camera(NAME)", names.join(", "))))
            }
        }
    }

    fn frame(&self, name: &str) -> Result<&DetectedFrame, Failure> {
        let frames = &self.only_camera()?.capture.frames;
        frames
            .iter()
            .find(|frame| frame.name == name)
            .ok_or_else(|| input(format!("there is no frame '{name}' with a board")))
    }
}

#[pymethods]
impl Dataset {
    #[getter]
    fn name(&self) -> &str {
        &self.loaded.name
    }

    /// Names of the cameras; the first is the reference.
    fn cameras(&self) -> Vec<&str> {
        self.loaded.cameras.iter().map(LoadedCamera::name).collect()
    }

    /// One camera as a dataset of its own.
    fn camera(&self, name: &str) -> PyResult<Self> {
        let camera = self.loaded.cameras.iter().find(|camera| camera.name() == name);
        let unknown = || input(format!("the dataset has no camera '{name}'; it has {}", self.cameras().join(", ")));
        Ok(Self { loaded: Arc::new(Loaded::of_camera(camera.ok_or_else(unknown)?.clone())) })
    }

    /// Path as it was given, or the name of a dataset in memory.
    #[getter]
    fn path(&self) -> &str {
        self.loaded.cameras.first().map_or(&self.loaded.name, |camera| &camera.reference.path)
    }

    #[getter]
    fn digest(&self) -> &str {
        self.loaded.cameras.first().map_or("", |camera| &camera.reference.digest)
    }

    /// Width and height, px.
    #[getter]
    fn size(&self) -> PyResult<(usize, usize)> {
        let capture = &self.only_camera()?.capture;
        Ok((capture.width, capture.height))
    }

    #[getter]
    fn unit_mm(&self) -> PyResult<Option<f64>> {
        Ok(self.only_camera()?.capture.depth_unit_mm)
    }

    #[getter(from_cache)]
    fn is_from_cache(&self) -> bool {
        self.loaded.cameras.iter().filter(|camera| camera.has_markers()).all(|camera| camera.from_cache)
    }

    /// The board as JSON.
    #[getter]
    fn board(&self) -> PyResult<String> {
        json(&self.loaded.cameras.first().map(|camera| &camera.capture.target))
    }

    /// (name, number of markers, whether it has depth, time in s, temperature in °C, camera) of every frame that is used.
    fn frames(&self) -> Vec<(String, usize, bool, f64, f64, &str)> {
        let frames =
            self.loaded.cameras.iter().flat_map(|camera| camera.capture.frames.iter().map(move |f| (camera, f)));
        frames
            .map(|(c, f)| (f.name.clone(), f.markers.len(), f.has_depth(), f.time_s, f.temperature_c, c.name()))
            .collect()
    }

    /// (name, reason, camera) of every frame that is not used.
    fn dropped(&self) -> Vec<(String, String, &str)> {
        let frames =
            self.loaded.cameras.iter().flat_map(|camera| camera.capture.dropped.iter().map(move |f| (camera, f)));
        frames.map(|(camera, f)| (f.name.clone(), f.reason.clone(), camera.name())).collect()
    }

    /// Numbers and positions of a frame's markers.
    #[expect(clippy::type_complexity, reason = "two arrays")]
    fn markers<'py>(
        &self,
        py: Python<'py>,
        frame: &str,
    ) -> PyResult<(Bound<'py, PyArray1<i64>>, Bound<'py, PyArray2<f64>>)> {
        let markers = &self.frame(frame)?.markers;
        let indices: Vec<i64> = markers.iter().map(|m| m.index as i64).collect();
        let pixels: Vec<f64> = markers.iter().flat_map(|m| m.pixel).collect();
        Ok((indices.into_pyarray(py), pixels.into_pyarray(py).reshape([markers.len(), 2])?))
    }

    /// The image of a frame, uint16.
    fn image<'py>(&self, py: Python<'py>, frame: &str) -> PyResult<Option<Bound<'py, PyArray2<u16>>>> {
        let raw: &RawFrame = self.frame(frame)?;
        let Some(image) = raw.image.as_ref().map(|image| image.get()).transpose().map_err(input)? else {
            return Ok(None);
        };
        Ok(Some(image.data.clone().into_pyarray(py).reshape([image.height, image.width])?))
    }

    /// The depth image of a frame: uint16 steps or float32 units.
    fn depth<'py>(&self, py: Python<'py>, frame: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let raw: &RawFrame = self.frame(frame)?;
        let Some(depth) = raw.depth_image().map(|depth| depth.get()).transpose().map_err(input)? else {
            return Ok(None);
        };
        let shape = [depth.height, depth.width];
        Ok(Some(match &depth.values {
            DepthValues::Steps(values) => values.clone().into_pyarray(py).reshape(shape)?.into_any(),
            DepthValues::Float(values) => values.clone().into_pyarray(py).reshape(shape)?.into_any(),
        }))
    }

    /// Everything as JSON and arrays, for [`Dataset::of_state`].
    fn state<'py>(&self, py: Python<'py>) -> PyResult<(String, Vec<Bound<'py, PyAny>>)> {
        pickled::state(py, &self.loaded)
    }

    /// The dataset of a [`state`](Dataset::state).
    #[staticmethod]
    fn of_state(text: &str, arrays: Vec<Bound<'_, PyAny>>) -> PyResult<Self> {
        Ok(Self { loaded: Arc::new(pickled::from_state(text, &arrays)?) })
    }

    /// Writes `observations.json`.
    fn write_observations(&self, path: PathBuf) -> PyResult<()> {
        Ok(self.only_camera()?.observations().write(path).map_err(input)?)
    }
}
