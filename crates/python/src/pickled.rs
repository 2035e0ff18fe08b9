//! Datasets that travel to other processes: everything that a fit reads, as text and arrays.

use std::path::PathBuf;

use depthcal_calibration::load::{Loaded, LoadedCamera, MeasuredDiameter, declared_in_memory};
use depthcal_calibration::observe::stored::depth_digest;
use depthcal_calibration::observe::{
    CameraFrames, DepthPixel, DetectedFrame, MarkerObservation, MeasuredDepth, RawFrame,
};
use depthcal_io::{
    CameraHint, DatasetCamera, DepthFrame, DepthValues, Disparity, DroppedFrame, FileReference, Frame, FrameMetadata,
    GrayImage, IntrinsicNumbers,
};
use depthcal_model::{CharucoLayout, Context, Quantities, Target, Technology};
use numpy::{Element, IntoPyArray, PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};

use crate::failure::{Failure, input};

/// Numbers of a marker: index, u, v, standard deviation.
const MARKER: usize = 4;
/// Numbers of a depth pixel before those of the light of the scene.
const PIXEL: usize = 9;

#[derive(Serialize, Deserialize)]
struct State {
    name: String,
    cameras: Vec<CameraState>,
}

/// A camera without its numbers.
#[derive(Serialize, Deserialize)]
struct CameraState {
    name: String,
    title: String,
    root: PathBuf,
    target: Target,
    declared_unit_mm: Option<f64>,
    hint: Option<HintState>,
    camera_from_rig: Option<[f64; 12]>,
    expected_from_rig: Option<[f64; 12]>,
    listed: Vec<(String, FrameMetadata)>,
    reference: FileReference,
    from_cache: bool,
    /// Diameter, standard deviation, mm; number of frames; declared diameter, mm.
    diameter: Option<(f64, f64, usize, Option<f64>)>,
    charuco_layout: Option<CharucoLayout>,
    markers: Option<FileReference>,
    capture: String,
    size: (usize, usize),
    unit_mm: Option<f64>,
    disparity: Option<Disparity>,
    technology: Option<Technology>,
    dropped: Vec<DroppedFrame>,
    frames: Vec<FrameState>,
}

#[derive(Serialize, Deserialize)]
struct HintState {
    /// fx, fy, cx, cy, skew, and the distortion.
    numbers: Option<([f64; 5], Vec<f64>)>,
    intrinsics: Option<String>,
    lens: Option<String>,
    technology: Option<Technology>,
    fixed: bool,
}

#[derive(Serialize, Deserialize)]
struct FrameState {
    name: String,
    board: usize,
    metadata: FrameMetadata,
    /// Bits of a grey value.
    bits: Option<u8>,
    depth: DepthState,
}

#[derive(Serialize, Deserialize)]
enum DepthState {
    None,
    Steps,
    Float,
    Pixels,
}

/// Arrays of one dimension, in the order of the frames: times and temperature, markers, image, depth.
type Arrays<'py> = Vec<Bound<'py, PyAny>>;

/// A dataset as JSON and arrays.
pub(crate) fn state<'py>(py: Python<'py>, loaded: &Loaded) -> PyResult<(String, Arrays<'py>)> {
    let mut arrays = Vec::new();
    let cameras = loaded.cameras.iter().map(|camera| camera_state(py, camera, &mut arrays));
    let state = State { name: loaded.name.clone(), cameras: cameras.collect::<PyResult<_>>()? };
    Ok((serde_json::to_string(&state).map_err(input)?, arrays))
}

