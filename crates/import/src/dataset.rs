//! The description of an imported dataset.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use depthcal_io::{CameraSection, DATASET_FILE, DatasetFile, write_atomically};
use depthcal_model::Target;
use serde_json::{Value, json};

use crate::camera_info::CameraInfo;
use crate::error::ImportError;
use crate::guess::{Candidate, Chosen};
use crate::pick::Picked;
use crate::recording::{Recording, StreamInfo};

/// Summary of an import.
#[derive(Debug, Clone)]
pub struct Imported {
    /// Frames that were written.
    pub frames: usize,
    /// Images in the recording's stream.
    pub of_images: usize,
    /// Images that were searched for the board, and those that show it; `None` where there was no search.
    pub searched: Option<(usize, usize)>,
    /// The stream of the images.
    pub image: StreamInfo,
    /// The stream of the depth; `None` where there is none.
    pub depth: Option<StreamInfo>,
    /// Whether image and depth are declared as two cameras, since they differ in size or intrinsics.
    pub is_rig: bool,
    /// Whether the recording states the place of the depth sensor.
    pub has_extrinsics: bool,
    /// Millimetres per step or unit of the depth.
    pub unit_mm: Option<f64>,
    /// All streams of images, with their width and height, px.
    pub streams: Vec<(StreamInfo, [usize; 2])>,
    /// Intrinsics of the image that the recording carries.
    pub camera: Option<CameraInfo>,
    /// Intrinsics of the depth, where it has a camera of its own.
    pub depth_camera: Option<CameraInfo>,
    /// Files that are cut off, and were read up to their last complete message.
    pub cut: Vec<PathBuf>,
    /// Picked images that have no depth near in time, and were not written.
    pub without_depth: usize,
    /// Files that were written, without those of the frames.
    pub written: Vec<PathBuf>,
}

impl Imported {
    /// Counts, streams and declarations as JSON, for programs; the files that were written are left to the caller, who may have
    /// moved them.
    pub fn to_json(&self) -> Value {
        let stream = |(stream, [width, height]): &(StreamInfo, [usize; 2])| json!({ "name": stream.name, "type": stream.kind, "width": width, "height": height });
        json!({
            "frames": self.frames,
            "of_images": self.of_images,
            "searched": self.searched.map(|s| s.0),
            "with_board": self.searched.map(|s| s.1),
            "without_depth": self.without_depth,
            "image": self.image.name,
            "depth": self.depth.as_ref().map(|stream| &stream.name),
            "unit_mm": self.unit_mm,
            "is_rig": self.is_rig,
            "cut_off": self.cut,
            "streams": self.streams.iter().map(stream).collect::<Vec<_>>(),
        })
    }
}

/// The frames that were written: names and times.
#[derive(Debug)]
pub(crate) struct Written {
    pub frames: Vec<(String, u64)>,
    pub image_extension: &'static str,
    pub depth_extension: &'static str,
}

