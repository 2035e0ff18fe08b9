//! Correction of numpy arrays.

use std::borrow::Cow;
use std::sync::Arc;

use depthcal_calibration::camera_record::unnamed_camera;
use depthcal_calibration::depth_uncertainty::uncertain_depth;
use depthcal_calibration::observe::PlacedCamera;
use depthcal_correction::{
    AmplitudeImage, CorrectionSummary, Corrector as Native, CorrectorError, FrameContext, PointsMut,
};
use depthcal_io::Calibration as Record;
use depthcal_model::{Quantities, Quantity};
use numpy::Element;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyInt};

use crate::arrays::{Receiver, Values, numbers};
use crate::calibrated::Calibration;
use crate::failure::{Failure, input};
use crate::images::{Depth, Gray};
use crate::needed_inputs::NeededInputs;
use crate::request::json;
use crate::running::run;
use crate::threads::{FrameThreads, SHARED};
use crate::units;

/// Corrects the depth images of a calibrated camera.
///
/// Built once (``Corrector(calibration, threads=None)``), then used for every frame; may be used from several threads at a time.
/// Arrays in C order are read and written in place, without copies and without the GIL.
#[pyclass(frozen, module = "depthcal")]
#[derive(Debug)]
pub(crate) struct Corrector {
    native: Arc<Native>,
    /// The calibration, for other processes.
    record: Arc<Record>,
    inputs: NeededInputs,
    /// Threads of its own; those that frames share where there are none.
    threads: Option<Arc<FrameThreads>>,
    /// Values of further quantities, each one number or one per frame of a call.
    quantities: Vec<(Quantity, Vec<f64>)>,
}

/// A function of the package, and its arguments: the text of a calibration, and the number of threads.
type Reduced<'py> = (Bound<'py, PyAny>, (String, Option<usize>));

/// Arguments of a call besides `out`, as they are given.
struct Given<'a, 'py> {
    depth: &'a Bound<'py, PyAny>,
    unit_mm: f64,
    amplitude: Option<&'a Bound<'py, PyAny>>,
    time_s: Option<&'a Bound<'py, PyAny>>,
    temperature_c: Option<&'a Bound<'py, PyAny>>,
}

/// The inputs of a call besides depth, checked. Arrays stay borrowed while it lives.
struct Call<'a, 'py> {
    given: Given<'a, 'py>,
    count: usize,
    times: Vec<f64>,
    temperatures: Vec<f64>,
    quantities: &'a [(Quantity, Vec<f64>)],
    amplitude: Option<Gray<'py>>,
}

impl<'py> Call<'_, 'py> {
    /// The inputs of all frames besides depth, for use without the GIL.
    fn frames(&self) -> Result<Frames<'_>, Failure> {
        // Values of 8 bits are copied: tables of the correction have an entry per value of 16 bits.
        let amplitudes = match &self.amplitude {
            None => None,
            Some(Gray::Wide(wide)) => Some(Cow::Borrowed(wide.slice()?)),
            Some(narrow) => Some(Cow::Owned(narrow.widened()?)),
        };
        let unit_mm = self.given.unit_mm;
        let Self { times, temperatures, quantities, .. } = self;
        Ok(Frames { unit_mm, times, temperatures, quantities, amplitudes })
    }

    /// Refuses inputs besides depth that lie in the memory of `out`.
    fn check_apart<T: Element>(&self, out: &Receiver<'py, T>) -> Result<(), Failure> {
        self.given.amplitude.map_or(Ok(()), |amplitude| out.check_apart("amplitude", amplitude))
    }
}

/// The unit of depth of a call, and the inputs of its frames besides depth.
struct Frames<'a> {
    unit_mm: f64,
    times: &'a [f64],
    temperatures: &'a [f64],
    quantities: &'a [(Quantity, Vec<f64>)],
    amplitudes: Option<Cow<'a, [u16]>>,
}

impl Frames<'_> {
    fn context(&self, corrector: &Native, index: usize) -> FrameContext<'_> {
        let (width, height) = (corrector.width(), corrector.height());
        let pixels = width * height;
        let of_frame = |values: &[f64]| values.get(index).or(values.first()).copied();
        FrameContext {
            time_s: of_frame(self.times).unwrap_or(0.0),
            temperature_c: of_frame(self.temperatures).unwrap_or(f64::NAN),
            quantities: Quantities::new(
                self.quantities.iter().map(|(quantity, values)| (*quantity, of_frame(values).unwrap_or(f64::NAN))),
            ),
            amplitude: self.amplitudes.as_ref().map(|all| AmplitudeImage {
                width,
                height,
                data: &all[index * pixels..][..pixels],
            }),
        }
    }
}