fn camera_state<'py>(py: Python<'py>, camera: &LoadedCamera, arrays: &mut Arrays<'py>) -> PyResult<CameraState> {
    let (declared, capture) = (&camera.declared, &camera.capture);
    let hint = |hint: &CameraHint| HintState {
        numbers: hint.numbers.as_ref().map(|n| ([n.fx, n.fy, n.cx, n.cy, n.skew], n.distortion.clone())),
        intrinsics: hint.intrinsics.clone(),
        lens: hint.lens.clone(),
        technology: hint.technology,
        fixed: hint.fixed,
    };
    let diameter = |d: &MeasuredDiameter| (d.diameter_mm, d.std_mm, d.frames, d.declared_mm);
    Ok(CameraState {
        name: declared.name.clone(),
        title: declared.title.clone(),
        // Files that it names are found from other folders too.
        root: std::path::absolute(&declared.root).unwrap_or_else(|_| declared.root.clone()),
        target: capture.target.clone(),
        declared_unit_mm: declared.depth_unit_mm,
        hint: declared.camera.as_ref().map(hint),
        camera_from_rig: declared.camera_from_rig,
        expected_from_rig: declared.expected_from_rig,
        listed: declared.frames.iter().map(|frame| (frame.name.clone(), frame.metadata.clone())).collect(),
        reference: camera.reference.clone(),
        from_cache: camera.from_cache,
        diameter: camera.circle_diameter.as_ref().map(diameter),
        charuco_layout: camera.charuco_layout,
        markers: camera.markers.clone(),
        capture: capture.name.clone(),
        size: (capture.width, capture.height),
        unit_mm: capture.depth_unit_mm,
        disparity: capture.disparity,
        technology: capture.technology,
        dropped: capture.dropped.clone(),
        frames: capture.frames.iter().map(|frame| frame_state(py, frame, arrays)).collect::<PyResult<_>>()?,
    })
}

fn frame_state<'py>(py: Python<'py>, frame: &DetectedFrame, arrays: &mut Arrays<'py>) -> PyResult<FrameState> {
    let mut put = |array: Bound<'py, PyAny>| arrays.push(array);
    put(vec![frame.time_s, frame.temperature_c].into_pyarray(py).into_any());
    let markers = frame.markers.iter().flat_map(|m| [m.index as f64, m.pixel[0], m.pixel[1], m.std_px]);
    put(markers.collect::<Vec<f64>>().into_pyarray(py).into_any());
    let image = frame.image.as_ref().map(|image| image.get()).transpose().map_err(input)?;
    if let Some(image) = &image {
        put(image.data.clone().into_pyarray(py).into_any());
    }
    let depth = match &frame.raw.depth {
        MeasuredDepth::None => DepthState::None,
        MeasuredDepth::Pixels(pixels) => {
            put(pixels.iter().flat_map(numbers_of).collect::<Vec<f64>>().into_pyarray(py).into_any());
            DepthState::Pixels
        }
        MeasuredDepth::Image(image) => match &image.get().map_err(input)?.values {
            DepthValues::Steps(values) => {
                put(values.clone().into_pyarray(py).into_any());
                DepthState::Steps
            }
            DepthValues::Float(values) => {
                put(values.clone().into_pyarray(py).into_any());
                DepthState::Float
            }
        },
    };
    let (name, board, metadata) = (frame.name.clone(), frame.board, frame.metadata.clone());
    Ok(FrameState { name, board, metadata, bits: image.map(|image| image.bits), depth })
}

fn numbers_of(pixel: &DepthPixel) -> Vec<f64> {
    let c = &pixel.context;
    let (u, v, [du, dv]) = (c.pixel[0], c.pixel[1], c.slope);
    let mut numbers = vec![u, v, pixel.depth_mm, c.amplitude, c.surround, du, dv, c.time_s, c.temperature_c];
    numbers.extend(c.stray.scene.as_flattened().iter().chain([&c.stray.near]).map(|light| f64::from(*light)));
    numbers
}

fn pixel_of(numbers: &[f64], quantities: Quantities) -> DepthPixel {
    let mut context = Context {
        pixel: [numbers[0], numbers[1]],
        amplitude: numbers[3],
        surround: numbers[4],
        slope: [numbers[5], numbers[6]],
        time_s: numbers[7],
        temperature_c: numbers[8],
        quantities,
        ..Context::default()
    };
    let light = context.stray.scene.as_flattened_mut().iter_mut().chain([&mut context.stray.near]);
    light.zip(&numbers[PIXEL..]).for_each(|(light, number)| *light = *number as f32);
    DepthPixel { context, depth_mm: numbers[2] }
}

/// The dataset of a [`state`].
pub(crate) fn from_state(text: &str, arrays: &[Bound<'_, PyAny>]) -> Result<Loaded, Failure> {
    let state: State = serde_json::from_str(text).map_err(|e| input(format!("a pickled dataset: {e}")))?;
    let mut arrays = arrays.iter();
    let cameras = state.cameras.into_iter().map(|camera| camera_of(camera, &mut arrays));
    Ok(Loaded { name: state.name, cameras: cameras.collect::<Result<_, _>>()? })
}

/// The next array, with elements of this type.
fn next<'a, 'py: 'a, T: Element + Clone>(
    arrays: &mut impl Iterator<Item = &'a Bound<'py, PyAny>>,
) -> Result<Vec<T>, Failure> {
    let lacking = || input("a pickled dataset lacks an array: it was pickled by another version");
    let array = arrays.next().and_then(|array| array.cast::<PyArrayDyn<T>>().ok()).ok_or_else(lacking)?;
    let array = array.readonly();
    Ok(array.as_slice().map_err(input)?.to_vec())
}

