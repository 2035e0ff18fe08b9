//! The tests of the crate, one module per subject: `cargo test -p depthcal-live --test suite server` runs those of one module.

mod captures;
mod running;
mod server;
mod session;
mod stream;