/// A frame: its depth, `None` where that is in the memory for results, its unit in mm, and what comes with it.
struct Frame<'a, T> {
    depth: Option<&'a [T]>,
    unit_mm: f64,
    context: FrameContext<'a>,
}

/// One number, or one per frame.
fn per_frame(what: &str, given: Option<&Bound<'_, PyAny>>, frames: usize) -> Result<Vec<f64>, Failure> {
    let Some(given) = given else { return Ok(Vec::new()) };
    if given.cast_exact::<PyFloat>().is_ok() || given.cast_exact::<PyInt>().is_ok() {
        return Ok(vec![given.extract()?]);
    }
    let values = numbers(what, given)?;
    let is_right = match values.shape() {
        [] => true,
        [count] => *count == frames,
        _ => false,
    };
    if !is_right {
        let shape = values.shape();
        return Err(input(format!(
            "{what} has the shape {shape:?} for {frames} frames: give one number, or one per frame"
        )));
    }
    Ok(values.slice()?.to_vec())
}

impl Corrector {
    /// Number of frames of an array (height, width) or (frames, height, width).
    fn frames(&self, what: &str, shape: &[usize]) -> Result<usize, Failure> {
        let (height, width) = (self.native.height(), self.native.width());
        match shape.strip_suffix(&[height, width]) {
            Some([]) => Ok(1),
            Some([frames]) => Ok(*frames),
            _ => Err(input(format!(
                "{what} has the shape {shape:?}, but the calibration is for ({height}, {width}): use images of the calibrated \
                 resolution, one or several (frames, {height}, {width})"
            ))),
        }
    }

    /// Checks the arguments of a call; returns its depth apart from all else.
    fn call<'a, 'py>(&'a self, given: Given<'a, 'py>) -> Result<(Depth<'py>, Call<'a, 'py>), Failure> {
        let depth = Depth::new("depth", given.depth)?;
        let count = self.frames("depth", depth.shape())?;
        depth.check_unit("depth", given.unit_mm)?;
        let amplitude = given.amplitude.map(|amplitude| Gray::new("amplitude", amplitude)).transpose()?;
        if let Some(amplitude) = &amplitude {
            let frames = self.frames("amplitude", amplitude.shape())?;
            if frames != count {
                return Err(input(format!("amplitude has {frames} frames, depth has {count}")));
            }
        }
        let times = per_frame("time_s", given.time_s, count)?;
        let temperatures = per_frame("temperature_c", given.temperature_c, count)?;
        if let Some((name, values)) = self.quantities.iter().find(|(_, values)| ![1, count].contains(&values.len())) {
            let (name, values) = (name.name(), values.len());
            return Err(input(format!(
                "{name} has {values} values for {count} frames: give one number, or one per frame"
            )));
        }
        Ok((depth, Call { given, count, times, temperatures, quantities: &self.quantities, amplitude }))
    }

    /// Takes the frames one by one, without the GIL, from `depth` (that in `out` where it is not given) to `out`, which has
    /// `components` numbers for each pixel.
    fn each<'py, T: Element + Sync, O: Element + Send>(
        &self,
        py: Python<'py>,
        call: &Call<'_, 'py>,
        depth: Option<Values<'py, T>>,
        (out, components): (&Receiver<'py, O>, usize),
        mut correct: impl FnMut(&Native, Frame<'_, T>, &mut [O]) -> Result<CorrectionSummary, CorrectorError> + Send,
    ) -> Result<CorrectionSummary, Failure> {
        call.check_apart(out)?;
        let native = &*self.native;
        let pixels = native.width() * native.height();
        let depth = depth.as_ref().map(Values::slice).transpose()?;
        let mut written = out.written()?;
        let out = written.slice()?;
        let (frames, count) = (call.frames()?, call.count);
        let all = || {
            let mut sum = CorrectionSummary::default();
            for index in 0..count {
                let depth = depth.map(|depth| &depth[index * pixels..][..pixels]);
                let frame = Frame { depth, unit_mm: frames.unit_mm, context: frames.context(native, index) };
                sum += correct(native, frame, &mut out[index * components * pixels..][..components * pixels])?;
            }
            Ok(sum)
        };
        let corrected: Result<_, CorrectorError> = self.threads.as_deref().unwrap_or(&SHARED).run(py, all)?;
        corrected.map_err(input)
    }
}

/// Counts of pixels: corrected, saturated, invalid, not correctable.
type Counts = (usize, usize, usize, usize);

fn counts(summary: CorrectionSummary) -> Counts {
    (summary.corrected, summary.saturated, summary.invalid, summary.not_correctable)
}

#[pymethods]
impl Corrector {
    #[new]
    #[pyo3(signature = (calibration, threads=None))]
    fn new(py: Python<'_>, calibration: &Bound<'_, PyAny>, threads: Option<usize>) -> PyResult<Self> {
        // A calibration of the package, a fit, or a path: objects of the package hold the native calibration.
        let taken = py.import("depthcal._calibration")?.getattr("calibration_of")?.call1((calibration,))?;
        let native = taken.getattr(intern!(py, "_native"))?;
        let native = native.cast::<Calibration>().map_err(PyErr::from)?;
        let camera = native.get().camera.clone();
        if threads == Some(0) {
            return Err(input("threads is 0; give at least 1").into());
        }
        let (record, name) = (native.get().record.clone(), native.get().record.camera.name.clone());
        let inputs = NeededInputs::of(&camera);
        let pickled = record.clone();
        let native = run(py, None, move |_| {
            let corrector = Native::new(&camera).map_err(input)?;
            let placed = PlacedCamera { name, ..unnamed_camera((*camera).clone()) };
            Ok(match uncertain_depth(&record, &placed) {
                Some(depth) => corrector.with_uncertainty(depth),
                None => corrector,
            })
        })?;
        let threads = threads.map(|number| Arc::new(FrameThreads::new(Some(number))));
        Ok(Self { native: Arc::new(native), record: pickled, inputs, threads, quantities: Vec::new() })
    }