fn camera_of<'a, 'py: 'a>(
    state: CameraState,
    arrays: &mut impl Iterator<Item = &'a Bound<'py, PyAny>>,
) -> Result<LoadedCamera, Failure> {
    let hint = |hint: HintState| CameraHint {
        numbers: hint.numbers.map(|([fx, fy, cx, cy, skew], distortion)| IntrinsicNumbers {
            fx,
            fy,
            cx,
            cy,
            skew,
            distortion,
        }),
        intrinsics: hint.intrinsics,
        lens: hint.lens,
        technology: hint.technology,
        fixed: hint.fixed,
    };
    let listed = state.listed.into_iter();
    let declared = DatasetCamera {
        name: state.name,
        title: state.title,
        root: state.root,
        camera: state.hint.map(hint),
        camera_from_rig: state.camera_from_rig,
        expected_from_rig: state.expected_from_rig,
        disparity: state.disparity,
        frames: listed.map(|(name, metadata)| Frame { name, image: None, depth: None, metadata }).collect(),
        ..declared_in_memory("", &state.target, state.declared_unit_mm)
    };
    let size = state.size;
    let frames = state.frames.into_iter().map(|frame| frame_of(frame, size, arrays));
    let capture = CameraFrames {
        name: state.capture,
        target: state.target,
        width: size.0,
        height: size.1,
        depth_unit_mm: state.unit_mm,
        disparity: state.disparity,
        technology: state.technology,
        frames: frames.collect::<Result<_, _>>()?,
        dropped: state.dropped,
    };
    let diameter =
        |(diameter_mm, std_mm, frames, declared_mm)| MeasuredDiameter { diameter_mm, std_mm, frames, declared_mm };
    Ok(LoadedCamera {
        from_cache: state.from_cache,
        circle_diameter: state.diameter.map(diameter),
        charuco_layout: state.charuco_layout,
        markers: state.markers,
        ..LoadedCamera::of_capture(declared, state.reference, capture)
    })
}

fn frame_of<'a, 'py: 'a>(
    state: FrameState,
    (width, height): (usize, usize),
    arrays: &mut impl Iterator<Item = &'a Bound<'py, PyAny>>,
) -> Result<DetectedFrame, Failure> {
    let conditions = next::<f64>(arrays)?;
    let numbers = next::<f64>(arrays)?;
    let marker = |m: &[f64; MARKER]| MarkerObservation { index: m[0] as usize, pixel: [m[1], m[2]], std_px: m[3] };
    let markers = numbers.as_chunks::<MARKER>().0.iter().map(marker).collect();
    let image = match state.bits {
        Some(bits) => Some(GrayImage { width, height, data: next::<u16>(arrays)?, bits }),
        None => None,
    };
    let per_pixel = PIXEL + 1 + Context::default().stray.scene.as_flattened().len();
    let values = match state.depth {
        DepthState::Steps => Some(DepthValues::Steps(next::<u16>(arrays)?)),
        DepthState::Float => Some(DepthValues::Float(next::<f32>(arrays)?)),
        DepthState::None | DepthState::Pixels => None,
    };
    let mut depth_digest_of = None;
    let depth = match (values, state.depth) {
        (Some(values), _) => {
            let frame = DepthFrame { width, height, values };
            depth_digest_of = depth_digest(&frame);
            MeasuredDepth::Image(frame.into())
        }
        (None, DepthState::Pixels) => {
            let numbers = next::<f64>(arrays)?;
            let pixel_of = |numbers: &[f64]| pixel_of(numbers, state.metadata.quantities());
            MeasuredDepth::Pixels(numbers.chunks_exact(per_pixel).map(pixel_of).collect())
        }
        (None, _) => MeasuredDepth::None,
    };
    let (time_s, temperature_c) = (conditions[0], conditions[1]);
    let raw = RawFrame {
        board: state.board,
        time_s,
        temperature_c,
        image: image.map(Into::into),
        depth,
        depth_digest: depth_digest_of,
        ..RawFrame::named(&state.name, &state.metadata)
    };
    Ok(DetectedFrame { raw, markers, ..DetectedFrame::default() })
}
