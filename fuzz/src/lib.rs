//! Functions that give a fuzzer's bytes to the readers of depthcal, one each. The programs in `fuzz_targets/` call one of them
//! each; `tests/broken_input.rs` compiles the same functions and calls them with every file of `corpus/`.

#[path = "../../crates/solver/examples/support/bal.rs"]
pub mod bal;
#[path = "../../crates/solver/examples/support/g2o.rs"]
pub mod g2o;
pub mod targets;
#[path = "../../crates/solver/examples/support/words.rs"]
pub mod words;