    /// Pickled as its calibration, from which the other process builds it again.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let build = py.import("depthcal._calibration")?.getattr("_corrector")?;
        Ok((build, (json(&*self.record)?, self.threads.as_deref().and_then(FrameThreads::number))))
    }

    /// This corrector for frames with these values of further quantities: keys are columns of frames.csv such as ``exposure_ms``,
    /// values one number, or one per frame of a call. Tables are shared. Raises InputError.
    fn with_quantities(&self, quantities: &Bound<'_, PyDict>) -> PyResult<Self> {
        let of_one = |(name, values): (Bound<'_, PyAny>, Bound<'_, PyAny>)| -> PyResult<(Quantity, Vec<f64>)> {
            let name: String = name.extract()?;
            let quantity = Quantity::named(&name).ok_or_else(|| {
                input(format!("'{name}' does not end in a unit, as exposure_ms does: name a column of frames.csv"))
            })?;
            let count = numbers(&name, &values)?.shape().first().copied().unwrap_or(1);
            Ok((quantity, per_frame(&name, Some(&values), count)?))
        };
        let quantities = quantities.iter().map(of_one).collect::<PyResult<_>>()?;
        let (native, record) = (self.native.clone(), self.record.clone());
        Ok(Self { native, record, inputs: self.inputs.clone(), threads: self.threads.clone(), quantities })
    }

    /// Width of its images, px.
    #[getter]
    fn width(&self) -> usize {
        self.native.width()
    }

    /// Height of its images, px.
    #[getter]
    fn height(&self) -> usize {
        self.native.height()
    }

    /// Whether frames are corrected by tables; if not, every pixel is inverted, some hundred times slower.
    #[getter]
    fn has_tables(&self) -> bool {
        self.native.has_tables()
    }

