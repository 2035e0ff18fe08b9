//! The folders of Stray Scanner, which records a phone's LiDAR: depth in mm as PNG, confidences, intrinsics, and times of frames.
//! Its images are a video, whose frames have to be extracted by another program.

use std::collections::BTreeMap;
use std::path::Path;

use super::files::{
    DEPTH_FILES, FileFrame, FileStream, IMAGE_FILES, IMAGES, Stored, depth_size, fault, image_size, nanoseconds,
    numbered_files, pinhole, scaled, text_of,
};
use crate::camera_info::CameraInfo;
use crate::error::ImportError;
use crate::recording::StreamInfo;

/// Folders in which the frames of the video are looked for.
const FRAMES: [&str; 5] = ["rgb", "frames", "images", "image", "color"];

/// The streams of a folder; `None` where it is not one of Stray Scanner.
pub(super) fn open(folder: &Path) -> Result<Option<Vec<FileStream>>, ImportError> {
    let [matrix, odometry] = ["camera_matrix.csv", "odometry.csv"].map(|name| folder.join(name));
    if !matrix.is_file() || !folder.join("depth").is_dir() {
        return Ok(None);
    }
    let times = times(&odometry)?;
    let depths = numbered_files(&folder.join("depth"), &["png", "npy"])?;
    let Some((first_depth, depth_file)) = depths.first() else {
        return Err(fault(&folder.join("depth"), "there is no depth in it: copy or record it anew"));
    };
    let (images, images_folder) = images(folder, *first_depth, times.len())?;
    let [of_image, of_depth] = [image_size(&images[0].1)?, depth_size(depth_file)?];
    if (of_image[0] > of_image[1]) != (of_depth[0] > of_depth[1]) {
        return Err(fault(
            &images_folder,
            "the images are turned by 90° against the depth: extract them as they were recorded, with ffmpeg -noautorotate",
        ));
    }
    let camera = intrinsics(&matrix, of_image)?;
    let of_depth = camera.as_ref().map(|camera| scaled(camera, of_depth));
    let frames = |files: Vec<(u64, std::path::PathBuf)>,
                  confidences: Option<&Path>|
     -> Result<Vec<FileFrame>, ImportError> {
        let frame = |(number, path): (u64, std::path::PathBuf)| {
            let time_ns = *times.get(&number).ok_or_else(|| {
                fault(&odometry, format!("it has no time of frame {number}, which is {}: copy it anew", path.display()))
            })?;
            let confidence = confidences.zip(path.file_name()).map(|(folder, name)| folder.join(name));
            Ok(FileFrame { time_ns, confidence: confidence.filter(|path| path.is_file()), path })
        };
        files.into_iter().map(frame).collect()
    };
    let stream = |name: &str, kind: &str, unit_mm, camera, frames| FileStream {
        info: StreamInfo { name: name.to_owned(), kind: kind.to_owned() },
        stored: Stored::File,
        unit_mm,
        camera,
        frames,
    };
    Ok(Some(vec![
        stream("rgb", IMAGE_FILES, None, camera, frames(images, None)?),
        stream("depth", DEPTH_FILES, Some(1.0), of_depth, frames(depths, Some(&folder.join("confidence")))?),
    ]))
}

/// The frames of the video by their numbers, and their folder.
fn images(
    folder: &Path,
    first_depth: u64,
    count: usize,
) -> Result<(Vec<(u64, std::path::PathBuf)>, std::path::PathBuf), ImportError> {
    for name in FRAMES.map(|name| folder.join(name)).iter().filter(|name| name.is_dir()) {
        let mut images = numbered_files(name, &IMAGES)?;
        let Some((first, _)) = images.first() else { continue };
        // ffmpeg counts from 1, the app from 0.
        if *first == first_depth + 1 && images.len() == count {
            tracing::warn!(
                "{}: the images are numbered from {first}, the depth from {first_depth}: taken for the same frames",
                name.display()
            );
            images.iter_mut().for_each(|(number, _)| *number -= 1);
        }
        return Ok((images, name.clone()));
    }
    let video = folder.join("rgb.mp4");
    let (path, what) = match video.is_file() {
        true => (video.as_path(), "the images are a video, which is not decoded here"),
        false => (folder, "there are neither images nor rgb.mp4"),
    };
    Err(fault(
        path,
        format!(
            "{what}: extract its frames to {} with ffmpeg -noautorotate -i rgb.mp4 -start_number 0 rgb/%06d.png",
            folder.join("rgb").display()
        ),
    ))
}

/// Times by the numbers of frames.
fn times(odometry: &Path) -> Result<BTreeMap<u64, u64>, ImportError> {
    let text = text_of(odometry)?;
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap_or_default().split(',').map(str::trim).collect();
    let place = |name: &str| head.iter().position(|column| *column == name);
    let (Some(time), Some(frame)) = (place("timestamp"), place("frame")) else {
        return Err(fault(odometry, "its first line has no columns timestamp and frame: copy it anew"));
    };
    let mut times = BTreeMap::new();
    for (number, line) in (2..).zip(lines).filter(|(_, line)| !line.trim().is_empty()) {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let cell = |place: usize| cells.get(place).copied().unwrap_or_default();
        let values = cell(time).parse().ok().and_then(nanoseconds).zip(cell(frame).parse::<u64>().ok());
        let Some((time_ns, frame)) = values else {
            return Err(fault(
                odometry,
                format!("line {number} is '{line}': expected a time and the number of a frame"),
            ));
        };
        times.insert(frame, time_ns);
    }
    Ok(times)
}

/// The camera matrix, if it is that of images of this size.
fn intrinsics(matrix: &Path, size: [usize; 2]) -> Result<Option<CameraInfo>, ImportError> {
    let text = text_of(matrix)?;
    let numbers: Vec<f64> = text.split([',', '\n', ' ']).filter_map(|cell| cell.trim().parse().ok()).collect();
    let [fx, _, cx, _, fy, cy, ..] = numbers[..] else {
        return Err(fault(matrix, "expected three rows of three numbers: copy it anew"));
    };
    let camera = pinhole(size, [fx, fy, cx, cy]);
    if camera.is_none() {
        tracing::warn!(
            "{}: left out of the start values: it is not of images of {} × {} px",
            matrix.display(),
            size[0],
            size[1]
        );
    }
    Ok(camera)
}
