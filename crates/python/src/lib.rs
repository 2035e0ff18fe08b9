//! The Python package of depthcal: the native module `depthcal._depthcal`.
//!
//! Everything here is a thin layer: arguments become options of the library, long calls run without the GIL in threads of their
//! own (`running`), results are objects that keep the library's results and give its records as JSON. Tables, figures and
//! documentation for users are in the package's Python files.
//!
//! - `dataset`, `fitted`, `evaluated`, `compared`, `diagnosed`, `differed`, `calibrated`, `simulated`: the steps of the work, on
//!   one camera or several on one body;
//! - `fleet`: many cameras of one type;
//! - `corrector`, `registration`: depth images on numpy arrays;
//! - `solving`, `array_batch`: the solver, for residuals that numpy functions compute;
//! - `printed`, `imported`: boards to print, recordings as datasets;
//! - `effect`, `function_piece`: formulas and numpy functions as pieces of the chain;
//! - `arrays`, `images`, `markers`, `units`: numpy arrays as the library takes them; `needed_inputs`: those that effects need;
//! - `pickled`: datasets that travel to other processes;
//! - `arguments`, `request`, `failure`, `warned`, `words`, `running`, `unwound`, `threads`: arguments, models, errors,
//!   warnings and threads of all steps.
//!
//! Invariants: the GIL is released in every call that may reach the chain, because a piece may call Python from any thread;
//! nothing runs in rayon's global pool, which a forked process does not have (`threads`); arrays are read and written through
//! `arrays` alone; no panic reaches Python but as an exception.
// The macros of PyO3 expand to `unsafe` code for Python's C interface; this crate has none of its own.
#![allow(unsafe_code)]

mod arguments;
mod array_batch;
mod arrays;
mod calibrated;
mod compared;
mod corrector;
mod dataset;
mod diagnosed;
mod differed;
mod effect;
mod evaluated;
mod failure;
mod fitted;
mod fleet;
mod function_piece;
mod images;
#[cfg(feature = "import")]
mod imported;
mod markers;
mod needed_inputs;
mod pickled;
mod printed;
mod registration;
mod request;
mod running;
mod simulated;
mod solving;
mod threads;
mod units;
mod unwound;
mod warned;
mod words;
mod written;

use pyo3::prelude::*;

/// The native module.
#[pymodule]
fn _depthcal(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("has_detection", cfg!(feature = "detect"))?;
    module.add("Error", module.py().get_type::<failure::Error>())?;
    module.add("InputError", module.py().get_type::<failure::InputError>())?;
    module.add("UntrustedFitError", module.py().get_type::<failure::UntrustedFitError>())?;
    module.add_class::<dataset::Dataset>()?;
    module.add_class::<fitted::Fit>()?;
    module.add_class::<evaluated::Evaluation>()?;
    module.add_class::<compared::Comparison>()?;
    module.add_class::<diagnosed::Diagnosis>()?;
    module.add_class::<differed::Difference>()?;
    module.add_class::<calibrated::Calibration>()?;
    module.add_class::<corrector::Corrector>()?;
    module.add_class::<registration::Registration>()?;
    module.add_class::<fleet::Fleet>()?;
    module.add_class::<effect::Effect>()?;
    module.add_class::<solving::Solved>()?;
    module.add_function(wrap_pyfunction!(solving::solve, module)?)?;
    module.add_function(wrap_pyfunction!(printed::write_board, module)?)?;
    module.add_function(wrap_pyfunction!(written::write_files, module)?)?;
    #[cfg(feature = "import")]
    module.add_function(wrap_pyfunction!(imported::import_recording, module)?)?;
    module.add_function(wrap_pyfunction!(dataset::load, module)?)?;
    module.add_function(wrap_pyfunction!(dataset::from_memory, module)?)?;
    module.add_function(wrap_pyfunction!(dataset::from_cameras, module)?)?;
    module.add_function(wrap_pyfunction!(fitted::calibrate, module)?)?;
    module.add_function(wrap_pyfunction!(evaluated::evaluate, module)?)?;
    module.add_function(wrap_pyfunction!(compared::compare, module)?)?;
    module.add_function(wrap_pyfunction!(diagnosed::diagnose, module)?)?;
    module.add_function(wrap_pyfunction!(differed::diff, module)?)?;
    module.add_function(wrap_pyfunction!(fleet::fleet, module)?)?;
    module.add_function(wrap_pyfunction!(simulated::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(simulated::simulate_points, module)?)?;
    module.add_function(wrap_pyfunction!(threads::set_threads, module)?)?;
    module.add_function(wrap_pyfunction!(arrays::real_numbers, module)?)?;
    Ok(())
}
