//! Correction of numpy arrays.

use std::sync::Arc;

use depthcal_correction::{
    AmplitudeImage, CorrectionSummary, Corrector as Native, CorrectorError, FrameContext, PointsMut,
};
use numpy::{
    PyArrayDescr, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyTypeError;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use rayon::ThreadPool;

use crate::calibrated::Calibration;
use crate::failure::{Failure, InputError, input};
use crate::running::run;

/// Corrects the depth images of a calibrated camera.
///
/// Built once (``Corrector(calibration, threads=None)``), then used for every frame; may be used from several threads at a time. Arrays
/// are read and written in place, without copies and without the GIL.
#[pyclass(frozen, module = "depthcal")]
#[derive(Debug)]
pub(crate) struct Corrector {
    native: Arc<Native>,
    /// Threads of its own; those of the process where there are none.
    pool: Option<ThreadPool>,
}

/// Depth of a call: steps or millimetres.
#[derive(Clone, Copy)]
enum Depth<'a, 'py> {
    Steps(&'a Bound<'py, PyArrayDyn<u16>>),
    Millimetres(&'a Bound<'py, PyArrayDyn<f32>>),
}

impl Depth<'_, '_> {
    fn shape(&self) -> &[usize] {
        match self {
            Self::Steps(depth) => depth.shape(),
            Self::Millimetres(depth) => depth.shape(),
        }
    }
}

fn depth_of<'a, 'py>(depth: &'a Bound<'py, PyAny>) -> PyResult<Depth<'a, 'py>> {
    if let Ok(depth) = depth.cast::<PyArrayDyn<u16>>() {
        return Ok(Depth::Steps(depth));
    }
    if let Ok(depth) = depth.cast::<PyArrayDyn<f32>>() {
        return Ok(Depth::Millimetres(depth));
    }
    let found = match depth.cast::<PyUntypedArray>() {
        Ok(array) => array.dtype().to_string(),
        Err(_) => depth.get_type().to_string(),
    };
    Err(InputError::new_err(format!(
        "depth is {found}: give an array of uint16 (steps of unit_mm) or float32 (millimetres)"
    )))
}

/// Arguments of a call besides depth, as they are given.
struct Given<'a, 'py> {
    amplitude: Option<&'a Bound<'py, PyAny>>,
    time_s: Option<PerFrame>,
    temperature_c: Option<PerFrame>,
}

/// A call: depth of the calibrated size, and what comes with its frames. Arrays stay borrowed while it lives.
struct Call<'a, 'py> {
    depth: Depth<'a, 'py>,
    count: usize,
    times: Vec<f64>,
    temperatures: Vec<f64>,
    amplitude: Option<PyReadonlyArrayDyn<'py, u16>>,
}

impl Call<'_, '_> {
    /// What the frames share, and what each has of its own, without the GIL.
    fn frames(&self) -> Result<Frames<'_>, Failure> {
        let amplitudes = self.amplitude.as_ref().map(|amplitude| slice("amplitude", amplitude)).transpose()?;
        Ok(Frames { times: &self.times, temperatures: &self.temperatures, amplitudes })
    }
}

/// What the frames of a call share, and what each has of its own.
struct Frames<'a> {
    times: &'a [f64],
    temperatures: &'a [f64],
    amplitudes: Option<&'a [u16]>,
}

impl Frames<'_> {
    fn context(&self, corrector: &Native, index: usize) -> FrameContext<'_> {
        let (width, height) = (corrector.width(), corrector.height());
        let pixels = width * height;
        let of = |values: &[f64]| values.get(index).or(values.first()).copied();
        FrameContext {
            time_s: of(self.times).unwrap_or(0.0),
            temperature_c: of(self.temperatures).unwrap_or(f64::NAN),
            amplitude: self.amplitudes.map(|all| AmplitudeImage {
                width,
                height,
                data: &all[index * pixels..][..pixels],
            }),
        }
    }
}

/// An array's values where they lie one after the other.
fn slice<'a, T: numpy::Element>(what: &str, array: &'a PyReadonlyArrayDyn<'_, T>) -> Result<&'a [T], Failure> {
    array.as_slice().map_err(|_| not_contiguous(what))
}

fn slice_mut<'a, T: numpy::Element>(
    what: &str,
    array: &'a mut PyReadwriteArrayDyn<'_, T>,
) -> Result<&'a mut [T], Failure> {
    array.as_slice_mut().map_err(|_| not_contiguous(what))
}

fn not_contiguous(what: &str) -> Failure {
    input(format!("{what} is not contiguous in memory: pass numpy.ascontiguousarray({what})"))
}

fn read<'py, T: numpy::Element>(depth: &Bound<'py, PyArrayDyn<T>>) -> Result<PyReadonlyArrayDyn<'py, T>, Failure> {
    depth.try_readonly().map_err(|e| borrowed("depth", e))
}