/// Writes `frames.csv`, `dataset.toml`, and the cameras' calibrations.
pub(crate) fn describe(
    recording: &Recording,
    chosen: &Chosen,
    picked: &Picked,
    of_frames: Written,
    board: Option<&Target>,
    out: &Path,
) -> Result<Imported, ImportError> {
    let Written { frames, image_extension, depth_extension } = of_frames;
    let mut written = Vec::new();
    let mut file = |name: &str, text: &[u8]| -> Result<(), ImportError> {
        let path = out.join(name);
        write_atomically(&path, |file| file.write_all(text))?;
        written.push(path);
        Ok(())
    };
    // Times count from the first frame: seconds since 1970 leave a float no microseconds.
    let first = frames.iter().map(|f| f.1).min().unwrap_or(0);
    let mut table = String::from("frame,timestamp_s\n");
    for (name, time_ns) in &frames {
        // Writing to a string cannot fail.
        let _ = writeln!(table, "{name},{:.6}", (time_ns - first) as f64 / 1e9);
    }
    file("frames.csv", table.as_bytes())?;
    let is_rig = chosen.is_rig();
    let depth_camera = chosen.depth.as_ref().filter(|_| is_rig);
    for (camera, name) in [(Some(&chosen.image), IMAGE_INFO), (depth_camera, DEPTH_INFO)] {
        if let Some((camera, info)) = camera.and_then(|camera| Some((camera, camera.info.as_ref()?))) {
            file(name, info.yaml(&camera.stream.name).as_bytes())?;
        }
    }
    if let Some(factory) = &chosen.factory {
        file("factory_calibration.json", factory)?;
    }

    let invalid = |error: &dyn std::fmt::Display| ImportError::Message {
        path: recording.path.clone(),
        stream: chosen.image.stream.name.clone(),
        problem: format!("dataset.toml cannot be written: {error}"),
    };
    let placeholder = Target { pattern: depthcal_model::Pattern::Chessboard, columns: 2, rows: 2, spacing_mm: 1.0 };
    let description = description(chosen, board.cloned().unwrap_or(placeholder), [image_extension, depth_extension]);
    let text = description.to_toml().map_err(|error| invalid(&error))?;
    // A file that could not be read back is not written.
    DatasetFile::parse(&out.join(DATASET_FILE), &text).map_err(|error| invalid(&error))?;
    let text = match board {
        Some(_) => text,
        None => {
            let start = text.find("[frames]").or(text.find("[cameras.")).unwrap_or(0);
            format!(
                "# The board is not known: describe it here, for example\n# [board]\n# kind = \"charuco\"\n# columns = 9\n# rows = 6\n# \
                 spacing_mm = 24.0\n# marker_mm = 18.0\n# dictionary = \"DICT_5X5_100\"\n\n{}",
                &text[start..]
            )
        }
    };
    file(DATASET_FILE, text.as_bytes())?;
    Ok(Imported {
        frames: frames.len(),
        of_images: picked.of,
        searched: picked.searched,
        image: chosen.image.stream.clone(),
        depth: chosen.depth.as_ref().map(|depth| depth.stream.clone()),
        streams: chosen.candidates.iter().map(|c| (c.stream.clone(), c.size)).collect(),
        is_rig,
        has_extrinsics: is_rig && chosen.depth_from_image.is_some(),
        unit_mm: chosen.depth.as_ref().map(|depth| depth.unit_mm),
        camera: chosen.image.info.clone(),
        depth_camera: depth_camera.and_then(|depth| depth.info.clone()),
        cut: recording.cut(),
        without_depth: picked.images.len() - frames.len(),
        written,
    })
}

/// Files of intrinsics, of the image and of depth with a camera of its own.
const IMAGE_INFO: &str = "camera_info.yaml";
const DEPTH_INFO: &str = "camera_info_depth.yaml";

/// The description of the dataset, with the extensions of its images and of its depth.
fn description(chosen: &Chosen, board: Target, [image_extension, depth_extension]: [&str; 2]) -> DatasetFile {
    let hint = |camera: &Candidate, file: &str| camera.info.as_ref().map(|info| info.hint(file));
    let image = CameraSection {
        image: Some(format!("image/*.{image_extension}")),
        camera: hint(&chosen.image, IMAGE_INFO),
        ..CameraSection::default()
    };
    let files = |depth: &Candidate| (Some(format!("depth/*.{depth_extension}")), Some(depth.unit_mm));
    let cameras = match &chosen.depth {
        None => vec![image],
        Some(depth) if chosen.is_rig() => {
            let (glob, unit_mm) = files(depth);
            let camera = hint(depth, DEPTH_INFO);
            let second = CameraSection {
                depth: glob,
                unit_mm,
                camera,
                name: "depth".into(),
                expected_from_rig: chosen.depth_from_image,
                ..CameraSection::default()
            };
            vec![CameraSection { name: "image".into(), ..image }, second]
        }
        Some(depth) => {
            let (glob, unit_mm) = files(depth);
            vec![CameraSection { depth: glob, unit_mm, ..image }]
        }
    };
    DatasetFile { board, metadata: Some("frames.csv".into()), associations: None, within_s: None, cameras }
}
