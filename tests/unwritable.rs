//! Disks that are full, folders that cannot be written, things in the way, and runs that fail: earlier results stay as they were,
//! and the message names the path and the remedy.

#![cfg(all(unix, feature = "cli", feature = "detect"))]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::support::measured::skipped;
use crate::support::{
    self, CALIBRATION, Folder, calibration_with_unit, command, depth, fails, run, stderr, stdout, succeeds,
};

/// Contents of all files of a folder by path.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for name in crate::support::names(folder) {
        let path = folder.join(name);
        if path.is_dir() {
            files.extend(contents(&path));
        } else {
            files.insert(path.clone(), std::fs::read(&path).unwrap());
        }
    }
    files
}

/// Inputs of the commands below.
fn inputs() -> Folder {
    let folder = Folder::new();
    folder.write("calibration.json", calibration_with_unit(1.0));
    for name in ["a", "b"] {
        depthcal::io::write_depth(folder.path(&format!("depth/{name}.png")), &depth(1000)).unwrap();
    }
    succeeds(["simulate", "--kind", "plywood1", "--frames", "7", "--out", &folder.arg("captures")]);
    folder
}

/// Commands that write into the folder `out`, which has results already; the words by which a file of theirs is named.
fn commands(folder: &Folder) -> Vec<Vec<String>> {
    let [calibration, depth, captures, out] =
        ["calibration.json", "depth", "captures", "out"].map(|name| folder.arg(name));
    let [camera, board] = ["out/camera.yml", "out/board.pdf"].map(|name| folder.arg(name));
    let list = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect();
    vec![
        list(&["export", &calibration, "--format", "opencv", "--out", &camera]),
        list(&["board", "--kind", "chessboard", "--out", &board]),
        list(&["apply", &calibration, &depth, "--out", &out]),
        list(&["calibrate", &captures, "--no-cache", "--out", &out]),
        list(&["man", "--out", &out]),
    ]
}

/// Runs a command that cannot write: it says so with the folder and the remedy, and changes nothing.
fn cannot_write(folder: &Folder, run: impl Fn(&[String]) -> Output, parts: &[&str]) {
    let before = contents(&folder.path("out"));
    for arguments in commands(folder) {
        let output = run(&arguments);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
        assert!(message.contains(&folder.arg("out")), "{arguments:?}: {message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{arguments:?}: {message}");
        // What `apply` has done, the next run does not do again.
        std::fs::remove_file(folder.path("out/.depthcal-apply.journal")).ok();
        assert!(
            contents(&folder.path("out")) == before,
            "{arguments:?} changed {:?}",
            support::names(&folder.path("out"))
        );
    }
}

#[test]
fn a_limit_of_file_sizes_leaves_earlier_results() {
    let folder = inputs();
    for arguments in commands(&folder) {
        succeeds(&arguments);
    }
    folder.write(
        "calibration.json",
        CALIBRATION.replace("60.0", "61.0").replace("\"frames\": []", "\"depth_unit_mm\": 1, \"frames\": []"),
    );
    // No file may have contents at all. The signal that would end the program is ignored, as services do.
    let limited = |arguments: &[String]| {
        let program = command(["--version"]).get_program().to_owned();
        let mut shell = Command::new("sh");
        shell.args(["-c", "trap '' XFSZ; ulimit -f 0; exec \"$@\"", "sh"]).arg(program).args(arguments);
        shell.output().unwrap()
    };
    cannot_write(&folder, limited, &["ulimit", "unchanged"]);
}

/// Mounts a small file system in memory on the folder `out`; `false` where this user may not.
fn mounted(folder: &Folder, options: &str) -> Option<Mount> {
    std::fs::create_dir_all(folder.path("out")).unwrap();
    let mut mount = Command::new("mount");
    mount.args(["-t", "tmpfs", "-o", options, "tmpfs", &folder.arg("out")]);
    match mount.output() {
        Ok(output) if output.status.success() => Some(Mount(folder.path("out"))),
        _ => {
            skipped("a file system in memory cannot be mounted: run it as root");
            None
        }
    }
}

struct Mount(PathBuf);

impl Drop for Mount {
    fn drop(&mut self) {
        Command::new("umount").arg(&self.0).status().ok();
    }
}

#[test]
fn a_full_disk_leaves_earlier_results() {
    let folder = inputs();
    let Some(_mount) = mounted(&folder, "size=40m") else { return };
    for arguments in commands(&folder) {
        succeeds(&arguments);
    }
    // Some kilobytes are left: small files can be written, the report cannot.
    let mut filler = std::fs::File::create(folder.path("out/filler")).unwrap();
    let block = [1; 4096];
    while std::io::Write::write_all(&mut filler, &block).is_ok() {}
    let length = filler.metadata().unwrap().len();
    filler.set_len(length - 8 * 4096).unwrap();
    let calibrate = &commands(&folder)[3];
    let before = contents(&folder.path("out"));
    let output = run(calibrate);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("No space left") && message.contains("unchanged"), "{message}");
    assert!(message.contains(&folder.arg("out")) && !message.contains(".depthcal.tmp"), "{message}");
    assert!(message.contains("out/calibration.json") && message.contains("of an earlier run"), "{message}");
    assert!(contents(&folder.path("out")) == before);
    // Nothing is left at all.
    filler.set_len(length).unwrap();
    while std::io::Write::write_all(&mut filler, &[1]).is_ok() {}
    cannot_write(&folder, |arguments| run(arguments), &["No space left", "another disk"]);
}