fn write<'py, T: numpy::Element>(out: &Bound<'py, PyArrayDyn<T>>) -> Result<PyReadwriteArrayDyn<'py, T>, Failure> {
    out.try_readwrite().map_err(|e| borrowed("out", e))
}

fn borrowed(what: &str, error: impl std::fmt::Display) -> Failure {
    input(format!(
        "{what}: {error}; depth and out must not overlap, but they may be the same array, and out must be writeable"
    ))
}

/// The function `numpy.empty`.
fn empty<'py>(py: Python<'py>, shape: &[usize], dtype: &Bound<'py, PyArrayDescr>) -> PyResult<Bound<'py, PyAny>> {
    static EMPTY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let function = EMPTY.get_or_try_init(py, || py.import("numpy")?.getattr("empty").map(Bound::unbind))?;
    function.bind(py).call1((shape.to_vec(), dtype))
}

/// The array that receives a result: `out` where it is given, which must have the shape and type of the result, else a new one. `why` says
/// what the type follows from.
fn target<'py, T: numpy::Element>(
    py: Python<'py>,
    out: Option<Bound<'py, PyAny>>,
    shape: &[usize],
    why: &str,
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let Some(out) = out else { return Ok(empty(py, shape, &T::get_dtype(py))?.cast_into()?) };
    let out = out
        .cast_into::<PyArrayDyn<T>>()
        .map_err(|_| InputError::new_err(format!("out is no array of {}: {why}", T::get_dtype(py))))?;
    if out.shape() != shape {
        let found = out.shape();
        return Err(input(format!(
            "out has the shape {found:?}, the result {shape:?}: give an array of the same shape"
        ))
        .into());
    }
    Ok(out)
}

/// One number, or one per frame.
#[derive(FromPyObject)]
enum PerFrame {
    One(f64),
    Each(Vec<f64>),
}

fn per_frame(what: &str, value: Option<PerFrame>, frames: usize) -> Result<Vec<f64>, Failure> {
    match value {
        None => Ok(Vec::new()),
        Some(PerFrame::One(value)) => Ok(vec![value]),
        Some(PerFrame::Each(values)) if values.len() == frames => Ok(values),
        Some(PerFrame::Each(values)) => Err(input(format!(
            "{what} has {} values for {frames} frames: give one number, or one per frame",
            values.len()
        ))),
    }
}

impl Corrector {
    /// Number of frames of an array (height, width) or (frames, height, width).
    fn frames(&self, what: &str, shape: &[usize], components: usize) -> Result<usize, Failure> {
        let (height, width) = (self.native.height(), self.native.width());
        let own: &[usize] = if components == 1 { &[height, width] } else { &[height, width, components] };
        match shape.strip_suffix(own) {
            Some([]) => Ok(1),
            Some([frames]) => Ok(*frames),
            _ => {
                let last = if components == 1 { String::new() } else { format!(", {components}") };
                Err(input(format!(
                    "{what} has the shape {shape:?}, but the calibration is for ({height}, {width}{last}): use images of the calibrated \
                     resolution, one or several (frames, {height}, {width}{last})"
                )))
            }
        }
    }

    /// Checks the arguments of a call.
    fn call<'a, 'py>(&self, depth: &'a Bound<'py, PyAny>, given: Given<'_, 'py>) -> PyResult<Call<'a, 'py>> {
        let depth = depth_of(depth)?;
        let count = self.frames("depth", depth.shape(), 1)?;
        let amplitude = amplitude_of(given.amplitude)?;
        if let Some(amplitude) = &amplitude {
            let frames = self.frames("amplitude", amplitude.shape(), 1)?;
            if frames != count {
                return Err(input(format!("amplitude has {frames} frames, depth has {count}")).into());
            }
        }
        let times = per_frame("time_s", given.time_s, count)?;
        let temperatures = per_frame("temperature_c", given.temperature_c, count)?;
        Ok(Call { depth, count, times, temperatures, amplitude })
    }

    /// Takes the frames one by one without the GIL.
    fn each(
        &self,
        py: Python<'_>,
        frames: usize,
        mut work: impl FnMut(usize) -> Result<CorrectionSummary, CorrectorError> + Send,
    ) -> Result<CorrectionSummary, Failure> {
        let mut all = move || {
            let mut sum = CorrectionSummary::default();
            for index in 0..frames {
                sum += work(index)?;
            }
            Ok(sum)
        };
        let result: Result<_, CorrectorError> = py.detach(|| match &self.pool {
            Some(pool) => pool.install(all),
            None => all(),
        });
        result.map_err(input)
    }

