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

/// The camera of the dataset in a folder.
fn open(folder: impl AsRef<Path>) -> Result<DatasetCamera, DatasetError> {
    Dataset::open(folder)?.into_only_camera()
}

fn complaint(folder: &tempfile::TempDir) -> String {
    open(folder.path()).unwrap_err().to_string()
}

#[test]
fn pairs_by_stem_in_natural_order() {
    let files = ["ir/f10.png", "ir/f9.png", "ir/.f9.png.tmp", "depth/f9.png", "depth/f10.png", "depth/.hidden.png"];
    let folder = make(PAIRED, &files);
    let dataset = open(folder.path()).unwrap();
    let names: Vec<_> = dataset.frames.iter().map(|frame| frame.name.as_str()).collect();
    assert_eq!(names, ["f9", "f10"]);
    assert!(dataset.frames[0].image.as_ref().unwrap().ends_with("ir/f9.png"));
    assert!(dataset.frames[0].depth.as_ref().unwrap().ends_with("depth/f9.png"));
    assert_eq!(dataset.depth_unit_mm, Some(1.0));
    assert_eq!(dataset.title, folder.path().file_name().unwrap().to_str().unwrap());
    assert_eq!(open(folder.path().join("dataset.toml")).unwrap(), dataset);
}

#[test]
fn folders_may_have_glob_characters_in_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("set [1]*");
    fs::create_dir_all(root.join("ir")).unwrap();
    fs::write(root.join("dataset.toml"), format!("{BOARD}[frames]\nimage = \"ir/*.png\"\n")).unwrap();
    fs::write(root.join("ir/a.png"), "").unwrap();
    let dataset = open(&root).unwrap();
    assert_eq!((dataset.frames.len(), dataset.title.as_str()), (1, "set [1]*"));
    assert_eq!(dataset.frames[0].depth, None);
}

#[test]
fn a_folder_without_description_is_named() {
    let folder = tempfile::tempdir().unwrap();
    assert!(complaint(&folder).contains("dataset.toml"));
    let message = open(folder.path().join("nowhere")).unwrap_err().to_string();
    assert!(message.contains("nowhere") && message.contains("[board]"), "{message}");
}

fn strays(dataset: &DatasetCamera) -> Vec<(&str, &str)> {
    dataset.strays.iter().map(|stray| (stray.name.as_str(), stray.reason.as_str())).collect()
}

#[test]
fn strays_are_listed() {
    let folder = make(PAIRED, &["ir/a.png", "ir/b.png", "depth/b.png", "depth/c.png"]);
    let dataset = open(folder.path()).unwrap();
    assert_eq!(dataset.frames.iter().map(|f| f.name.as_str()).collect::<Vec<_>>(), ["b"]);
    assert_eq!(
        strays(&dataset),
        [("depth/c.png", "no image pairs with it"), ("ir/a.png", "no depth image pairs with it")]
    );
    assert_eq!(dataset.pairing, Pairing::Stem);
}

#[test]
fn files_that_do_not_pair_at_all_are_an_error() {
    let message = complaint(&make(PAIRED, &["ir/a.png", "depth/c.png"]));
    assert!(message.contains("1 images without depth (\"a.png\")"), "{message}");
    assert!(message.contains("1 depth without image (\"c.png\")") && message.contains("within_s"), "{message}");
}

#[test]
fn an_image_is_not_its_own_depth() {
    let both = |glob: &str| PAIRED.replace("ir/*.png", glob).replace("depth/*.png", glob);
    let message = complaint(&make(&both("a/*.png"), &["a/1_ir.png", "a/1_depth.png"]));
    assert!(message.contains("as image and as depth"), "{message}");
    // An archive may hold both.
    assert!(open(make(&both("a/*.npz"), &["a/1.npz"]).path()).is_ok());
}

#[test]
fn prefixes_pair() {
    let folder = make(PAIRED, &["ir/rgb_1.png", "ir/rgb_2.png", "depth/depth_1.png", "depth/depth_2.png"]);
    let dataset = open(folder.path()).unwrap();
    let names: Vec<_> = dataset.frames.iter().map(|f| f.name.as_str()).collect();
    assert_eq!((names, dataset.pairing), (vec!["1", "2"], Pairing::Rest));
    assert!(dataset.frames[1].depth.as_ref().unwrap().ends_with("depth/depth_2.png"));
}

