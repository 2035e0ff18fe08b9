//! A dataset whose images and markers are in memory already.

use std::path::PathBuf;

use depthcal_io::{
    CAMERA, CameraHint, DatasetCamera, DepthFrame, DepthValues, FileReference, Frame, FrameMetadata, GrayImage,
    Pairing, digest_contents,
};
use depthcal_model::Target;

use super::dataset::{Loaded, assemble, since_first};
use super::error::LoadError;
use super::found::Found;
use super::marker_lists::check;
use crate::observe::stored::depth_digest;
use crate::observe::{MarkerObservation, MeasuredDepth, RawFrame};

/// A frame in memory.
#[derive(Debug, Clone)]
pub struct FrameInMemory {
    /// Its name.
    pub name: String,
    /// The image, where there is one.
    pub image: Option<GrayImage>,
    /// The depth image on the same pixel grid, where there is one.
    pub depth: Option<DepthFrame>,
    /// The markers that were found; none where the board was not found.
    pub markers: Vec<MarkerObservation>,
    /// Time, temperature and more.
    pub metadata: FrameMetadata,
}

/// A dataset in memory.
#[derive(Debug, Clone)]
pub struct DatasetInMemory {
    /// Its name.
    pub name: String,
    /// The board.
    pub target: Target,
    /// Width and height of all images, px.
    pub size: (usize, usize),
    /// Millimetres per step of the depth images; `None` where there is no depth.
    pub depth_unit_mm: Option<f64>,
    /// Intrinsics that are known.
    pub camera: Option<CameraHint>,
    /// The frames.
    pub frames: Vec<FrameInMemory>,
}

/// A dataset from memory, as [`load`](super::load) gives one from files. Its reference has the name as path, and a digest of
/// everything that is given.
///
/// # Errors
///
/// [`LoadError`]: images of another size, markers that the board does not have, two frames with one name, or no markers at all.
pub fn load_from_memory(given: DatasetInMemory) -> Result<Loaded, LoadError> {
    let DatasetInMemory { name, target, size, depth_unit_mm, camera, frames } = given;
    let mut contents = vec![("board".to_owned(), format!("{target:?} {depth_unit_mm:?} {camera:?}").into_bytes())];
    let (mut raw, mut markers, mut listed) = (Vec::new(), Vec::new(), Vec::new());
    for frame in frames {
        if listed.iter().any(|f: &Frame| f.name == frame.name) {
            let problem = "another frame has the same name".to_owned();
            return Err(LoadError::Marker { frame: frame.name, problem });
        }
        let sizes =
            [frame.image.as_ref().map(|i| (i.width, i.height)), frame.depth.as_ref().map(|d| (d.width, d.height))];
        if let Some(actual) = sizes.into_iter().flatten().find(|actual| *actual != size) {
            return Err(LoadError::Size { path: PathBuf::from(frame.name), found: actual, expected: size });
        }
        check(&frame.name, &frame.markers, &target)?;
        contents.push((frame.name.clone(), bytes_of(&frame)));
        let depth_digest = frame.depth.as_ref().and_then(depth_digest);
        raw.push(RawFrame {
            depth: frame.depth.map_or(MeasuredDepth::None, |depth| MeasuredDepth::Image(depth.into())),
            image: frame.image.map(Into::into),
            depth_digest,
            ..RawFrame::named(&frame.name, &frame.metadata)
        });
        markers.push(frame.markers);
        listed.push(Frame { name: frame.name, image: None, depth: None, metadata: frame.metadata });
    }
    since_first(&mut raw);
    let reference = FileReference { path: name.clone(), digest: digest_contents(contents) };
    let declared = DatasetCamera { frames: listed, camera, ..declared_in_memory(&name, &target, depth_unit_mm) };
    let (camera, _) = assemble(declared, reference, raw, size, Found { markers, ..Found::default() }, None)?;
    Ok(Loaded::of_camera(camera))
}

/// The declaration of the camera of a dataset without files: the name stands for the folder, and no frames are listed.
pub fn declared_in_memory(name: &str, target: &Target, depth_unit_mm: Option<f64>) -> DatasetCamera {
    DatasetCamera {
        name: CAMERA.to_owned(),
        title: name.to_owned(),
        root: PathBuf::from(name),
        target: target.clone(),
        frames: Vec::new(),
        depth_unit_mm,
        disparity: None,
        camera: None,
        camera_from_rig: None,
        expected_from_rig: None,
        pairing: Pairing::default(),
        strays: Vec::new(),
        lists: Vec::new(),
    }
}

/// Everything of a frame, for the digest.
fn bytes_of(frame: &FrameInMemory) -> Vec<u8> {
    let mut bytes = format!("{:?} {:?}", frame.metadata, frame.markers).into_bytes();
    if let Some(image) = &frame.image {
        bytes.extend(image.data.iter().flat_map(|v| v.to_le_bytes()));
    }
    match frame.depth.as_ref().map(|depth| &depth.values) {
        Some(DepthValues::Steps(values)) => bytes.extend(values.iter().flat_map(|v| v.to_le_bytes())),
        Some(DepthValues::Float(values)) => bytes.extend(values.iter().flat_map(|v| v.to_le_bytes())),
        None => {}
    }
    bytes
}
