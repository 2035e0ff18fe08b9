//! Numpy arrays as slices in C order. All arrays of callers come through here, whatever their order, strides, alignment and byte
//! order.
//!
//! Input is read in place where it lies in memory as it is needed: in C order, aligned, of the machine's byte order. Otherwise
//! numpy copies it. A type is never guessed: values that mean something else in another type, such as depth, must have theirs;
//! numbers may have any type of real numbers. Results are written in place or not at all.

use numpy::{
    BorrowError, Element, PyArrayDescr, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyReadwriteArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

use crate::failure::{Failure, input};

/// Largest whole number up to which f64 has all whole numbers.
const LARGEST_WHOLE: f64 = 9_007_199_254_740_992.0;

/// Values of an array in C order: its own memory, or a copy.
#[derive(Debug)]
pub(crate) struct Values<'py, T: Element> {
    array: PyReadonlyArrayDyn<'py, T>,
}

impl<'py, T: Element> Values<'py, T> {
    fn new(what: &str, array: &Bound<'py, PyArrayDyn<T>>) -> Result<Self, Failure> {
        let array = array.try_readonly().map_err(|_| input(format!("{what} is being written by another call")))?;
        Ok(Self { array })
    }

    pub fn shape(&self) -> &[usize] {
        self.array.shape()
    }

    pub fn slice(&self) -> Result<&[T], Failure> {
        self.array.as_slice().map_err(input)
    }

    /// Whether these are the values in the memory of `out`.
    fn are_in(&self, out: &Bound<'py, PyArrayDyn<T>>) -> bool {
        self.array.data() == out.data() && self.shape() == out.shape()
    }
}

/// A function or class of numpy.
fn of_numpy<'py>(
    py: Python<'py>,
    place: &'static PyOnceLock<Py<PyAny>>,
    module: &str,
    name: &str,
) -> PyResult<&'py Bound<'py, PyAny>> {
    Ok(place.get_or_try_init(py, || py.import(module)?.getattr(name).map(Bound::unbind))?.bind(py))
}

/// The values of an array as this type in C order, aligned, in the machine's byte order.
fn converted<'py, T: Element>(what: &str, array: &Bound<'py, PyUntypedArray>) -> Result<Values<'py, T>, Failure> {
    static REQUIRE: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let py = array.py();
    let require = of_numpy(py, &REQUIRE, "numpy", "require")?;
    let copy = require.call1((array, T::get_dtype(py), ("C", "A")))?;
    Values::new(what, copy.cast::<PyArrayDyn<T>>().map_err(PyErr::from)?)
}

/// A numpy array without a mask, of any type.
pub(crate) fn array_of<'a, 'py>(
    what: &str,
    given: &'a Bound<'py, PyAny>,
) -> Result<&'a Bound<'py, PyUntypedArray>, Failure> {
    static MASKED: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let Ok(array) = given.cast::<PyUntypedArray>() else {
        return Err(input(format!("{what} is a {}: give a numpy array", type_name(given))));
    };
    if given.cast_exact::<PyUntypedArray>().is_err()
        && given.is_instance(of_numpy(given.py(), &MASKED, "numpy.ma", "MaskedArray")?)?
    {
        return Err(input(format!(
            "{what} is a masked array, and its mask would be lost: fill it, with 0 where nothing was measured (filled(0))"
        )));
    }
    Ok(array)
}

/// Name of a value's class, or of an array's type.
pub(crate) fn type_name(given: &Bound<'_, PyAny>) -> String {
    match given.cast::<PyUntypedArray>() {
        Ok(array) => array.dtype().to_string(),
        Err(_) => given.get_type().name().map_or_else(|_| "value".to_owned(), |name| name.to_string()),
    }
}

/// The values of an array of exactly this type, in either byte order; `None` where its type is another.
pub(crate) fn exactly<'py, T: Element>(
    what: &str,
    array: &Bound<'py, PyUntypedArray>,
) -> Result<Option<Values<'py, T>>, Failure> {
    if let Ok(same) = array.cast::<PyArrayDyn<T>>()
        && same.is_c_contiguous()
        && same.is_aligned()
    {
        return Ok(Some(Values::new(what, same)?));
    }
    let kind_and_size = |dtype: Bound<'_, PyArrayDescr>| (dtype.kind(), dtype.itemsize());
    if kind_and_size(array.dtype()) != kind_and_size(T::get_dtype(array.py())) {
        return Ok(None);
    }
    Ok(Some(converted(what, array)?))
}

/// Real numbers of any type, in an array or in what numpy makes an array of, as f64. Truth values, complex numbers, texts and
/// objects are refused.
pub(crate) fn numbers<'py>(what: &str, given: &Bound<'py, PyAny>) -> Result<Values<'py, f64>, Failure> {
    let made = as_array(what, given)?;
    let array = array_of(what, &made)?;
    match array.dtype().kind() {
        b'i' | b'u' | b'f' => converted(what, array),
        _ => Err(input(format!("{what} is {}: give real numbers", array.dtype()))),
    }
}

