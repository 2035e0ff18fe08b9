//! Which streams are the image, the depth on its pixel grid, and the intrinsics.

use std::ops::ControlFlow;
use std::path::Path;

use crate::azure;
use crate::camera_info::CameraInfo;
use crate::error::ImportError;
use crate::message::{Content, content, frame_of, has_images, has_info};
use crate::recording::{Packet, Recording, StreamInfo};
use crate::transforms::{Rows, Transforms};

/// A stream of images by its first message.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub stream: StreamInfo,
    pub size: [usize; 2],
    pub may_be_depth: bool,
    /// Millimetres per step, or per unit of floating-point numbers, of a depth stream.
    pub unit_mm: f64,
    /// Name of the frame of coordinates that its messages give.
    pub frame: String,
    /// The intrinsics that are said to be this stream's.
    pub info: Option<CameraInfo>,
}

/// How the pixels of an image and of a depth image are related.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Grid {
    /// Equal pixels, by their intrinsics or by what the streams are.
    One,
    /// An equal size, and nothing that says more.
    Assumed,
    /// Those of two cameras, by their sizes or intrinsics.
    Two,
}

/// The streams that are imported.
#[derive(Debug)]
pub(crate) struct Chosen {
    pub image: Candidate,
    pub depth: Option<Candidate>,
    /// How the pixels of image and depth are related; of no meaning without depth.
    pub grid: Grid,
    /// All streams of images, for the message that says what was chosen.
    pub candidates: Vec<Candidate>,
    /// The factory calibration of a Matroska file.
    pub factory: Option<Vec<u8>>,
    /// The place of the depth sensor from the image's coordinates, as the recording states it.
    pub depth_from_image: Option<Rows>,
}

impl Chosen {
    /// Whether image and depth are those of two cameras.
    pub fn is_rig(&self) -> bool {
        self.depth.is_some() && self.grid == Grid::Two
    }
}

/// Messages that are read to find the streams: some seconds of a camera beside a fast IMU.
const PROBED: usize = 5000;

/// Streams by their first messages.
#[derive(Default)]
struct Probed {
    candidates: Vec<Candidate>,
    /// Intrinsics with the names of their streams.
    infos: Vec<(String, CameraInfo)>,
    /// Depth units that a camera reports, mm, with the names of their streams.
    units: Vec<(String, f64)>,
    /// Streams of intrinsics that are no use.
    without_use: Vec<String>,
    /// Places of sensors.
    transforms: Transforms,
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
            // Of files the first of each stream tells all.
            let is_known = recording.folder().is_some_and(|folder| probed.candidates.len() == folder.streams());
            Ok(if count >= PROBED || is_known { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        })?;
        for candidate in &mut probed.candidates {
            candidate.info = info_of(candidate, &probed.infos);
            let unit = probed.units.iter().find(|(name, _)| candidate.stream.name.starts_with(sensor(name)));
            if let Some((_, unit_mm)) = unit {
                candidate.unit_mm = *unit_mm;
            }
            if let Some((unit_mm, info)) = recording.folder().map(|folder| folder.declared(&candidate.stream)) {
                candidate.unit_mm = unit_mm.unwrap_or(candidate.unit_mm);
                candidate.info = info.cloned();
            }
        }
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
            if self.infos.iter().any(|(known, _)| known == name) || self.without_use.contains(name) {
                return;
            }
            match content(path, packet) {
                Ok(Content::Info(info)) => self.infos.push((name.clone(), info)),
                Ok(Content::Picture(..)) => {}
                Err(error) => {
                    tracing::warn!("intrinsics are left out: {error}");
                    self.without_use.push(name.clone());
                }
            }
        } else if let Some(unit_mm) = depth_unit(packet) {
            self.units.push((name.clone(), unit_mm));
        } else if self.transforms.add(packet) {
            // Said of cameras, not one of them.
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
            // REP 118: 16-bit depth is in millimetres, floating-point depth in metres.
            unit_mm: if picture.is_metres() { 1000.0 } else { 1.0 },
            frame: frame_of(packet),
            info: None,
        })),
        Content::Info(_) => Ok(None),
    }
}

