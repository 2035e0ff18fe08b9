//! Correction of numpy arrays.

use std::sync::Arc;

use depthcal_correction::{
    AmplitudeImage, CorrectionSummary, Corrector as Native, CorrectorError, FrameContext, PointsMut,
};
use numpy::{
    PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
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

/// What the frames of a call share, and what each has of its own.
struct Frames<'a> {
    times: Vec<f64>,
    temperatures: Vec<f64>,
    amplitudes: Option<&'a [u16]>,
}

impl Frames<'_> {
    fn context(&self, corrector: &Native, index: usize) -> FrameContext<'_> {
        let (width, height) = (corrector.width(), corrector.height());
        let pixels = width * height;
        let of = |values: &[f64]| values.get(index).or(values.first()).copied();
        FrameContext {
            time_s: of(&self.times).unwrap_or(0.0),
            temperature_c: of(&self.temperatures).unwrap_or(f64::NAN),
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

fn borrowed(what: &str, error: impl std::fmt::Display) -> Failure {
    input(format!(
        "{what}: {error}; depth and out must not overlap, but they may be the same array, and out must be writeable"
    ))
}

/// The function `numpy.empty`.
fn empty<'py>(py: Python<'py>, shape: &[usize], dtype: &str) -> PyResult<Bound<'py, PyAny>> {
    static EMPTY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let function = EMPTY.get_or_try_init(py, || py.import("numpy")?.getattr("empty").map(Bound::unbind))?;
    function.bind(py).call1((shape.to_vec(), dtype))
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
        py: Python<'_>,
        depth: &Bound<'_, PyArrayDyn<T>>,
        out: &Bound<'_, PyArrayDyn<T>>,
        frames: &Frames<'_>,
        correct: impl Fn(&Native, Option<&[T]>, &FrameContext<'_>, &mut [T]) -> Result<CorrectionSummary, CorrectorError>
        + Send
        + Sync,
    ) -> Result<CorrectionSummary, Failure> {
        let count = self.frames("depth", depth.shape(), 1)?;
        if depth.shape() != out.shape() {
            return Err(input(format!(
                "out has the shape {:?}, depth {:?}: give an array of the same shape",
                out.shape(),
                depth.shape()
            )));
        }
        let native = &*self.native;
        let pixels = native.width() * native.height();
        let in_place = depth.is(out);
        let source = if in_place { None } else { Some(depth.try_readonly().map_err(|e| borrowed("depth", e))?) };
        let source = source.as_ref().map(|source| slice("depth", source)).transpose()?;
        let mut target = out.try_readwrite().map_err(|e| borrowed("out", e))?;
        let target = slice_mut("out", &mut target)?;
        self.each(py, count, |index| {
            let part = index * pixels..(index + 1) * pixels;
            let context = frames.context(native, index);
            correct(native, source.map(|source| &source[part.clone()]), &context, &mut target[part])
        })
    }
}