/// Whole numbers of any type, floating-point types included, in C order.
pub(crate) fn whole_numbers(what: &str, given: &Bound<'_, PyAny>) -> Result<Vec<i64>, Failure> {
    let made = as_array(what, given)?;
    if let Some(whole) = exactly::<i64>(what, array_of(what, &made)?)? {
        return Ok(whole.slice()?.to_vec());
    }
    let whole = |value: &f64| {
        let is_whole = value.fract() == 0.0 && value.abs() <= LARGEST_WHOLE;
        if is_whole { Ok(*value as i64) } else { Err(input(format!("{what} has {value}: give whole numbers"))) }
    };
    numbers(what, &made)?.slice()?.iter().map(whole).collect()
}

/// The array itself, or the one that numpy makes of a list.
fn as_array<'py>(what: &str, given: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Failure> {
    static ASARRAY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    if given.cast::<PyUntypedArray>().is_ok() {
        return Ok(given.clone());
    }
    let made = of_numpy(given.py(), &ASARRAY, "numpy", "asarray")?.call1((given,));
    made.map_err(|error| input(format!("{what}: {error}")))
}

/// An array that receives a result: one that a caller gives as `out`, or a new one.
#[derive(Debug)]
pub(crate) struct Receiver<'py, T: Element> {
    array: Bound<'py, PyArrayDyn<T>>,
    is_new: bool,
}

impl<'py, T: Element> Receiver<'py, T> {
    /// `out` where it is given, which must have this type and shape and be in C order; else a new array. `why` says what the
    /// type follows from.
    pub fn new(py: Python<'py>, out: Option<&Bound<'py, PyAny>>, shape: &[usize], why: &str) -> Result<Self, Failure> {
        static EMPTY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        let dtype = T::get_dtype(py);
        let Some(out) = out else {
            let array = of_numpy(py, &EMPTY, "numpy", "empty")?.call1((shape.to_vec(), dtype))?;
            return Ok(Self { array: array.cast_into().map_err(PyErr::from)?, is_new: true });
        };
        array_of("out", out)?;
        let Ok(array) = out.cast::<PyArrayDyn<T>>() else {
            return Err(input(format!("out is {}: give an array of {dtype}, because {why}", type_name(out))));
        };
        if array.shape() != shape {
            let given = array.shape();
            return Err(input(format!(
                "out has the shape {given:?}, the result {shape:?}: give an array of the same shape"
            )));
        }
        if !(array.is_c_contiguous() && array.is_aligned()) {
            let remedy = "give an array in C order, such as numpy.empty makes, or leave out out";
            return Err(input(format!(
                "out does not lie in C order in memory, so that it cannot be written in place: {remedy}"
            )));
        }
        Ok(Self { array: array.clone(), is_new: false })
    }

    /// Refuses an input that lies in the memory of `out`, which would change while it is read.
    pub fn check_apart(&self, what: &str, given: &Bound<'py, PyAny>) -> Result<(), Failure> {
        static MAY_SHARE: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        if self.is_new
            || !of_numpy(given.py(), &MAY_SHARE, "numpy", "may_share_memory")?
                .call1((&self.array, given))?
                .is_truthy()?
        {
            return Ok(());
        }
        Err(input(format!("out overlaps {what} in memory: give an array of its own")))
    }

    /// The input that is read while the result is written; `None` where the result replaces it in place. Refuses input that
    /// overlaps `out` in another way.
    pub fn source(
        &self,
        what: &str,
        given: &Bound<'py, PyAny>,
        values: Values<'py, T>,
    ) -> Result<Option<Values<'py, T>>, Failure> {
        if !self.is_new && values.are_in(&self.array) {
            return Ok(None);
        }
        self.check_apart(what, given)?;
        Ok(Some(values))
    }

    /// Its memory, for writing.
    pub fn written(&self) -> Result<Written<'py, T>, Failure> {
        let array = self.array.try_readwrite().map_err(|error| match error {
            BorrowError::NotWriteable => {
                input("out is not writeable: give an array that may be changed, or leave out out")
            }
            _ => input("out is being read or written by another call: give each call an array of its own"),
        })?;
        Ok(Written { array })
    }

    pub fn into_any(self) -> Bound<'py, PyAny> {
        self.array.into_any()
    }
}

/// Memory that is being written. Nothing else in this package may use it meanwhile.
#[derive(Debug)]
pub(crate) struct Written<'py, T: Element> {
    array: PyReadwriteArrayDyn<'py, T>,
}

impl<T: Element> Written<'_, T> {
    pub fn slice(&mut self) -> Result<&mut [T], Failure> {
        self.array.as_slice_mut().map_err(input)
    }
}

/// The mechanism for the package's Python files: real numbers as a new or the same array of float64 in C order.
#[pyfunction]
pub(crate) fn real_numbers<'py>(what: &str, given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    Ok(numbers(what, given)?.array.as_any().clone())
}