    /// Depth into depth of the same type.
    fn same<T: numpy::Element + Send + Sync>(
        &self,
        depth: &Bound<'_, PyArrayDyn<T>>,
        out: &Bound<'_, PyArrayDyn<T>>,
        call: &Call<'_, '_>,
        correct: impl Fn(&Native, Option<&[T]>, &FrameContext<'_>, &mut [T]) -> Result<CorrectionSummary, CorrectorError>
        + Send
        + Sync,
    ) -> Result<CorrectionSummary, Failure> {
        let native = &*self.native;
        let pixels = native.width() * native.height();
        let source = if depth.is(out) { None } else { Some(read(depth)?) };
        let source = source.as_ref().map(|source| slice("depth", source)).transpose()?;
        let mut out = write(out)?;
        let out = slice_mut("out", &mut out)?;
        let frames = call.frames()?;
        self.each(depth.py(), call.count, |index| {
            let part = index * pixels..(index + 1) * pixels;
            let context = frames.context(native, index);
            correct(native, source.map(|source| &source[part.clone()]), &context, &mut out[part])
        })
    }

    /// Depth into another array, of `components` numbers for each pixel.
    fn to_other<T: numpy::Element + Send + Sync>(
        &self,
        depth: &Bound<'_, PyArrayDyn<T>>,
        out: &Bound<'_, PyArrayDyn<f32>>,
        components: usize,
        call: &Call<'_, '_>,
        mut correct: impl FnMut(&Native, &[T], &FrameContext<'_>, &mut [f32]) -> Result<CorrectionSummary, CorrectorError>
        + Send,
    ) -> Result<CorrectionSummary, Failure> {
        let native = &*self.native;
        let pixels = native.width() * native.height();
        let source = read(depth)?;
        let source = slice("depth", &source)?;
        let mut out = write(out)?;
        let out = slice_mut("out", &mut out)?;
        let frames = call.frames()?;
        self.each(depth.py(), call.count, |index| {
            let context = frames.context(native, index);
            let out = &mut out[components * index * pixels..][..components * pixels];
            correct(native, &source[index * pixels..][..pixels], &context, out)
        })
    }
}

/// Infrared amplitudes as an array of uint16.
fn amplitude_of<'py>(amplitude: Option<&Bound<'py, PyAny>>) -> PyResult<Option<PyReadonlyArrayDyn<'py, u16>>> {
    let Some(amplitude) = amplitude else { return Ok(None) };
    if let Ok(array) = amplitude.cast::<PyArrayDyn<u16>>() {
        return Ok(Some(array.try_readonly().map_err(|e| borrowed("amplitude", e))?));
    }
    // Values of 8 bits are copied: tables of the correction have an entry per value of 16 bits.
    if amplitude.cast::<PyArrayDyn<u8>>().is_ok() {
        let wide = amplitude.call_method1(intern!(amplitude.py(), "astype"), ("uint16",))?;
        return Ok(Some(wide.cast::<PyArrayDyn<u16>>()?.try_readonly().map_err(|e| borrowed("amplitude", e))?));
    }
    Err(InputError::new_err("amplitude must be an array of uint16 or uint8, on the pixel grid of depth"))
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
        // Objects of the package hold the native calibration.
        let native = calibration.getattr(intern!(py, "_native")).unwrap_or_else(|_| calibration.clone());
        let native = native.cast::<Calibration>().map_err(|_| {
            PyTypeError::new_err(
                "give a Calibration: depthcal.Calibration.load(\"calibration.json\"), or fit.calibration",
            )
        })?;
        let camera = native.get().camera.clone();
        let pool = match threads {
            None => None,
            Some(0) => return Err(input("threads is 0; give at least 1").into()),
            Some(threads) => Some(rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(input)?),
        };
        let native = run(py, None, move |_| Native::new(&camera).map_err(input))?;
        Ok(Self { native: Arc::new(native), pool })
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

