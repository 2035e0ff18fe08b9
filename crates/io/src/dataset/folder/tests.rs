use std::fs;

use super::*;

const BOARD: &str = "[board]\nkind = \"chessboard\"\ncolumns = 5\nrows = 7\nspacing_mm = 30\n";
const PAIRED: &str = "[frames]\nimage = \"ir/*.png\"\ndepth = \"depth/*.png\"\n[depth]\nunit_mm = 1.0\n";

/// A dataset in a temporary folder; the files are empty, as opening reads no images.
fn make(sections: &str, files: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("dataset.toml"), format!("{BOARD}{sections}")).unwrap();
    for file in files {
        let path = folder.path().join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, file).unwrap();
    }
    folder
}

fn complaint(folder: &tempfile::TempDir) -> String {
    Dataset::open(folder.path()).unwrap_err().to_string()
}

#[test]
fn pairs_by_stem_in_natural_order() {
    let files = ["ir/f10.png", "ir/f9.png", "ir/.f9.png.tmp", "depth/f9.png", "depth/f10.png", "depth/.hidden.png"];
    let folder = make(PAIRED, &files);
    let dataset = Dataset::open(folder.path()).unwrap();
    let names: Vec<_> = dataset.frames.iter().map(|frame| frame.name.as_str()).collect();
    assert_eq!(names, ["f9", "f10"]);
    assert!(dataset.frames[0].image.as_ref().unwrap().ends_with("ir/f9.png"));
    assert!(dataset.frames[0].depth.as_ref().unwrap().ends_with("depth/f9.png"));
    assert_eq!(dataset.depth_unit_mm, Some(1.0));
    assert_eq!(dataset.name, folder.path().file_name().unwrap().to_str().unwrap());
    assert_eq!(Dataset::open(folder.path().join("dataset.toml")).unwrap(), dataset);
    assert!(dataset.frame("f9").is_some() && dataset.frame("f11").is_none());
}

#[test]
fn folders_may_have_glob_characters_in_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("set [1]*");
    fs::create_dir_all(root.join("ir")).unwrap();
    fs::write(root.join("dataset.toml"), format!("{BOARD}[frames]\nimage = \"ir/*.png\"\n")).unwrap();
    fs::write(root.join("ir/a.png"), "").unwrap();
    let dataset = Dataset::open(&root).unwrap();
    assert_eq!((dataset.frames.len(), dataset.name.as_str()), (1, "set [1]*"));
    assert_eq!(dataset.frames[0].depth, None);
}

#[test]
fn a_folder_without_description_is_named() {
    let folder = tempfile::tempdir().unwrap();
    assert!(complaint(&folder).contains("dataset.toml"));
    let message = Dataset::open(folder.path().join("nowhere")).unwrap_err().to_string();
    assert!(message.contains("nowhere") && message.contains("[board]"), "{message}");
}

#[test]
fn unpaired_frames_are_listed() {
    let folder = make(PAIRED, &["ir/a.png", "ir/b.png", "depth/b.png", "depth/c.png"]);
    let message = complaint(&folder);
    assert!(message.contains("1 images without depth (\"a\")"), "{message}");
    assert!(message.contains("1 depth without image (\"c\")"), "{message}");
}

#[test]
fn duplicate_stems_name_both_files() {
    let folder = make("[frames]\nimage = \"ir/*.*\"\n", &["ir/a.png", "ir/a.jpg"]);
    let message = complaint(&folder);
    assert!(message.contains("a.png") && message.contains("a.jpg") && message.contains("frames.image"), "{message}");
}

#[test]
fn a_glob_without_files_is_named() {
    let folder = make(PAIRED, &["ir/a.png"]);
    let message = complaint(&folder);
    assert!(message.contains("frames.depth") && message.contains("depth/*.png"), "{message}");
    let folder = make("[frames]\nimage = \"ir/***.png\"\n", &["ir/a.png"]);
    assert!(complaint(&folder).contains("not a glob"));
}

#[test]
fn metadata_belongs_to_frames() {
    let sections = "[frames]\nimage = \"ir/*.png\"\nmetadata = \"frames.csv\"\n";
    let folder = make(sections, &["ir/1.png", "ir/2.png"]);
    let table = |text: &str| fs::write(folder.path().join("frames.csv"), text).unwrap();
    assert!(complaint(&folder).contains("frames.csv"));
    table("frame,timestamp_s,temperature_c,gain\n2,1.5,30,4\n1.png,0.5,,\n");
    let dataset = Dataset::open(folder.path()).unwrap();
    assert_eq!(dataset.frames[0].metadata.timestamp_s, Some(0.5));
    assert_eq!(dataset.frames[1].metadata.number("gain"), Some(4.0));
    table("frame,timestamp_s\n2,1.5\n3,2.5\n");
    let message = complaint(&folder);
    assert!(message.contains("rows without a frame (\"3\")"), "{message}");
    assert!(message.contains("frames without a row (\"1\")"), "{message}");
}

#[test]
fn the_digest_follows_the_contents() {
    let folder = make(PAIRED, &["ir/a.png", "depth/a.png"]);
    let digest = || Dataset::open(folder.path()).unwrap().digest().unwrap();
    let before = digest();
    assert_eq!(before, digest());
    fs::write(folder.path().join("notes.txt"), "not part of it").unwrap();
    assert_eq!(before, digest());
    fs::write(folder.path().join("depth/a.png"), "changed").unwrap();
    assert_ne!(before, digest());
}