#[test]
fn nearest_times_pair() {
    let times = PAIRED.replace("[depth]", "within_s = 0.02\n[depth]");
    let folder = make(&times, &["ir/10.000.png", "ir/10.100.png", "depth/10.015.png", "depth/10.300.png"]);
    let dataset = open(folder.path()).unwrap();
    assert_eq!(dataset.frames.len(), 1);
    assert_eq!(dataset.frames[0].metadata.timestamp_s, Some(10.0));
    assert_eq!((dataset.strays.len(), dataset.pairing), (2, Pairing::Time { within_s: 0.02 }));
    let message = complaint(&make(&times, &["ir/a.png", "depth/10.015.png"]));
    assert!(message.contains("within_s") && message.contains("ir/a.png"), "{message}");
}

#[test]
fn lists_of_tum() {
    let sections = "[frames]\nimage = \"rgb.txt\"\ndepth = \"depth.txt\"\n[depth]\nunit_mm = 0.2\n";
    let folder = make(sections, &["rgb/1.0.png", "rgb/2.0.png", "depth/1.01.png", "depth/2.5.png"]);
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("rgb.txt", "# timestamp filename\n1.0 rgb/1.0.png\n2.0 rgb/2.0.png\n3.0 rgb/3.0.png\n");
    write("depth.txt", "1.01 depth/1.01.png\n2.5 depth/2.5.png\n");
    let dataset = open(folder.path()).unwrap();
    assert_eq!((dataset.frames.len(), dataset.frames[0].metadata.timestamp_s), (1, Some(1.0)));
    assert_eq!(
        strays(&dataset).iter().map(|s| s.0).collect::<Vec<_>>(),
        ["depth/2.5.png", "rgb/2.0.png", "rgb/3.0.png"]
    );
    let before = dataset.digest().unwrap();
    write("rgb.txt", "1.001 rgb/1.0.png\n");
    assert_ne!(open(folder.path()).unwrap().digest().unwrap(), before);

    let pairs = "[frames]\nassociations = \"associations.txt\"\n[depth]\nunit_mm = 0.2\n";
    fs::write(folder.path().join("dataset.toml"), format!("{BOARD}{pairs}")).unwrap();
    write("associations.txt", "2.0 rgb/2.0.png 2.5 depth/2.5.png\n3.0 rgb/3.0.png 3.1 depth/3.1.png\n");
    let dataset = open(folder.path()).unwrap();
    assert_eq!((dataset.frames.len(), dataset.pairing), (1, Pairing::Table));
    assert_eq!(dataset.strays[0].name, "rgb/3.0.png");
    fs::write(folder.path().join("dataset.toml"), format!("{BOARD}{}", pairs.replace("0.2", "0.2\n[camera]\n")))
        .unwrap();
    assert!(complaint(&folder).contains("camera.fx"));
    fs::write(
        folder.path().join("dataset.toml"),
        format!("{BOARD}{pairs}").replace("[depth]", "image = \"rgb/*.png\"\n[depth]"),
    )
    .unwrap();
    assert!(complaint(&folder).contains("frames.associations"));
    fs::write(folder.path().join("dataset.toml"), format!("{BOARD}[frames]\nassociations = \"associations.txt\"\n"))
        .unwrap();
    assert!(complaint(&folder).contains("depth.unit_mm"));
}