    /// Arguments that its effects need: some of ``time_s``, ``temperature_c``, ``amplitude``, and the quantities of
    /// ``with_quantities``. Without them these effects stay.
    #[getter]
    fn needs(&self) -> Vec<&'static str> {
        let needs = self.native.needs();
        let all = [(needs.time, "time_s"), (needs.temperature, "temperature_c"), (needs.amplitude, "amplitude")];
        let quantities = needs.quantities.into_iter().flatten().map(Quantity::name);
        all.into_iter().filter(|(needed, _)| *needed).map(|(_, name)| name).chain(quantities).collect()
    }

    /// Corrected depth, of the shape, type and unit of ``depth``: (height, width), or (frames, height, width).
    ///
    /// ``depth`` is in units of ``unit_mm`` millimetres, and so is the result: uint16 in whole steps, 0 and 65535 where nothing
    /// was measured, or float32, 0, NaN and infinity where nothing was; metres have ``unit_mm=1000``. What cannot be corrected
    /// is 0. ``amplitude`` is the infrared image, uint8 or uint16, of the shape of ``depth``; ``time_s`` (since the start of the
    /// recording) and ``temperature_c`` are numbers, or one per frame. Arrays may have any strides and byte order; those in C
    /// order are not copied. ``out`` receives the result: an array in C order of the type of the result, which may be ``depth``
    /// itself but must not overlap it otherwise. Raises InputError.
    #[pyo3(signature = (depth, unit_mm=1.0, *, amplitude=None, time_s=None, temperature_c=None, out=None))]
    #[expect(clippy::too_many_arguments, reason = "named in Python")]
    fn correct<'py>(
        &self,
        py: Python<'py>,
        depth: &Bound<'py, PyAny>,
        unit_mm: f64,
        amplitude: Option<&Bound<'py, PyAny>>,
        time_s: Option<&Bound<'py, PyAny>>,
        temperature_c: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        Ok(self.correct_counting(py, depth, unit_mm, amplitude, time_s, temperature_c, out)?.0)
    }

    /// As ``correct``, with numbers of pixels: corrected, of these beyond the range of the type, without depth, not correctable.
    #[pyo3(signature = (depth, unit_mm=1.0, *, amplitude=None, time_s=None, temperature_c=None, out=None))]
    #[expect(clippy::too_many_arguments, reason = "named in Python")]
    fn correct_counting<'py>(
        &self,
        py: Python<'py>,
        depth: &Bound<'py, PyAny>,
        unit_mm: f64,
        amplitude: Option<&Bound<'py, PyAny>>,
        time_s: Option<&Bound<'py, PyAny>>,
        temperature_c: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Bound<'py, PyAny>, Counts)> {
        let given = Given { depth, unit_mm, amplitude, time_s, temperature_c };
        self.inputs.warn_of_missing(py, time_s.is_some(), temperature_c.is_some(), amplitude.is_some())?;
        let (values, call) = self.call(given)?;
        let why = "corrected depth has the type of depth";
        let (out, summary) = match values {
            Depth::Steps(steps) => {
                let out = Receiver::<u16>::new(py, out, steps.shape(), why)?;
                let source = out.source("depth", depth, steps)?;
                let summary = self.each(py, &call, source, (&out, 1), |native, frame, out| match frame.depth {
                    Some(steps) => native.correct_u16_buffer(steps, frame.unit_mm, &frame.context, out),
                    None => native.correct_u16_buffer_in_place(out, frame.unit_mm, &frame.context),
                })?;
                (out.into_any(), summary)
            }
            Depth::Float(float) => {
                let out = Receiver::<f32>::new(py, out, float.shape(), why)?;
                let source = out.source("depth", depth, float)?;
                let summary = self.each(py, &call, source, (&out, 1), |native, frame, out| {
                    units::correct(native, frame.depth, frame.unit_mm, &frame.context, out)
                })?;
                (out.into_any(), summary)
            }
        };
        Ok((out, counts(summary)))
    }

    /// As ``correct``, in millimetres whatever the unit of ``depth``, not rounded to steps: float32 of the shape of ``depth``.
    #[pyo3(signature = (depth, unit_mm=1.0, *, amplitude=None, time_s=None, temperature_c=None, out=None))]
    #[expect(clippy::too_many_arguments, reason = "named in Python")]
    fn correct_to_mm<'py>(
        &self,
        py: Python<'py>,
        depth: &Bound<'py, PyAny>,
        unit_mm: f64,
        amplitude: Option<&Bound<'py, PyAny>>,
        time_s: Option<&Bound<'py, PyAny>>,
        temperature_c: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let given = Given { depth, unit_mm, amplitude, time_s, temperature_c };
        self.inputs.warn_of_missing(py, time_s.is_some(), temperature_c.is_some(), amplitude.is_some())?;
        let (values, call) = self.call(given)?;
        let out = Receiver::<f32>::new(py, out, values.shape(), "it receives millimetres")?;
        match values {
            Depth::Steps(steps) => {
                out.check_apart("depth", depth)?;
                self.each(py, &call, Some(steps), (&out, 1), |native, frame, out| {
                    let steps = frame.depth.unwrap_or_default();
                    native.correct_u16_buffer_to_f32(steps, frame.unit_mm, &frame.context, out)
                })?;
            }
            Depth::Float(float) => {
                let source = out.source("depth", depth, float)?;
                self.each(py, &call, source, (&out, 1), |native, frame, out| {
                    units::correct_to_mm(native, frame.depth, frame.unit_mm, &frame.context, out)
                })?;
            }
        }
        Ok(out.into_any())
    }

    /// Corrected points in the camera frame, in millimetres whatever the unit of ``depth``: float32 of shape (…, height, width,
    /// 3), NaN where there is no corrected depth.
    #[pyo3(signature = (depth, unit_mm=1.0, *, amplitude=None, time_s=None, temperature_c=None, out=None))]
    #[expect(clippy::too_many_arguments, reason = "named in Python")]
    fn points<'py>(
        &self,
        py: Python<'py>,
        depth: &Bound<'py, PyAny>,
        unit_mm: f64,
        amplitude: Option<&Bound<'py, PyAny>>,
        time_s: Option<&Bound<'py, PyAny>>,
        temperature_c: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let given = Given { depth, unit_mm, amplitude, time_s, temperature_c };
        self.inputs.warn_of_missing(py, time_s.is_some(), temperature_c.is_some(), amplitude.is_some())?;
        let (values, call) = self.call(given)?;
        let shape: Vec<usize> = values.shape().iter().copied().chain([3]).collect();
        let out = Receiver::<f32>::new(py, out, &shape, "points are in millimetres")?;
        out.check_apart("depth", depth)?;
        match values {
            Depth::Steps(steps) => {
                self.each(py, &call, Some(steps), (&out, 3), |native, frame, out| {
                    let (steps, out) = (frame.depth.unwrap_or_default(), PointsMut::Interleaved(out));
                    native.correct_u16_buffer_to_points(steps, frame.unit_mm, &frame.context, out)
                })?;
            }
            Depth::Float(float) => {
                let mut corrected = vec![0.0; self.native.width() * self.native.height()];
                self.each(py, &call, Some(float), (&out, 3), |native, frame, out| {
                    let (depth, unit_mm) = (frame.depth, frame.unit_mm);
                    let summary = units::correct_to_mm(native, depth, unit_mm, &frame.context, &mut corrected)?;
                    native.points_f32_into(&corrected, PointsMut::Interleaved(out))?;
                    Ok(summary)
                })?;
            }
        }
        Ok(out.into_any())
    }

    /// Standard deviation of the corrected depth of every pixel in millimetres, whatever the unit of ``depth``, which is as
    /// measured: float32 of its shape, NaN where there is no depth. Noise of the pixel and uncertainty of the calibration's
    /// parameters, under the conditions in the middle of those of the fit. Raises InputError for a calibration without noise
    /// of depth.
    #[pyo3(signature = (depth, unit_mm=1.0, *, out=None))]
    fn uncertainty<'py>(
        &self,
        py: Python<'py>,
        depth: &Bound<'py, PyAny>,
        unit_mm: f64,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let given = Given { depth, unit_mm, amplitude: None, time_s: None, temperature_c: None };
        let (values, call) = self.call(given)?;
        let out = Receiver::<f32>::new(py, out, values.shape(), "it receives millimetres")?;
        out.check_apart("depth", depth)?;
        match values {
            Depth::Steps(steps) => {
                self.each(py, &call, Some(steps), (&out, 1), |native, frame, out| {
                    native.uncertainty_u16(frame.depth.unwrap_or_default(), frame.unit_mm, out)?;
                    Ok(CorrectionSummary::default())
                })?;
            }
            Depth::Float(float) => {
                self.each(py, &call, Some(float), (&out, 1), |native, frame, out| {
                    let mm = units::millimetres(frame.depth.unwrap_or_default(), frame.unit_mm);
                    native.uncertainty_f32(&mm, out)?;
                    Ok(CorrectionSummary::default())
                })?;
            }
        }
        Ok(out.into_any())
    }

    /// Where the calibration is supported, for corrected depth: uint8 of its shape, 255 where boards were seen there and at such
    /// depths, 128 where the calibration extrapolates, 0 without depth. Raises InputError for a calibration without noise of
    /// depth.
    #[pyo3(signature = (corrected, unit_mm=1.0))]
    fn mask<'py>(&self, py: Python<'py>, corrected: &Bound<'py, PyAny>, unit_mm: f64) -> PyResult<Bound<'py, PyAny>> {
        let given = Given { depth: corrected, unit_mm, amplitude: None, time_s: None, temperature_c: None };
        let (values, call) = self.call(given)?;
        let out = Receiver::<u8>::new(py, None, values.shape(), "it receives the mask")?;
        match values {
            Depth::Steps(steps) => {
                self.each(py, &call, Some(steps), (&out, 1), |native, frame, out| {
                    let steps = frame.depth.unwrap_or_default();
                    let mm: Vec<f32> = steps.iter().map(|z| (f64::from(*z) * frame.unit_mm) as f32).collect();
                    native.support(&mm, out)?;
                    Ok(CorrectionSummary::default())
                })?;
            }
            Depth::Float(float) => {
                self.each(py, &call, Some(float), (&out, 1), |native, frame, out| {
                    native.support(&units::millimetres(frame.depth.unwrap_or_default(), frame.unit_mm), out)?;
                    Ok(CorrectionSummary::default())
                })?;
            }
        }
        Ok(out.into_any())
    }
}