#[test]
fn a_folder_that_is_read_only_is_named_before_the_work() {
    let folder = inputs();
    let Some(_mount) = mounted(&folder, "size=40m") else { return };
    for arguments in commands(&folder) {
        succeeds(&arguments);
    }
    let remounted = Command::new("mount").args(["-o", "remount,ro", &folder.arg("out")]).status().unwrap();
    assert!(remounted.success());
    cannot_write(&folder, |arguments| run(arguments), &["Read-only", "give a folder that you may write"]);
    let calibrate = &commands(&folder)[3];
    assert!(!stdout(&run(calibrate)).contains("the board was found"), "the folder is checked first");
}

#[test]
fn things_in_the_way_are_named() {
    let folder = inputs();
    let [calibration, depth, captures] = ["calibration.json", "depth", "captures"].map(|name| folder.arg(name));
    folder.write("file", "a file");
    for out in ["file", "file/within"] {
        let out = folder.arg(out);
        let parts = ["file: ", "give another folder"];
        fails(["calibrate", &captures, "--no-cache", "--out", &out], &parts);
        fails(["apply", &calibration, &depth, "--out", &out], &parts);
        fails(["simulate", "--frames", "1", "--out", &out], &["file"]);
    }
    assert_eq!(std::fs::read(folder.path("file")).unwrap(), b"a file");
    std::fs::create_dir_all(folder.path("out/report.html")).unwrap();
    std::fs::create_dir_all(folder.path("out/camera.yml")).unwrap();
    let out = folder.arg("out");
    fails(["calibrate", &captures, "--no-cache", "--out", &out], &["report.html", "a folder", "move the folder away"]);
    fails(
        ["export", &calibration, "--format", "opencv", "--out", &folder.arg("out/camera.yml")],
        &["camera.yml", "folder"],
    );
    assert_eq!(folder.names("out"), ["camera.yml", "report.html"]);
}

/// A run that fails leaves an earlier calibration, says so, and ends with its exit code.
#[test]
fn a_failed_run_speaks_of_earlier_results() {
    let folder = inputs();
    let [captures, out] = ["captures", "out"].map(|name| folder.arg(name));
    let calibrate = |more: &[&str]| {
        run([&["calibrate", captures.as_str(), "--no-cache", "--out", out.as_str()][..], more].concat())
    };
    // Without earlier results there is nothing to speak of.
    let output = calibrate(&["--model", "projectivo"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(!stderr(&output).contains("earlier") && !folder.path("out").exists());
    assert!(calibrate(&[]).status.success());
    let before = contents(&folder.path("out"));

    // So few frames do not determine so many parameters.
    for (arguments, code) in [
        (vec!["calibrate", &captures, "--with", "nothing_like_it", "--out", &out], 1),
        (vec!["calibrate", &folder.arg("lost"), "--out", &out], 1),
        (vec!["calibrate", &captures, "--no-cache", "--lens", "opencv14", "--out", &out], 2),
        (vec!["diagnose", &captures, "--no-cache", "--lens", "opencv14", "--out", &out], 2),
    ] {
        let output = run(&arguments);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
        assert!(message.contains("nothing was written") && message.contains("out/calibration.json"), "{message}");
        assert!(message.contains("of an earlier run"), "{message}");
        assert!(contents(&folder.path("out")) == before, "{arguments:?}");
        let output = run([&arguments[..], &["--json"]].concat());
        let value: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
        assert_eq!(value["exit_code"], code);
        assert!(value["of_an_earlier_run"][0].as_str().unwrap().ends_with("calibration.json"), "{value}");
    }
}

/// Files about a calibration do not outlast it.
#[test]
fn a_new_calibration_takes_the_diagnosis_of_the_earlier_one_away() {
    let folder = inputs();
    let [captures, out] = ["captures", "out"].map(|name| folder.arg(name));
    succeeds(["calibrate", &captures, "--no-cache", "--out", &out]);
    folder.write("out/diagnosis.json", "{}").write("out/notes.txt", "mine");
    let text = stdout(&succeeds(["calibrate", &captures, "--no-cache", "--model", "none", "--out", &out]));
    assert!(text.contains("removed: ") && text.contains("diagnosis.json"), "{text}");
    let names = folder.names("out");
    assert!(!names.contains(&"diagnosis.json".to_owned()) && names.contains(&"notes.txt".to_owned()), "{names:?}");
}