#[test]
fn tables_name_files() {
    let sections = "[frames]\nmetadata = \"frames.csv\"\n[depth]\nunit_mm = 1.0\n";
    let folder = make(sections, &["colour/a.png", "colour/b.png", "z/1.png", "z/2.png", "z/3.png"]);
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write(
        "frames.csv",
        "frame,image,depth,timestamp_s\none,colour/a.png,z/1.png,0.5\ntwo,colour/b.png,z/9.png,\nthree,,z/3.png,\n",
    );
    let dataset = open(folder.path()).unwrap();
    assert_eq!(dataset.frames.len(), 1);
    assert_eq!((dataset.frames[0].name.as_str(), dataset.frames[0].metadata.timestamp_s), ("one", Some(0.5)));
    assert!(dataset.frames[0].metadata.other.is_empty());
    assert_eq!(strays(&dataset), [("row three", "it names no image"), ("row two", "there is no file z/9.png")]);
    // With globs beside it, what the table does not name is a stray.
    fs::write(
        folder.path().join("dataset.toml"),
        format!("{BOARD}{}", sections.replace("[depth]", "depth = \"z/*.png\"\n[depth]")),
    )
    .unwrap();
    let dataset = open(folder.path()).unwrap();
    assert_eq!(dataset.strays.iter().filter(|s| s.reason.contains("no row")).count(), 2);
    // Depth without a unit.
    fs::write(folder.path().join("dataset.toml"), format!("{BOARD}[frames]\nmetadata = \"frames.csv\"\n")).unwrap();
    assert!(complaint(&folder).contains("depth.unit_mm"));
    // A table without columns of files, and no glob.
    write("frames.csv", "frame,timestamp_s\none,1\n");
    assert!(complaint(&folder).contains("frames.image"));
    write("frames.csv", "frame,image\none,nowhere.png\n");
    assert!(complaint(&folder).contains("nowhere.png"));
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
    let dataset = open(folder.path()).unwrap();
    assert_eq!(dataset.frames[0].metadata.timestamp_s, Some(0.5));
    assert_eq!(dataset.frames[1].metadata.number("gain"), Some(4.0));
    table("frame,timestamp_s\n2,1.5\n3,2.5\n");
    let dataset = open(folder.path()).unwrap();
    assert_eq!((dataset.frames.len(), dataset.frames[0].name.as_str()), (1, "2"));
    let expected = [("1", "frames.csv has no row of it"), ("row 3", "frames.csv has it, but there is no such frame")];
    assert_eq!(strays(&dataset), expected);
    table("frame,timestamp_s\n4,1.5\n");
    let message = complaint(&folder);
    assert!(message.contains("rows without a frame (\"4\")"), "{message}");
    assert!(message.contains("frames without a row (\"1\", \"2\")"), "{message}");
}

#[test]
fn the_digest_follows_the_contents() {
    let folder = make(PAIRED, &["ir/a.png", "depth/a.png"]);
    let digest = || open(folder.path()).unwrap().digest().unwrap();
    let before = digest();
    assert_eq!(before, digest());
    fs::write(folder.path().join("notes.txt"), "not part of it").unwrap();
    assert_eq!(before, digest());
    fs::write(folder.path().join("depth/a.png"), "changed").unwrap();
    assert_ne!(before, digest());
}

#[test]
fn no_glob_leads_out_of_the_folder() {
    for (field, sections) in [
        ("frames.image", "[frames]\nimage = \"../*.png\"\n"),
        ("frames.image", "[frames]\nimage = \"ir/../../*.png\"\n"),
        ("frames.image", "[frames]\nimage = \"/etc/*\"\n"),
        ("frames.image", "[frames]\nimage = \"../rgb.txt\"\n"),
        ("frames.depth", "[frames]\ndepth = \"/etc/*\"\n[depth]\nunit_mm = 1\n"),
        ("frames.metadata", "[frames]\nmetadata = \"../frames.csv\"\n"),
        ("frames.associations", "[frames]\nassociations = \"/a.txt\"\n[depth]\nunit_mm = 1\n"),
    ] {
        let message = complaint(&make(sections, &["ir/1.png"]));
        assert!(message.contains("dataset.toml:7") && message.contains(field), "{message}");
        assert!(message.contains("leads out") && message.contains("symbolic link"), "{message}");
    }
    let rig = make("[cameras.a]\nimage = \"../*.png\"\n", &[]);
    let message = Dataset::open(rig.path()).unwrap_err().to_string();
    assert!(message.contains("cameras.a.image") && message.contains("leads out"), "{message}");
}

