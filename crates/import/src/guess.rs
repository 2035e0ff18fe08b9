//! Which streams are the image, the depth on its pixel grid, and the intrinsics.

use std::ops::ControlFlow;
use std::path::Path;

use crate::azure;
use crate::camera_info::CameraInfo;
use crate::error::ImportError;
use crate::message::{Content, content, has_images, has_info};
use crate::recording::{Packet, Recording, StreamInfo, attachment};

/// A stream of images by its first message.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub stream: StreamInfo,
    pub size: [usize; 2],
    pub may_be_depth: bool,
    pub is_metres: bool,
}

/// The streams that are imported.
#[derive(Debug)]
pub(crate) struct Chosen {
    pub image: Candidate,
    pub depth: Option<Candidate>,
    pub info: Option<CameraInfo>,
    /// All streams of images, for the message that says what was chosen.
    pub candidates: Vec<Candidate>,
    /// The factory calibration of a Matroska file.
    pub factory: Option<Vec<u8>>,
}

/// Messages that are read to find the streams: some seconds of a camera beside a fast IMU.
const PROBED: usize = 5000;

/// Streams by their first messages.
#[derive(Default)]
struct Probed {
    candidates: Vec<Candidate>,
    /// Intrinsics with the names of their streams.
    infos: Vec<(String, CameraInfo)>,
    /// Streams of neither images nor intrinsics, with their kind.
    others: Vec<String>,
    /// Streams of images that cannot be read, and why.
    unreadable: Vec<(String, ImportError)>,
}