/// Chooses streams: those that are named, else by what they hold and how they are called.
pub(crate) fn choose(recording: &Recording, image: Option<&str>, depth: Option<&str>) -> Result<Chosen, ImportError> {
    let path = &recording.path;
    let Probed { mut candidates, others, unreadable, transforms, .. } = Probed::read(recording)?;
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
    let factory = recording.attachment("calibration.json")?;
    if let Some(factory) = &factory {
        for candidate in &mut candidates {
            let is_depth = !is_called(&candidate.stream.name, &["color", "colour", "rgb"]);
            candidate.info = azure::camera_info(factory, candidate.size, is_depth);
        }
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
    let depth = depth.filter(|depth| depth.stream != image.stream);
    let grid = depth.as_ref().map_or(Grid::One, |depth| grid(&image, depth));
    if grid == Grid::Assumed {
        tracing::warn!(
            "nothing in the recording says that {} has the pixels of the depth; they are of one size, and taken for it",
            image.stream.name
        );
    }
    let image = match &depth {
        // An infrared image without intrinsics of its own has those of the depth that is made of it.
        Some(depth) if image.info.is_none() && grid != Grid::Two => Candidate { info: depth.info.clone(), ..image },
        _ => image,
    };
    let place = |c: &Candidate| (c.stream.name.clone(), c.frame.clone());
    let depth_from_image = depth.as_ref().and_then(|depth| {
        let [(a, of_a), (b, of_b)] = [place(&image), place(depth)];
        transforms.between([(&a, &of_a), (&b, &of_b)])
    });
    Ok(Chosen { image, depth, grid, candidates, factory, depth_from_image })
}

/// How the pixels of an image and of depth are related.
fn grid(image: &Candidate, depth: &Candidate) -> Grid {
    let (of_image, of_depth) = (&image.stream.name, &depth.stream.name);
    if image.size != depth.size {
        return Grid::Two;
    }
    if let (Some(a), Some(b)) = (&image.info, &depth.info) {
        return if a.is_of_grid(b) { Grid::One } else { Grid::Two };
    }
    if is_infrared(of_image) || is_called(of_depth, &["aligned", "registered"]) { Grid::One } else { Grid::Assumed }
}

/// The depth unit of a message of the RealSense SDK's recorder, mm: `/device_0/sensor_0/option/Depth Units/value`, in metres.
fn depth_unit(packet: &Packet) -> Option<f64> {
    let is_unit = packet.stream.kind == "std_msgs/Float32" && packet.stream.name.ends_with("/option/Depth Units/value");
    let metres = f32::from_le_bytes(*packet.data.first_chunk().filter(|_| is_unit)?);
    // The number in the decimals that were meant: 0.00025 m is 0.25 mm, not 0.250000011874.
    let unit_mm = (f64::from(metres) * 1e9).round() / 1e6;
    (0.002..=1000.0).contains(&unit_mm).then_some(unit_mm)
}

/// The beginning of the names of all streams of the sensor whose option this is.
fn sensor(option: &str) -> &str {
    option.find("option/").map_or(option, |end| &option[..end])
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
        grid(other, c) != Grid::Two
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
    let same = depth.is_some_and(|depth| grid(c, depth) != Grid::Two);
    Some(
        8 * i32::from(same)
            + 4 * i32::from(is_infrared(&c.stream.name))
            + i32::from(!is_called(&c.stream.name, &["compressed"])),
    )
}

/// The intrinsics of a stream by ROS' convention, `camera_info` beside the images (of RealSense's recorder, `info/camera_info`
/// beside `image/data`): those in the folder nearest above the stream, of its size.
fn info_of(stream: &Candidate, infos: &[(String, CameraInfo)]) -> Option<CameraInfo> {
    let folder = |topic: &str| {
        let folder = topic.strip_suffix("camera_info").unwrap_or(topic);
        folder.strip_suffix("info/").unwrap_or(folder).len()
    };
    let above = infos.iter().filter(|(topic, _)| stream.stream.name.starts_with(&topic[..folder(topic)]));
    let (topic, info) = above.max_by_key(|(topic, _)| folder(topic))?;
    let [width, height] = stream.size;
    if [info.width, info.height] != stream.size {
        tracing::warn!(
            "the intrinsics of {topic} are left out: they are of {} × {} px, and the images of {} are of {width} × {height} px",
            info.width,
            info.height,
            stream.stream.name
        );
        return None;
    }
    Some(info.clone())
}
