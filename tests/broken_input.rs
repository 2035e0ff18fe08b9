//! Every file of the fuzzers' corpus (`fuzz/corpus/TARGET/`), read as the fuzz target reads it: broken input is an error, never a
//! panic.

#[path = "../crates/solver/examples/support/bal.rs"]
#[allow(dead_code, reason = "the targets use part of it")]
mod bal;
#[path = "../crates/solver/examples/support/g2o.rs"]
#[allow(dead_code, reason = "the targets use part of it")]
mod g2o;
#[path = "../fuzz/src/targets/mod.rs"]
#[allow(dead_code, reason = "targets are called from their list")]
mod targets;
#[path = "../crates/solver/examples/support/words.rs"]
#[allow(dead_code, reason = "the targets use part of it")]
mod words;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Longest time of one file, which is the fuzzers' limit.
const LONGEST: Duration = Duration::from_secs(10);

fn fuzz() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz")
}

#[test]
fn the_corpus_of_every_target_is_read_without_a_panic() {
    let corpus = fuzz().join("corpus");
    let mut inputs = Vec::new();
    for (name, target) in targets::ALL {
        let folder = corpus.join(name);
        let entries = std::fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
        let files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
        assert!(!files.is_empty(), "{} has no files", folder.display());
        inputs.extend(files.into_iter().map(|file| (file, target)));
    }
    let faults: Vec<String> = inputs
        .iter()
        .filter_map(|(file, target)| {
            let bytes = std::fs::read(file).unwrap();
            let start = Instant::now();
            let panicked = std::panic::catch_unwind(|| target(&bytes)).is_err();
            let fault = if panicked {
                "panics"
            } else if start.elapsed() > LONGEST {
                "takes too long"
            } else {
                return None;
            };
            Some(format!("{} {fault}", file.display()))
        })
        .collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_target_has_its_program_and_no_other_has_a_corpus() {
    let folder = fuzz();
    let names = |folder: &Path| {
        let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let mut names: Vec<String> =
            entries.map(|path| path.file_stem().unwrap().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    };
    let all: Vec<&str> = targets::ALL.iter().map(|(name, _)| *name).collect();
    assert_eq!(names(&folder.join("fuzz_targets")), all);
    assert_eq!(names(&folder.join("corpus")), all);
    let declared = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap();
    assert!(all.iter().all(|name| declared.contains(&format!("fuzz_targets/{name}.rs\""))));
}
