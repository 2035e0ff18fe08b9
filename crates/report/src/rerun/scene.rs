//! The entities of a recording: those that hold for all frames, and those of one frame.

use std::io;

use depthcal_io::{DepthFrame as MeasuredDepth, DepthValues, GrayImage};
use depthcal_model::Camera;
use nalgebra::{Isometry3, Point3};
use re_chunk::Chunk;
use re_sdk_types::AsComponents;
use re_sdk_types::archetypes::{
    Clear, DepthImage, Image, LineStrips3D, Pinhole, Points2D, Points3D, Scalars, TextDocument, Transform3D,
    ViewCoordinates,
};
use re_sdk_types::components::{Color, LineStrip3D, MediaType, PinholeProjection, Radius};
use re_sdk_types::datatypes::Quaternion;

use super::cloud::{Colours, MOST_POINTS, clouds, metres};
use super::file::chunk;
use depthcal_calibration::judge::camera::EvaluatedFrame;
use depthcal_calibration::observe::board_region::BoardRegion;
use depthcal_calibration::observe::{CameraFrames, DetectedFrame};

/// Distance of the image plane that the viewer draws, m.
const IMAGE_PLANE_M: f32 = 0.15;
/// From pixel centres at integers to pixel centres at halves.
const HALF_PX: f64 = 0.5;
/// Share of an image's pixels that may be brighter than white.
const OVEREXPOSED: f64 = 0.005;

/// A frame: its capture, its markers and images, and its errors.
pub(super) type Known<'a> = (&'a CameraFrames, &'a DetectedFrame, &'a EvaluatedFrame);

