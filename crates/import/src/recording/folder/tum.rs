//! The folders of the TUM RGB-D benchmark: `rgb.txt` and `depth.txt`, or a file of associations, with a time and a file per line.

use std::path::Path;

use super::files::{DEPTH_FILES, FileFrame, FileStream, IMAGE_FILES, Stored, fault, nanoseconds, text_of};
use crate::error::ImportError;
use crate::recording::StreamInfo;

/// Millimetres per step of depth: 5000 steps are a metre.
const UNIT_MM: f64 = 0.2;
const ASSOCIATIONS: [&str; 4] = ["associations.txt", "association.txt", "associate.txt", "assoc.txt"];

/// The streams of a folder; `None` where it has no such list.
pub(super) fn open(folder: &Path) -> Result<Option<Vec<FileStream>>, ImportError> {
    let list = |name: &str| Some(folder.join(name)).filter(|path| path.is_file());
    let frames = match (list("rgb.txt"), list("depth.txt")) {
        (Some(rgb), Some(depth)) => [listed(folder, &rgb, 0)?, listed(folder, &depth, 0)?],
        (rgb, depth) => {
            let Some(pairs) = ASSOCIATIONS.iter().find_map(|name| list(name)) else {
                return match (rgb, depth) {
                    (Some(rgb), None) => {
                        Err(fault(&rgb, "the images are listed, but there is no depth.txt beside: copy it too"))
                    }
                    _ => Ok(None),
                };
            };
            let [first, second] = [listed(folder, &pairs, 0)?, listed(folder, &pairs, 2)?];
            let is_depth = |frames: &[FileFrame]| frames.iter().all(|f| f.path.to_string_lossy().contains("depth"));
            if is_depth(&first) && !is_depth(&second) { [second, first] } else { [first, second] }
        }
    };
    let stream = |name: &str, kind: &str, unit_mm, frames| FileStream {
        info: StreamInfo { name: name.to_owned(), kind: kind.to_owned() },
        stored: Stored::File,
        unit_mm,
        camera: None,
        frames,
    };
    let [rgb, depth] = frames;
    // Depth has the pixels of the images.
    Ok(Some(vec![stream("rgb", IMAGE_FILES, None, rgb), stream("depth_registered", DEPTH_FILES, Some(UNIT_MM), depth)]))
}

/// Times and files of a list, from a column on.
fn listed(folder: &Path, list: &Path, column: usize) -> Result<Vec<FileFrame>, ImportError> {
    let text = text_of(list)?;
    let mut frames = Vec::new();
    for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'))
    {
        // Some write commas or tabs.
        let words: Vec<&str> = line.split([' ', '\t', ',']).filter(|word| !word.is_empty()).collect();
        let time = words.get(column).and_then(|word| nanoseconds(word.parse().ok()?));
        let (Some(time_ns), Some(file)) = (time, words.get(column + 1)) else {
            let problem =
                format!("line {number} is '{line}': expected a time in seconds and a file, for images and depth alike");
            return Err(fault(list, problem));
        };
        let is_inside = Path::new(file).components().all(|part| matches!(part, std::path::Component::Normal(_)));
        let path = folder.join(file);
        if !is_inside || !path.is_file() {
            return Err(fault(
                list,
                format!("line {number} names {file}, which is not in the folder: copy it, or remove the line"),
            ));
        }
        frames.push(FileFrame { time_ns, path, confidence: None });
    }
    if frames.is_empty() {
        return Err(fault(list, "it lists no files: copy or record it anew"));
    }
    Ok(frames)
}
