//! Named arguments of the package's Python functions, which hand those that belong together over as one dict.

use pyo3::conversion::FromPyObjectOwned;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The argument of this name.
///
/// # Errors
/// KeyError without the argument, TypeError with the argument's name where it has another type, and other errors of its
/// conversion.
pub(crate) fn argument<'py, T: FromPyObjectOwned<'py>>(given: &Bound<'py, PyDict>, name: &str) -> PyResult<T> {
    let value = given.as_any().get_item(name)?;
    value.extract::<T>().map_err(|error| {
        let error: PyErr = error.into();
        if error.is_instance_of::<PyTypeError>(given.py()) {
            return PyTypeError::new_err(format!("argument '{name}': {}", error.value(given.py())));
        }
        error
    })
}