#[test]
fn no_table_and_no_list_leads_out_of_the_folder() {
    let tabled = "[frames]\nmetadata = \"frames.csv\"\n";
    let listed = "[frames]\nimage = \"a/list.txt\"\n";
    let pairs = "[frames]\nassociations = \"a/list.txt\"\n[depth]\nunit_mm = 1\n";
    for (sections, table, text) in [
        (tabled, "frames.csv", "frame,image\n1,ir/1.png\n2,../2.png\n"),
        (tabled, "frames.csv", "frame,image\n1,ir/1.png\n2,/etc/passwd\n"),
        (listed, "a/list.txt", "1 ../ir/1.png\n2 ../../2.png\n"),
        (pairs, "a/list.txt", "1 ../ir/1.png 1 ../ir/1.png\n2 ../ir/1.png 2 /etc/passwd\n"),
    ] {
        let folder = make(sections, &["ir/1.png", table]);
        fs::write(folder.path().join(table), text).unwrap();
        let message = complaint(&folder);
        let line = text.lines().count();
        assert!(message.contains(&format!("{table}:{line}: ")) && message.contains("outside"), "{message}");
    }
    // Of cameras of a rig.
    let folder = make("[cameras.a]\nimage = \"ir/*.png\"\n[frames]\nmetadata = \"frames.csv\"\n", &["ir/1.png"]);
    fs::write(folder.path().join("frames.csv"), "frame,a.image\n1,ir/1.png\n2,../2.png\n").unwrap();
    let message = Dataset::open(folder.path()).unwrap_err().to_string();
    assert!(message.contains("frames.csv:3: ../2.png"), "{message}");
}

#[test]
fn absolute_paths_into_the_folder_and_parents_within_it_are_read() {
    let folder = make("[frames]\nmetadata = \"a/../frames.csv\"\n", &["ir/1.png"]);
    let image = folder.path().join("ir/1.png");
    fs::write(folder.path().join("frames.csv"), format!("frame,image\n1,{}\n2,ir/../ir/1.png\n", image.display()))
        .unwrap();
    let dataset = open(folder.path()).unwrap();
    assert!(dataset.frames.iter().all(|frame| frame.image.as_ref() == Some(&image)) && dataset.frames.len() == 2);
}

/// A link in the folder is its owner's; a parent behind a link is taken out before the link could give it another meaning.
#[cfg(unix)]
#[test]
fn links_in_the_folder_are_followed() {
    use std::os::unix::fs::symlink;
    let elsewhere = tempfile::tempdir().unwrap();
    fs::create_dir(elsewhere.path().join("ir")).unwrap();
    fs::write(elsewhere.path().join("ir/1.png"), "").unwrap();
    fs::write(elsewhere.path().join("2.png"), "").unwrap();
    let folder = make("[frames]\nimage = \"ir/*.png\"\n", &["3.png"]);
    symlink(elsewhere.path().join("ir"), folder.path().join("ir")).unwrap();
    let dataset = open(folder.path()).unwrap();
    assert_eq!(dataset.frames[0].image, Some(folder.path().join("ir/1.png")));
    let parent = format!("{BOARD}[frames]\nimage = \"ir/../*.png\"\n");
    fs::write(folder.path().join("dataset.toml"), parent).unwrap();
    let names: Vec<_> = open(folder.path()).unwrap().frames.into_iter().map(|frame| frame.name).collect();
    assert_eq!(names, ["3"]);
    // Folders that contain themselves end.
    symlink(folder.path(), folder.path().join("again")).unwrap();
    let all = format!("{BOARD}[frames]\nimage = \"**/3.png\"\n");
    fs::write(folder.path().join("dataset.toml"), all).unwrap();
    let _ = open(folder.path());
}

#[cfg(unix)]
#[test]
fn intrinsics_may_lie_outside_but_are_a_regular_file() {
    let folder = make("[frames]\nimage = \"ir/*.png\"\n[camera]\nintrinsics = \"../camera.yml\"\n", &["ir/1.png"]);
    let dataset = open(folder.path()).unwrap();
    assert_eq!(dataset.intrinsics_file(), Some(folder.path().join("../camera.yml")));
    let endless = make("[frames]\nimage = \"ir/*.png\"\n[camera]\nintrinsics = \"/dev/zero\"\n", &["ir/1.png"]);
    assert!(complaint(&endless).contains("/dev/zero: cannot read: camera.intrinsics has to name a regular file"));
}

/// Opens a dataset with these files and this table.
fn rig(declaration: &str, files: &[&str], table: Option<&str>) -> Result<Dataset, DatasetError> {
    let folder = make(declaration, files);
    if let Some(table) = table {
        fs::write(folder.path().join("frames.csv"), table).unwrap();
    }
    Dataset::open(folder.path())
}

fn names(rig: &Dataset, camera: usize) -> Vec<&str> {
    rig.cameras[camera].frames.iter().map(|f| f.name.as_str()).collect()
}

const TWO: &str =
    "[cameras.ir]\nimage = \"ir/*.png\"\ndepth = \"d/*.png\"\nunit_mm = 1\n[cameras.rgb]\nimage = \"rgb/*.png\"\n";
