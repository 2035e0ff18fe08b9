//! Depth and colour of a rig's cameras on each other's pixels, on numpy arrays.

use depthcal_calibration::camera_record::cameras_from_record;
use depthcal_calibration::observe::PlacedCamera;
use depthcal_calibration::observe::Taken;
use depthcal_correction::{
    AmplitudeImage, Corrector, FrameContext, PointsMut, RegisteredDepth, colours_of, depth_into,
};
use depthcal_io::{DepthValues, RgbImage};
use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::argument;
use crate::arrays::{array_of, exactly, type_name};
use crate::calibrated::Calibration;
use crate::failure::{Failure, input};
use crate::images::{Depth, Gray};
use crate::needed_inputs::NeededInputs;
use crate::running::run;
use crate::units;

/// Takes the corrected depth of one camera of a rig into the image of another, and the colours of that image onto the pixels of
/// depth.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Registration {
    source: PlacedCamera,
    target: PlacedCamera,
    corrector: Corrector,
    inputs: NeededInputs,
}

/// Refuses an array that does not have the shape that a calibration asks for.
fn check_shape(what: &str, given: &[usize], shape: &[usize]) -> Result<(), Failure> {
    if given == shape {
        return Ok(());
    }
    Err(input(format!("{what} has the shape {given:?}, but the calibration is for {shape:?}")))
}

/// Depth in steps of a unit, rounded; 0 where there is none or where it does not fit.
fn steps(depth_mm: &[f32], unit_mm: f64) -> Vec<u16> {
    let step = |z: &f32| {
        let steps = (f64::from(*z) / unit_mm).round();
        if steps > 0.0 && steps < 65535.0 { steps as u16 } else { 0 }
    };
    depth_mm.iter().map(step).collect()
}

impl Registration {
    /// The corrected points of a frame, mm in the camera's frame; NaN where there is no depth.
    fn points(&self, depth: DepthValues, unit_mm: f64, context: &FrameContext<'_>) -> Result<Vec<[f32; 3]>, Failure> {
        let mut points = vec![[f32::NAN; 3]; self.corrector.width() * self.corrector.height()];
        let out = PointsMut::Interleaved(points.as_flattened_mut());
        match depth {
            DepthValues::Steps(steps) => {
                self.corrector.correct_u16_buffer_to_points(&steps, unit_mm, context, out).map_err(input)?;
            }
            DepthValues::Float(mut depth) => {
                units::correct_to_mm(&self.corrector, None, unit_mm, context, &mut depth).map_err(input)?;
                self.corrector.points_f32_into(&depth, out).map_err(input)?;
            }
        }
        Ok(points)
    }

    fn depth_of(&self, given: &Bound<'_, PyAny>, unit_mm: f64) -> Result<DepthValues, Failure> {
        let depth = Depth::new("depth", given)?;
        check_shape("depth", depth.shape(), &[self.corrector.height(), self.corrector.width()])?;
        depth.check_unit("depth", unit_mm)?;
        depth.to_values()
    }

    fn amplitude_of(&self, given: &Bound<'_, PyAny>) -> Result<Vec<u16>, Failure> {
        let amplitude = Gray::new("amplitude", given)?;
        check_shape("amplitude", amplitude.shape(), &[self.corrector.height(), self.corrector.width()])?;
        amplitude.widened()
    }

    /// The image of the target.
    fn image_of(&self, given: &Bound<'_, PyAny>) -> Result<RgbImage, Failure> {
        let (width, height) = (self.target.camera.width, self.target.camera.height);
        let Some(image) = exactly::<u8>("image", array_of("image", given)?)? else {
            return Err(input(format!("image is {}: give an array (height, width, 3) of uint8", type_name(given))));
        };
        check_shape("image", image.shape(), &[height, width, 3])?;
        Ok(RgbImage { width, height, data: image.slice()?.as_chunks::<3>().0.to_vec() })
    }
}