/// Entities that hold for all frames.
pub(super) fn still(camera: &Camera, frames: &[Known<'_>], colours: &Colours) -> io::Result<Vec<Chunk>> {
    let strips = frames.iter().map(|(c, _, e)| strip(c, camera, &e.camera_from_board));
    let poses = LineStrips3D::new(strips).with_colors([Color::from_rgb(110, 110, 110)]);
    let about = format!(
        "Board poses from the images, depth from the depth images, corrected by `{}`.\n\n\
         Clouds: blue, too near; red, too far; full colour at {:.2} mm. At most {MOST_POINTS} pixels each.\n\n\
         Images: green, dots as found; magenta, as the camera projects them. Metres, in the camera's frame.",
        camera.blocks().iter().map(|b| b.name()).collect::<Vec<_>>().join(" + "),
        colours.span_mm,
    );
    [
        chunk("world", None, &ViewCoordinates::RDF()),
        chunk("world/camera", None, &pinhole(camera)),
        chunk("world/poses", None, &poses),
        chunk("about", None, &document(about)),
    ]
    .into_iter()
    .collect()
}

/// Entities of frame number `i`.
pub(super) fn moving(
    i: usize,
    camera: &Camera,
    (capture, frame, evaluated): Known<'_>,
    colours: &Colours,
) -> io::Result<Vec<Chunk>> {
    let mut chunks = Vec::new();
    let mut add = |entity: &str, shown: &dyn AsComponents| chunk(entity, Some(i), shown).map(|c| chunks.push(c));
    add("frame", &document(format!("**{}**, {}", frame.name, capture.name)))?;
    let pose = &evaluated.camera_from_board;
    add("world/board", &transform(pose))?;
    // Boards may differ from capture to capture.
    let points = capture.target.points().into_iter().map(|p| metres(&Point3::from(camera.board_point(p))));
    add("world/board/points", &Points3D::new(points).with_colors([green()]).with_radii([Radius::new_ui_points(2.0)]))?;
    let outline = [strip(capture, camera, &Isometry3::identity())];
    add("world/board/outline", &LineStrips3D::new(outline).with_colors([green()]))?;
    // Without a clear, the viewer would keep showing the image of the frame before.
    let open = frame.open().map_err(io::Error::other)?;
    match &open.image {
        Some(image) => add("world/camera/image", &gray(image))?,
        None => add("world/camera/image", &Clear::flat())?,
    }
    let pixels = |of: &dyn Fn(&[f64; 4]) -> [f64; 2], colour: Color| {
        let pixels = evaluated.reprojection.iter().map(|e| of(e).map(|c| (c + HALF_PX) as f32));
        Points2D::new(pixels).with_colors([colour]).with_radii([Radius::new_ui_points(2.0)])
    };
    add("world/camera/image/found", &pixels(&|e| [e[0], e[1]], green()))?;
    let magenta = Color::from_rgb(230, 0, 200);
    add("world/camera/image/reprojected", &pixels(&|e| [e[0] - e[2], e[1] - e[3]], magenta))?;
    match &open.depth {
        Some(image) => add("depth", &depth(image, capture.depth_unit_mm.unwrap_or(1.0)))?,
        None => add("depth", &Clear::flat())?,
    }
    let [measured, corrected] = clouds(camera, evaluated, colours);
    add("world/cloud/measured", &measured)?;
    add("world/cloud/corrected", &corrected)?;
    let record = evaluated.record();
    if let Some(error) = record.depth_rms_mm {
        add("error/depth_rms_mm/measured", &Scalars::single(error.before))?;
        add("error/depth_rms_mm/corrected", &Scalars::single(error.after))?;
    }
    if let Some(error) = record.dot_error_mm {
        add("error/dot_mm/measured", &Scalars::single(error.before.mean))?;
        add("error/dot_mm/corrected", &Scalars::single(error.after.mean))?;
    }
    if let Some(error) = record.reprojection_px {
        add("error/reprojection_px", &Scalars::single(error.rms))?;
    }
    Ok(chunks)
}

fn green() -> Color {
    Color::from_rgb(0, 200, 80)
}

fn document(markdown: String) -> TextDocument {
    TextDocument::new(markdown).with_media_type(MediaType::markdown())
}

/// The camera without its lens, which the viewer cannot represent.
fn pinhole(camera: &Camera) -> Pinhole {
    let [fx, fy, cx, cy, skew] = camera.pinhole();
    let columns = [[fx, 0.0, 0.0], [skew, fy, 0.0], [cx + HALF_PX, cy + HALF_PX, 1.0]];
    let projection = PinholeProjection::from(columns.map(|column| column.map(|c| c as f32)));
    Pinhole::new(projection)
        .with_resolution([camera.width as f32, camera.height as f32])
        .with_image_plane_distance(IMAGE_PLANE_M)
}

fn transform(pose: &Isometry3<f64>) -> Transform3D {
    let q = pose.rotation.coords;
    Transform3D::from_translation_rotation(
        metres(&pose.translation.vector.into()),
        Quaternion::from_xyzw([q.x, q.y, q.z, q.w].map(|c| c as f32)),
    )
}

/// The outermost markers of a board, one after another, at a pose.
fn strip(capture: &CameraFrames, camera: &Camera, pose: &Isometry3<f64>) -> LineStrip3D {
    let region = BoardRegion::new(&capture.target);
    let corners: Vec<[f32; 3]> =
        region.hull().iter().map(|p| metres(&(pose * Point3::from(camera.board_point(*p))))).collect();
    LineStrip3D::from_iter(corners.iter().chain(corners.first()).copied())
}

/// An image in 8 bits, its brightest pixels white: infrared images are dark and have glints.
fn gray(image: &GrayImage) -> Image {
    let mut sorted = image.data.clone();
    let brightest = ((1.0 - OVEREXPOSED) * (sorted.len().saturating_sub(1)) as f64) as usize;
    let white = if sorted.is_empty() { 1 } else { *sorted.select_nth_unstable(brightest).1 };
    let scale = 255.0 / f64::from(white.max(1));
    let bytes: Vec<u8> = image.data.iter().map(|v| (f64::from(*v) * scale).min(255.0) as u8).collect();
    Image::from_l8(bytes, [image.width as u32, image.height as u32])
}

fn depth(image: &MeasuredDepth, unit_mm: f64) -> DepthImage {
    // Floating-point depth is shown in whole millimetres.
    let (steps, unit_mm) = match &image.values {
        DepthValues::Steps(values) => (values.clone(), unit_mm),
        DepthValues::Float(values) => {
            let step = |i| image.measurement(i).map_or(0, |raw| (raw * unit_mm).round().min(65534.0) as u16);
            ((0..values.len()).map(step).collect(), 1.0)
        }
    };
    let bytes: Vec<u8> = steps.iter().flat_map(|v| v.to_le_bytes()).collect();
    DepthImage::from_gray16(bytes, [image.width as u32, image.height as u32]).with_meter((1000.0 / unit_mm) as f32)
}
