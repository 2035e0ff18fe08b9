//! Every record has the same bytes for the same input: on any number of threads, in any order of its lists, with and without
//! cached detections, whatever became of the cache, whatever the clock says, and beside another run.

#![cfg(all(unix, feature = "cli", feature = "detect"))]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::{Duration, SystemTime};

use crate::support::{self, CALIBRATION, Folder, command, depth, stderr, stdout, succeeds};
use depthcal::io::{read_depth, write_depth};

/// Runs a command with a cache of its own.
fn run_with(cache: &Path, arguments: &[&str]) -> Output {
    command(arguments).env("DEPTHCAL_CACHE", cache).output().unwrap()
}

fn succeeds_with(cache: &Path, arguments: &[&str]) -> Output {
    let output = run_with(cache, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    output
}

/// All records of a folder of results: files of JSON by name.
fn records(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let names = support::names(folder).into_iter().filter(|name| name.ends_with(".json"));
    names.map(|name| (name.clone(), fs::read(folder.join(name)).unwrap())).collect()
}

/// A small capture.
fn captures() -> Folder {
    let folder = Folder::new();
    succeeds(["simulate", "--kind", "plywood1", "--frames", "7", "--out", &folder.arg("captures")]);
    folder
}

/// Every command that fits or judges, in folders of its own below `out`: all their records.
fn all_records(folder: &Folder, cache: &Path, threads: &str, out: &str) -> BTreeMap<String, Vec<u8>> {
    let captures = folder.arg("captures");
    let mut all = BTreeMap::new();
    let mut run = |name: &str, arguments: &[&str]| {
        let out = folder.arg(&format!("{out}/{name}"));
        succeeds_with(cache, &[arguments, &["--threads", threads, "--out", &out]].concat());
        let written = records(Path::new(&out));
        all.extend(written.into_iter().map(|(file, bytes)| (format!("{name}/{file}"), bytes)));
    };
    run("calibrate", &["calibrate", &captures, "--cross-validate", "2", "--with", "range_offset"]);
    run("diagnose", &["diagnose", &captures, "--folds", "2", "--no-discovery"]);
    run("compare", &["compare", &captures, "--models", "none,projective", "--folds", "2", "--learning", "1"]);
    run("detect", &["detect", &captures]);
    // Records name the files that they are of, so that what is read has the same name in all runs.
    fs::create_dir_all(folder.path("fit")).unwrap();
    for name in ["calibration.json", "scores.json"] {
        fs::copy(folder.path(&format!("{out}/calibrate/{name}")), folder.path(&format!("fit/{name}"))).unwrap();
    }
    run("evaluate", &["evaluate", &folder.arg("fit/calibration.json"), &captures]);
    all
}

#[test]
fn records_have_the_same_bytes_on_any_number_of_threads_and_with_a_cache() {
    let folder = captures();
    let cache = folder.path("cache");
    let one = all_records(&folder, &cache, "1", "one");
    for record in ["calibration", "evaluation", "observations", "scores"] {
        assert!(one.contains_key(&format!("calibrate/{record}.json")), "{:?}", one.keys());
    }
    for record in
        ["diagnose/diagnosis.json", "compare/comparison.json", "evaluate/evaluation.json", "detect/observations.json"]
    {
        assert!(one.contains_key(record), "{:?}", one.keys());
    }
    // The cache is warm now, and there are two threads.
    assert_eq!(support::names(&cache).len(), 1);
    assert_same(&one, &all_records(&folder, &cache, "2", "two"));
}

fn assert_same(a: &BTreeMap<String, Vec<u8>>, b: &BTreeMap<String, Vec<u8>>) {
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    let different: Vec<&String> = a.keys().filter(|name| a[*name] != b[*name]).collect();
    assert!(different.is_empty(), "{different:?}");
}

/// Frames are taken in the order of their names. Only the digest of the dataset tells of the order of a list.
#[test]
fn the_order_of_lists_changes_no_number() {
    let folder = captures();
    let cache = folder.path("cache");
    let shuffled = |text: &str| {
        let (head, rows) = text.split_once('\n').unwrap();
        let mut rows: Vec<&str> = rows.lines().collect();
        rows.reverse();
        rows.swap(1, 4);
        format!("{head}\n{}\n", rows.join("\n"))
    };
    let calibrate = |out: &str| {
        let arguments = ["calibrate", &folder.arg("captures"), "--cross-validate", "2", "--out", &folder.arg(out)];
        succeeds_with(&cache, &arguments);
        let digest = |bytes: &[u8]| {
            let value: serde_json::Value = serde_json::from_slice(bytes).unwrap();
            value["dataset"]["digest"].as_str().map(str::to_owned)
        };
        let texts = records(&folder.path(out)).into_iter().map(|(name, bytes)| {
            let text = String::from_utf8(bytes.clone()).unwrap();
            (name, digest(&bytes).map_or(text.clone(), |digest| text.replace(&digest, "DIGEST")).into_bytes())
        });
        texts.collect::<BTreeMap<_, _>>()
    };
    let before = calibrate("before");
    let table = fs::read_to_string(folder.path("captures/frames.csv")).unwrap();
    folder.write("captures/frames.csv", shuffled(&table));
    assert_same(&before, &calibrate("after"));

    // The same of a table that names the files.
    let toml = fs::read_to_string(folder.path("captures/dataset.toml")).unwrap();
    let lines = toml.lines().filter(|line| !line.starts_with("image =") && !line.starts_with("depth ="));
    folder.write("captures/dataset.toml", lines.collect::<Vec<_>>().join("\n"));
    let named = table.lines().enumerate().map(|(i, line)| match (i, line.split_once(',')) {
        (0, _) => format!("{line},image,depth"),
        (_, Some((frame, _))) => format!("{line},image/{frame}.png,depth/{frame}.png"),
        _ => line.to_owned(),
    });
    let named = named.collect::<Vec<_>>().join("\n");
    folder.write("captures/frames.csv", &named);
    let listed = calibrate("listed");
    folder.write("captures/frames.csv", shuffled(&named));
    assert_same(&listed, &calibrate("shuffled"));
    assert_same(&before, &listed);
}

/// Whatever is in the cache, the results are those without it, and the next run finds it healed.
#[test]
fn a_damaged_cache_is_not_used_and_heals() {
    let folder = captures();
    let cache = folder.path("cache");
    let captures = folder.arg("captures");
    let detect = |cache: &Path| {
        let output = succeeds_with(cache, &["detect", &captures, "--out", &folder.arg("out")]);
        let observations = fs::read(folder.path("out/observations.json")).unwrap();
        (observations, stdout(&output).contains("(cached)"), stderr(&output))
    };
    let (expected, was_cached, _) = detect(&cache);
    assert!(!was_cached);
    let file = cache.join(&support::names(&cache)[0]);
    let good = fs::read(&file).unwrap();
    assert!(detect(&cache) == (expected.clone(), true, String::new()));

    // The last digit of a marker: JSON as good as before.
    let place = good.windows(8).position(|w| w == b"\"pixel\":").unwrap();
    let digit = place + good[place..].iter().position(|b| *b == b'.').unwrap() + 1;
    let changed = |place: usize, to: u8| {
        let mut bytes = good.clone();
        bytes[place] = to;
        bytes
    };
    let replaced = |from: &str, to: &str| String::from_utf8(good.clone()).unwrap().replacen(from, to, 1).into_bytes();
    let damaged: [(&str, Vec<u8>); 8] = [
        ("nothing", Vec::new()),
        ("half", good[..good.len() / 2].to_vec()),
        ("all but the end", good[..good.len() - 2].to_vec()),
        ("another digit", changed(digit, if good[digit] == b'1' { b'2' } else { b'1' })),
        ("a flipped bit", changed(good.len() / 3, good[good.len() / 3] ^ 4)),
        ("noise", (0..5000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect()),
        ("another version of detection", replaced("\"detection\":\"", "\"detection\":\"9")),
        ("another version of the file", replaced("\"version\":", "\"version\":9")),
    ];
    for (what, bytes) in damaged {
        assert!(bytes != good, "{what}");
        fs::write(&file, bytes).unwrap();
        let (observations, was_cached, told) = detect(&cache);
        assert!(!was_cached && !told.contains("error"), "{what}: {was_cached} {told}");
        assert!(observations == expected, "{what}");
        assert!(fs::read(&file).unwrap() == good, "{what}: not healed");
    }
    fs::remove_file(&file).unwrap();
    fs::create_dir(&file).unwrap();
    let (observations, was_cached, told) = detect(&cache);
    assert!(observations == expected && !was_cached && told.contains("DEPTHCAL_CACHE"), "{told}");

    // A cache that cannot be written: a file is in its place.
    let (observations, was_cached, told) = detect(&folder.path("captures/dataset.toml"));
    assert!(observations == expected && !was_cached, "{told}");
    assert!(told.contains("dataset.toml") && told.contains("not cached") && told.contains("DEPTHCAL_CACHE"), "{told}");
}

#[test]
fn two_runs_at_once_give_the_same() {
    let folder = captures();
    let cache = folder.path("cache");
    let captures = folder.arg("captures");
    let start = |out: &str| {
        let mut run = command(["calibrate", &captures, "--out", &folder.arg(out)]);
        run.env("DEPTHCAL_CACHE", &cache).stdout(std::process::Stdio::null()).spawn().unwrap()
    };
    // Two folders, and two runs into one of them.
    let mut runs = ["a", "b", "b"].map(start);
    for run in &mut runs {
        assert!(run.wait().unwrap().success());
    }
    assert_same(&records(&folder.path("a")), &records(&folder.path("b")));
    assert_eq!(folder.names("a"), folder.names("b"));
    assert_eq!(support::names(&cache).len(), 1);
    let output = succeeds_with(&cache, &["calibrate", &captures, "--out", &folder.arg("c")]);
    assert!(stdout(&output).contains("(cached)"));
    assert_same(&records(&folder.path("a")), &records(&folder.path("c")));
}

fn set_date(path: &Path, date: SystemTime) {
    let file = fs::File::options().write(true).open(path).unwrap();
    file.set_modified(date).unwrap();
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let inside = support::names(folder).into_iter().map(|name| folder.join(name));
    inside.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

/// Dates in the future, as after a clock was set back, and dates long ago.
#[test]
fn dates_of_files_change_nothing() {
    let folder = captures();
    let cache = folder.path("cache");
    let calibrate = |out: &str| {
        let output = succeeds_with(&cache, &["calibrate", &folder.arg("captures"), "--out", &folder.arg(out)]);
        (records(&folder.path(out)), stdout(&output).contains("(cached)"))
    };
    let (expected, _) = calibrate("out");
    let year = Duration::from_secs(365 * 86_400);
    for [of_captures, of_rest] in [
        [SystemTime::now() + year, SystemTime::UNIX_EPOCH + year],
        [SystemTime::UNIX_EPOCH + year, SystemTime::now() + year],
    ] {
        files(&folder.path("captures")).iter().for_each(|file| set_date(file, of_captures));
        files(&cache).iter().chain(&files(&folder.path("out"))).for_each(|file| set_date(file, of_rest));
        let (records, was_cached) = calibrate("out");
        assert!(was_cached);
        assert_same(&expected, &records);
    }
}

/// An interrupted `apply` goes on with what was computed from the same files by the same calibration, whatever the dates are.
#[test]
fn apply_goes_on_by_contents_not_by_dates() {
    let folder = Folder::new();
    folder.write("calibration.json", CALIBRATION);
    folder.write("other.json", CALIBRATION.replace("1.02", "1.10"));
    for name in ["a", "b", "c"] {
        write_depth(folder.path(&format!("depth/{name}.png")), &depth(1000)).unwrap();
    }
    let arguments = |calibration: &str, out: &str| {
        ["apply", &folder.arg(calibration), &folder.arg("depth"), "--unit-mm", "1", "--out", &folder.arg(out)]
            .map(str::to_owned)
    };
    let apply = |calibration: &str, out: &str| stdout(&succeeds(arguments(calibration, out)));
    // An earlier run with another calibration was complete.
    apply("other.json", "out");
    apply("calibration.json", "expected");
    let expected = |name: &str| read_depth(folder.path(&format!("expected/{name}.png"))).unwrap();
    // This one is interrupted at c.
    fs::remove_file(folder.path("out/c.png")).unwrap();
    folder.write("out/c.png/in the way", "");
    assert!(!support::run(arguments("calibration.json", "out")).status.success());
    fs::remove_dir_all(folder.path("out/c.png")).unwrap();
    // The results of the other calibration are newer than their input, and yet not those of this run.
    apply("other.json", "copies");
    fs::copy(folder.path("copies/c.png"), folder.path("out/c.png")).unwrap();
    // Another image takes the place of b, with an older date.
    write_depth(folder.path("depth/b.png"), &depth(2000)).unwrap();
    set_date(&folder.path("depth/b.png"), SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000));
    let text = apply("calibration.json", "out");
    assert!(text.contains("1 of 3 frames were complete already"), "{text}");
    apply("calibration.json", "expected");
    for name in ["a", "b", "c"] {
        assert!(read_depth(folder.path(&format!("out/{name}.png"))).unwrap() == expected(name), "{name}");
    }
    assert_eq!(folder.names("out"), ["a.png", "b.png", "c.png"]);
}