/// Depth in the target's image, colours on the pixels of depth, and the number of pixels without depth.
type Registered<'py> = (Bound<'py, PyAny>, Option<Bound<'py, PyAny>>, usize);

#[pymethods]
impl Registration {
    #[new]
    fn new(py: Python<'_>, calibration: &Calibration, source: &str, target: &str) -> PyResult<Self> {
        let cameras = cameras_from_record(&calibration.record, &calibration.register).map_err(input)?;
        let camera = |name: &str| {
            let camera = cameras.iter().find(|camera| camera.name == name).cloned();
            camera.ok_or_else(|| calibration.no_camera(name))
        };
        let (source, target) = (camera(source)?, camera(target)?);
        let camera = source.camera.clone();
        let inputs = NeededInputs::of(&camera);
        let corrector = run(py, None, move |_| Corrector::new(&camera).map_err(input))?;
        Ok(Self { source, target, corrector, inputs })
    }

    /// Depth of a frame in the target's image, of the type and unit of ``depth``, and colours of depth's pixels where an image
    /// is given. ``conditions`` has the arguments ``amplitude``, ``time_s``, ``temperature_c`` and ``timestamp_s``.
    fn register<'py>(
        &self,
        py: Python<'py>,
        depth: &Bound<'py, PyAny>,
        unit_mm: f64,
        image: Option<Bound<'py, PyAny>>,
        conditions: &Bound<'py, PyDict>,
    ) -> PyResult<Registered<'py>> {
        let (width, height) = (self.corrector.width(), self.corrector.height());
        let (across, down) = (self.target.camera.width, self.target.camera.height);
        let depth = self.depth_of(depth, unit_mm)?;
        let in_steps = matches!(depth, DepthValues::Steps(_));
        let amplitude: Option<Bound<'py, PyAny>> = argument(conditions, "amplitude")?;
        let amplitude = amplitude.map(|array| self.amplitude_of(&array)).transpose()?;
        let number = |name: &str| argument::<Option<f64>>(conditions, name);
        let (time_s, temperature_c) = (number("time_s")?, number("temperature_c")?);
        let timestamp_s = number("timestamp_s")?;
        self.inputs.warn_of_missing(py, time_s.is_some(), temperature_c.is_some(), amplitude.is_some())?;
        let image = image.map(|array| self.image_of(&array)).transpose()?;
        let (registered, colours): (RegisteredDepth, Option<Vec<u8>>) = run(py, None, move |_| {
            let context = FrameContext {
                time_s: time_s.unwrap_or(0.0),
                temperature_c: temperature_c.unwrap_or(f64::NAN),
                amplitude: amplitude.as_ref().map(|data| AmplitudeImage { width, height, data }),
                ..FrameContext::default()
            };
            let taken = Taken {
                time_s: timestamp_s.or(time_s).unwrap_or(f64::NAN),
                temperature_c: temperature_c.unwrap_or(f64::NAN),
            };
            let points = self.points(depth, unit_mm, &context)?;
            let target_from_source = self.target.at(&taken).from(&self.source.at(&taken));
            let registered = depth_into(&points, width, &self.target.camera, &target_from_source);
            let colours = image.map(|image| {
                let colours = colours_of(&points, &self.target.camera, &target_from_source, &registered, &image);
                colours.into_iter().flat_map(Option::unwrap_or_default).collect()
            });
            Ok((registered, colours))
        })?;
        let holes = registered.holes;
        let in_target = if in_steps {
            steps(&registered.depth_mm, unit_mm).into_pyarray(py).reshape([down, across])?.into_any()
        } else {
            let depth: Vec<f32> = registered.depth_mm.iter().map(|z| units::in_units(*z, unit_mm)).collect();
            depth.into_pyarray(py).reshape([down, across])?.into_any()
        };
        let on_depth = match colours {
            Some(colours) => Some(colours.into_pyarray(py).reshape([height, width, 3])?.into_any()),
            None => None,
        };
        Ok((in_target, on_depth, holes))
    }
}
