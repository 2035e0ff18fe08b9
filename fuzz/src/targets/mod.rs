//! One function per target. Each reads the bytes as the commands read a file, and panics only where depthcal is at fault.

mod camera_file;
mod corners;
mod dataset;
mod formula;
mod image;
mod memory_folder;
mod problem;
mod record;
mod recording;
mod spec;

/// A target: its name, which is that of its folder in `corpus/`, and what it does with the bytes.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const ALL: &[Target] = &[
    ("bag", recording::bag),
    ("bal", problem::bal),
    ("calibration", record::calibration),
    ("camera_colmap", camera_file::camera_file),
    ("camera_yaml", camera_file::camera_file),
    ("corners", corners::corners),
    ("dataset_toml", dataset::dataset_toml),
    ("db3", recording::db3),
    ("exr", image::image),
    ("formula_file", formula::formula_file),
    ("formula_text", formula::formula_text),
    ("frame_lists", dataset::frame_lists),
    ("frames_table", dataset::frames_table),
    ("g2o", problem::g2o),
    ("jpeg", image::image),
    ("mcap", recording::mcap),
    ("mkv", recording::mkv),
    ("npy", image::image),
    ("npz", image::image),
    ("png", image::image),
    ("pnm", image::image),
    ("records", record::records),
    ("spec", spec::spec),
    ("tiff", image::image),
];

/// Calls the target `name`.
///
/// # Panics
/// Where there is no such target, or depthcal is at fault.
pub fn run(name: &str, bytes: &[u8]) {
    let (_, target) = ALL.iter().find(|(known, _)| *known == name).unwrap_or_else(|| panic!("no target {name}"));
    target(bytes);
}