/// Depth of a call: steps or millimetres.
enum Depth<'a, 'py> {
    Steps(&'a Bound<'py, PyArrayDyn<u16>>),
    Millimetres(&'a Bound<'py, PyArrayDyn<f32>>),
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
        let depth = depth_of(depth)?;
        let (shape, dtype) = match &depth {
            Depth::Steps(depth) => (depth.shape(), "uint16"),
            Depth::Millimetres(depth) => (depth.shape(), "float32"),
        };
        let count = self.frames("depth", shape, 1)?;
        let amplitude = amplitude_of(amplitude)?;
        let frames = self.context_of(count, amplitude.as_ref(), time_s, temperature_c)?;
        let out = match out {
            Some(out) => out,
            None => empty(py, shape, dtype)?,
        };
        let kind =
            |_| InputError::new_err(format!("out is no array of {dtype}: corrected depth has the type of depth"));
        let summary = match depth {
            Depth::Steps(depth) => {
                let target = out.cast::<PyArrayDyn<u16>>().map_err(kind)?;
                self.same(py, depth, target, &frames, |native, source, context, out| match source {
                    Some(source) => native.correct_u16_buffer(source, unit_mm, context, out),
                    None => native.correct_u16_buffer_in_place(out, unit_mm, context),
                })?
            }
            Depth::Millimetres(depth) => {
                let target = out.cast::<PyArrayDyn<f32>>().map_err(kind)?;
                self.same(py, depth, target, &frames, |native, source, context, out| match source {
                    Some(source) => native.correct_f32(source, context, out),
                    None => native.correct_f32_in_place(out, context),
                })?
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
        let Depth::Steps(steps) = depth_of(depth)? else {
            return self.correct(py, depth, unit_mm, amplitude, time_s, temperature_c, out);
        };
        let count = self.frames("depth", steps.shape(), 1)?;
        let amplitude = amplitude_of(amplitude)?;
        let frames = self.context_of(count, amplitude.as_ref(), time_s, temperature_c)?;
        let out = match out {
            Some(out) => out,
            None => empty(py, steps.shape(), "float32")?,
        };
        let target = out.cast::<PyArrayDyn<f32>>().map_err(|_| InputError::new_err("out is no array of float32"))?;
        if target.shape() != steps.shape() {
            return Err(input(format!("out has the shape {:?}, depth {:?}", target.shape(), steps.shape())).into());
        }
        let pixels = self.native.width() * self.native.height();
        let source = steps.try_readonly().map_err(|e| borrowed("depth", e))?;
        let source = slice("depth", &source)?;
        let mut target = target.try_readwrite().map_err(|e| borrowed("out", e))?;
        let target = slice_mut("out", &mut target)?;
        let native = &*self.native;
        self.each(py, count, |index| {
            let part = index * pixels..(index + 1) * pixels;
            let context = frames.context(native, index);
            native.correct_u16_buffer_to_f32(&source[part.clone()], unit_mm, &context, &mut target[part])
        })?;
        Ok(out)
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
        let depth = depth_of(depth)?;
        let shape = match &depth {
            Depth::Steps(depth) => depth.shape(),
            Depth::Millimetres(depth) => depth.shape(),
        };
        let count = self.frames("depth", shape, 1)?;
        let amplitude = amplitude_of(amplitude)?;
        let frames = self.context_of(count, amplitude.as_ref(), time_s, temperature_c)?;
        let shape: Vec<usize> = shape.iter().copied().chain([3]).collect();
        let out = match out {
            Some(out) => out,
            None => empty(py, &shape, "float32")?,
        };
        let target = out.cast::<PyArrayDyn<f32>>().map_err(|_| InputError::new_err("out is no array of float32"))?;
        if target.shape() != shape {
            return Err(input(format!("out has the shape {:?}: give an array {shape:?}", target.shape())).into());
        }
        let native = &*self.native;
        let pixels = native.width() * native.height();
        let mut target = target.try_readwrite().map_err(|e| borrowed("out", e))?;
        let target = slice_mut("out", &mut target)?;
        match depth {
            Depth::Steps(depth) => {
                let source = depth.try_readonly().map_err(|e| borrowed("depth", e))?;
                let source = slice("depth", &source)?;
                self.each(py, count, |index| {
                    let context = frames.context(native, index);
                    let out = PointsMut::Interleaved(&mut target[3 * index * pixels..][..3 * pixels]);
                    native.correct_u16_buffer_to_points(&source[index * pixels..][..pixels], unit_mm, &context, out)
                })?;
            }
            Depth::Millimetres(depth) => {
                let source = depth.try_readonly().map_err(|e| borrowed("depth", e))?;
                let source = slice("depth", &source)?;
                let mut corrected = vec![0.0; pixels];
                self.each(py, count, |index| {
                    let context = frames.context(native, index);
                    let summary = native.correct_f32(&source[index * pixels..][..pixels], &context, &mut corrected)?;
                    let out = PointsMut::Interleaved(&mut target[3 * index * pixels..][..3 * pixels]);
                    native.points_f32_into(&corrected, out)?;
                    Ok(summary)
                })?;
            }
        }
        Ok(out)
    }
}

impl Corrector {
    fn context_of<'a>(
        &self,
        count: usize,
        amplitude: Option<&'a PyReadonlyArrayDyn<'_, u16>>,
        time_s: Option<PerFrame>,
        temperature_c: Option<PerFrame>,
    ) -> Result<Frames<'a>, Failure> {
        let amplitudes = match amplitude {
            None => None,
            Some(amplitude) => {
                let frames = self.frames("amplitude", amplitude.shape(), 1)?;
                if frames != count {
                    return Err(input(format!("amplitude has {frames} frames, depth has {count}")));
                }
                Some(slice("amplitude", amplitude)?)
            }
        };
        let times = per_frame("time_s", time_s, count)?;
        let temperatures = per_frame("temperature_c", temperature_c, count)?;
        Ok(Frames { times, temperatures, amplitudes })
    }
}