    /// Arguments that its effects need: some of ``time_s``, ``temperature_c``, ``amplitude``. Without them these effects stay.
    #[getter]
    fn needs(&self) -> Vec<&'static str> {
        let needs = self.native.needs();
        let all = [(needs.time, "time_s"), (needs.temperature, "temperature_c"), (needs.amplitude, "amplitude")];
        all.into_iter().filter(|(needed, _)| *needed).map(|(_, name)| name).collect()
    }

    /// Corrected depth, of the shape and type of ``depth``: (height, width), or (frames, height, width).
    ///
    /// uint16 is in steps of ``unit_mm`` millimetres, 0 and 65535 where nothing was measured; float32 is in millimetres, 0, NaN and infinity
    /// where nothing was. What cannot be corrected is 0. ``amplitude`` is the infrared image, of the shape of ``depth``; ``time_s`` (since the
    /// start of the recording) and ``temperature_c`` are numbers, or one per frame. ``out`` receives the result; it may be ``depth`` itself.
    /// Arrays must be contiguous. Raises InputError.
    #[pyo3(signature = (depth, unit_mm=1.0, *, amplitude=None, time_s=None, temperature_c=None, out=None))]
    #[expect(clippy::too_many_arguments, reason = "named in Python")]
    fn correct<'py>(
        &self,
        py: Python<'py>,
        depth: &Bound<'py, PyAny>,
        unit_mm: f64,
        amplitude: Option<&Bound<'py, PyAny>>,
        time_s: Option<PerFrame>,
        temperature_c: Option<PerFrame>,
        out: Option<Bound<'py, PyAny>>,
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
        time_s: Option<PerFrame>,
        temperature_c: Option<PerFrame>,
        out: Option<Bound<'py, PyAny>>,
    ) -> PyResult<(Bound<'py, PyAny>, Counts)> {
        let call = self.call(depth, Given { amplitude, time_s, temperature_c })?;
        let (shape, why) = (call.depth.shape(), "corrected depth has the type of depth");
        let (out, summary) = match call.depth {
            Depth::Steps(depth) => {
                let out = target::<u16>(py, out, shape, why)?;
                let summary = self.same(depth, &out, &call, |native, source, context, out| match source {
                    Some(source) => native.correct_u16_buffer(source, unit_mm, context, out),
                    None => native.correct_u16_buffer_in_place(out, unit_mm, context),
                })?;
                (out.into_any(), summary)
            }
            Depth::Millimetres(depth) => {
                let out = target::<f32>(py, out, shape, why)?;
                let summary = self.same(depth, &out, &call, |native, source, context, out| match source {
                    Some(source) => native.correct_f32(source, context, out),
                    None => native.correct_f32_in_place(out, context),
                })?;
                (out.into_any(), summary)
            }
        };
        Ok((out, counts(summary)))
    }

    /// As ``correct``, in millimetres that are not rounded to steps: float32 of the shape of ``depth``.
    #[pyo3(signature = (depth, unit_mm=1.0, *, amplitude=None, time_s=None, temperature_c=None, out=None))]
    #[expect(clippy::too_many_arguments, reason = "named in Python")]
    fn correct_to_mm<'py>(
        &self,
        py: Python<'py>,
        depth: &Bound<'py, PyAny>,
        unit_mm: f64,
        amplitude: Option<&Bound<'py, PyAny>>,
        time_s: Option<PerFrame>,
        temperature_c: Option<PerFrame>,
        out: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        if matches!(depth_of(depth)?, Depth::Millimetres(_)) {
            return self.correct(py, depth, unit_mm, amplitude, time_s, temperature_c, out);
        }
        let call = self.call(depth, Given { amplitude, time_s, temperature_c })?;
        let out = target::<f32>(py, out, call.depth.shape(), "it receives millimetres")?;
        if let Depth::Steps(depth) = call.depth {
            self.to_other(depth, &out, 1, &call, |native, source, context, out| {
                native.correct_u16_buffer_to_f32(source, unit_mm, context, out)
            })?;
        }
        Ok(out.into_any())
    }

    /// Corrected points in the camera frame, mm: float32 of shape (…, height, width, 3), NaN where there is no corrected depth.
    #[pyo3(signature = (depth, unit_mm=1.0, *, amplitude=None, time_s=None, temperature_c=None, out=None))]
    #[expect(clippy::too_many_arguments, reason = "named in Python")]
    fn points<'py>(
        &self,
        py: Python<'py>,
        depth: &Bound<'py, PyAny>,
        unit_mm: f64,
        amplitude: Option<&Bound<'py, PyAny>>,
        time_s: Option<PerFrame>,
        temperature_c: Option<PerFrame>,
        out: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let call = self.call(depth, Given { amplitude, time_s, temperature_c })?;
        let shape: Vec<usize> = call.depth.shape().iter().copied().chain([3]).collect();
        let out = target::<f32>(py, out, &shape, "points are in millimetres")?;
        match call.depth {
            Depth::Steps(depth) => {
                self.to_other(depth, &out, 3, &call, |native, source, context, out| {
                    native.correct_u16_buffer_to_points(source, unit_mm, context, PointsMut::Interleaved(out))
                })?;
            }
            Depth::Millimetres(depth) => {
                let mut corrected = vec![0.0; self.native.width() * self.native.height()];
                self.to_other(depth, &out, 3, &call, |native, source, context, out| {
                    let summary = native.correct_f32(source, context, &mut corrected)?;
                    native.points_f32_into(&corrected, PointsMut::Interleaved(out))?;
                    Ok(summary)
                })?;
            }
        }
        Ok(out.into_any())
    }
}
