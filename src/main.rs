//! The `depthcal` command line.

fn main() {}