const WITH_TABLE: &str = "[frames]\nmetadata = \"frames.csv\"\n";

#[test]
fn frames_that_a_camera_missed_count_for_the_others() {
    let files = ["ir/1.png", "ir/2.png", "d/1.png", "d/2.png", "rgb/2.png", "rgb/3.png"];
    let rig = rig(TWO, &files, None).unwrap();
    assert_eq!((names(&rig, 0), names(&rig, 1)), (vec!["1", "2"], vec!["2", "3"]));
    assert!(rig.cameras.iter().all(DatasetCamera::has_images) && !rig.cameras[1].has_depth());
    assert_eq!(rig.cameras[0].depth_unit_mm, Some(1.0));
    assert_eq!(rig.cameras[1].title, format!("{}/rgb", rig.name));
    assert!(rig.into_only_camera().unwrap_err().to_string().contains("several cameras"));
}

#[test]
fn frames_of_cameras_are_matched_by_numbers_by_times_and_by_tables() {
    let files = ["ir/ir_1.png", "ir/ir_2.png", "d/d_1.png", "d/d_2.png", "rgb/rgb_02.png"];
    let numbered = rig(TWO, &files, None).unwrap();
    assert_eq!(names(&numbered, 1), vec![names(&numbered, 0)[1]]);
    let files = ["ir/1.00.png", "ir/2.00.png", "d/1.001.png", "d/2.001.png", "rgb/2.012.png", "rgb/2.5.png"];
    let timed = rig(&format!("{TWO}[frames]\nwithin_s = 0.02\n"), &files, None).unwrap();
    assert_eq!((names(&timed, 0), names(&timed, 1)), (vec!["1.00", "2.00"], vec!["2.00", "2.5"]));
    let table =
        "frame,timestamp_s,ir.image,ir.depth,rgb.image\na,1,ir/x.png,d/x.png,\nb,2,,,rgb/y.png\nc,3,ir/x.png,,\n";
    let tabled = format!("{TWO}{WITH_TABLE}");
    let by_table = rig(&tabled, &["ir/x.png", "d/x.png", "rgb/y.png"], Some(table)).unwrap();
    assert_eq!((names(&by_table, 0), names(&by_table, 1)), (vec!["a"], vec!["b"]));
    // As for one camera, what a row lacks is told; that another camera alone has the frame is none of it.
    assert_eq!(strays(&by_table.cameras[0]), [("row c", "it names no depth image")]);
    assert!(by_table.cameras[1].strays.is_empty());
    let metadata = &by_table.cameras[1].frames[0].metadata;
    assert!(metadata.timestamp_s == Some(2.0) && metadata.other.is_empty());
    let files = ["ir/x.png", "d/x.png", "rgb/y.png"];
    let lacking = rig(&tabled, &files, Some("frame,ir.image\nx,ir/x.png\n")).unwrap_err().to_string();
    assert!(lacking.contains("rgb.image"), "{lacking}");
}

#[test]
fn rows_belong_to_frames_of_any_camera() {
    let files = ["ir/1.png", "ir/2.png", "d/1.png", "d/2.png", "rgb/2.png", "rgb/3.png"];
    let tabled = format!("{TWO}{WITH_TABLE}");
    let dataset = rig(&tabled, &files, Some("frame,temperature_c\n1,20\n3,30\n7,40\n")).unwrap();
    assert_eq!((names(&dataset, 0), names(&dataset, 1)), (vec!["1"], vec!["3"]));
    assert_eq!(dataset.cameras[1].frames[0].metadata.temperature_c, Some(30.0));
    let expected = [("2", "frames.csv has no row of it"), ("row 7", "frames.csv has it, but there is no such frame")];
    assert_eq!(strays(&dataset.cameras[0]), expected);
    let message = rig(&tabled, &files, Some("frame,temperature_c\n1,20\n")).unwrap_err().to_string();
    assert!(message.contains("frames without a row (\"2\", \"3\")"), "{message}");
}

#[test]
fn backslashes_between_folders_are_named() {
    let message = complaint(&make(&PAIRED.replace("ir/*.png", "ir\\\\*.png"), &["ir/1.png", "depth/1.png"]));
    assert!(message.contains("write / between folders") && message.contains("ir/*.png"), "{message}");
}
