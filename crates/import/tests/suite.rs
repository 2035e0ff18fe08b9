//! The tests of the crate, one module per subject: `cargo test -p depthcal-import --test suite broken` runs those of one module.

mod broken;
mod folders;
mod recordings;

#[path = "../../../tests/support/python.rs"]
mod python;