impl Probed {
    fn read(recording: &Recording) -> Result<Self, ImportError> {
        let mut probed = Self::default();
        let mut count = 0;
        recording.visit(&|_| true, &mut |packet| {
            count += 1;
            probed.add(&recording.path, &packet);
            Ok(if count >= PROBED { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        })?;
        Ok(probed)
    }

    fn add(&mut self, path: &Path, packet: &Packet) {
        let name = &packet.stream.name;
        if has_images(packet.stream) {
            let is_known = self.candidates.iter().any(|c| c.stream.name == *name);
            if is_known || self.unreadable.iter().any(|(known, _)| known == name) {
                return;
            }
            match candidate(path, packet) {
                Ok(candidate) => self.candidates.extend(candidate),
                Err(error) => self.unreadable.push((name.clone(), error)),
            }
        } else if has_info(packet.stream) {
            if self.infos.iter().any(|(known, _)| known == name) {
                return;
            }
            match content(path, packet) {
                Ok(Content::Info(info)) => self.infos.push((name.clone(), info)),
                Ok(Content::Picture(..)) => {}
                Err(error) => tracing::warn!("intrinsics are left out: {error}"),
            }
        } else if !self.others.iter().any(|known| known.starts_with(name.as_str())) {
            self.others.push(format!("{name} ({})", packet.stream.kind));
        }
    }
}

/// The stream of a message if that is an image.
fn candidate(path: &Path, packet: &Packet) -> Result<Option<Candidate>, ImportError> {
    match content(path, packet)? {
        Content::Picture(_, picture) => Ok(Some(Candidate {
            stream: packet.stream.clone(),
            size: picture.size(path)?,
            may_be_depth: picture.may_be_depth(),
            is_metres: picture.is_metres(),
        })),
        Content::Info(_) => Ok(None),
    }
}

/// Chooses streams: those that are named, else by what they hold and how they are called.
pub(crate) fn choose(recording: &Recording, image: Option<&str>, depth: Option<&str>) -> Result<Chosen, ImportError> {
    let path = &recording.path;
    let Probed { candidates, infos, others, unreadable } = Probed::read(recording)?;
    if candidates.is_empty() {
        // Streams of images that cannot be read say why.
        if let Some((_, error)) = unreadable.into_iter().next() {
            return Err(error);
        }
        let streams = if others.is_empty() { "none".into() } else { others.join(", ") };
        return Err(ImportError::NoImages { path: path.clone(), streams });
    }
    for (name, error) in &unreadable {
        tracing::warn!("the stream {name} is left out: {error}");
    }
    let named = |wanted: &str| {
        candidates.iter().find(|c| c.stream.name == wanted).cloned().ok_or_else(|| ImportError::NoStream {
            path: path.clone(),
            wanted: wanted.to_owned(),
            streams: candidates.iter().map(|c| c.stream.name.clone()).collect::<Vec<_>>().join(", "),
        })
    };
    let depth = match depth {
        Some("none") => None,
        Some(wanted) => Some(named(wanted)?),
        None => best(&candidates, |c| depth_rank(c, &candidates, image)),
    };
    let image = match image {
        Some(wanted) => named(wanted)?,
        None => {
            let best = best(&candidates, |c| image_rank(c, depth.as_ref()));
            best.unwrap_or_else(|| candidates[0].clone())
        }
    };
    // Images and depth of a frame lie on one pixel grid.
    let depth = depth.filter(|depth| depth.size == image.size && depth.stream != image.stream);
    let factory = if recording.is_matroska() { attachment(path, "calibration.json")? } else { None };
    let info = match &factory {
        Some(factory) => {
            let is_depth = !is_called(&image.stream.name, &["color", "colour", "rgb"]);
            azure::camera_info(factory, image.size, is_depth)
        }
        None => info_of(&image, &infos),
    };
    Ok(Chosen { image, depth, info, candidates, factory })
}

fn best(candidates: &[Candidate], rank: impl Fn(&Candidate) -> Option<i32>) -> Option<Candidate> {
    let ranked = candidates.iter().filter_map(|c| Some((rank(c)?, c)));
    // The first of equals.
    ranked.rev().max_by_key(|(rank, _)| *rank).map(|(_, c)| c.clone())
}

fn is_called(name: &str, words: &[&str]) -> bool {
    let name = name.to_lowercase();
    words.iter().any(|word| name.contains(word))
}

fn is_depth_name(name: &str) -> bool {
    is_called(name, &["depth", "range", "disparity"])
}

/// The stream called depth; one whose size an image has is better, and so is one that is not registered to another camera, unless
/// that camera's image is asked for.
fn depth_rank(c: &Candidate, all: &[Candidate], image: Option<&str>) -> Option<i32> {
    if !c.may_be_depth || !is_depth_name(&c.stream.name) {
        return None;
    }
    let partner = |other: &&Candidate| {
        other.size == c.size
            && !is_depth_name(&other.stream.name)
            && image.is_none_or(|image| image == other.stream.name)
    };
    let has_partner = all.iter().any(|other| partner(&other));
    let infrared = all.iter().any(|other| partner(&other) && is_infrared(&other.stream.name));
    Some(4 * i32::from(has_partner) + 2 * i32::from(infrared) + i32::from(!is_called(&c.stream.name, &["compressed"])))
}

fn is_infrared(name: &str) -> bool {
    is_called(name, &["infra", "/ir", "ir/", "ir_", "_ir", "amplitude", "intensity"]) || name.eq_ignore_ascii_case("ir")
}

/// An image on the depth's pixel grid; the infrared image, which has it by construction, before others.
fn image_rank(c: &Candidate, depth: Option<&Candidate>) -> Option<i32> {
    if is_depth_name(&c.stream.name) && !is_called(&c.stream.name, &["color", "colour", "rgb", "infra"]) {
        return None;
    }
    if depth.is_some_and(|depth| depth.stream == c.stream) {
        return None;
    }
    let same = depth.is_some_and(|depth| depth.size == c.size);
    Some(
        8 * i32::from(same)
            + 4 * i32::from(is_infrared(&c.stream.name))
            + i32::from(!is_called(&c.stream.name, &["compressed"])),
    )
}

/// The intrinsics whose topic has the longest beginning in common with the image's, of its size.
fn info_of(image: &Candidate, infos: &[(String, CameraInfo)]) -> Option<CameraInfo> {
    let shared = |name: &str| name.bytes().zip(image.stream.name.bytes()).take_while(|(a, b)| a == b).count();
    let fitting = infos.iter().filter(|(_, info)| [info.width, info.height] == image.size);
    fitting.max_by_key(|(name, _)| shared(name)).map(|(_, info)| info.clone())
}
