//! Folders of image files that other programs record: TUM RGB-D, Stray Scanner, Record3D. They are read as streams of messages.

mod files;
mod lzfse;
mod record3d;
mod stray;
mod tum;

use std::borrow::Cow;
use std::fs;
use std::path::{Path, PathBuf};

use depthcal_io::{DepthValues, decode_depth_frame, decode_gray};

pub(crate) use self::files::{DEPTH_FILES, IMAGE_FILES};
use self::files::{FileFrame, FileStream, Stored, fault};
use self::lzfse::Lzfse;
use super::packet::{End, Layout, Packet, StreamInfo, Visitor};
use crate::camera_info::CameraInfo;
use crate::error::ImportError;
use crate::picture::Encoding;

/// A folder of image files: images, and depth where there is any.
#[derive(Debug)]
pub(crate) struct Folder {
    path: PathBuf,
    streams: Vec<FileStream>,
}

impl Folder {
    /// The folder if it is one of these; of a folder that holds something else `None`.
    pub fn open(path: &Path) -> Result<Option<Self>, ImportError> {
        for open in [tum::open, stray::open, record3d::open] {
            if let Some(streams) = open(path)? {
                return Ok(Some(Self { path: path.to_owned(), streams }));
            }
        }
        Ok(None)
    }

    /// Number of its streams.
    pub fn streams(&self) -> usize {
        self.streams.len()
    }

    /// Unit and intrinsics that the folder declares of a stream.
    pub fn declared(&self, stream: &StreamInfo) -> (Option<f64>, Option<&CameraInfo>) {
        let stream = self.streams.iter().find(|s| s.info == *stream);
        stream.map_or((None, None), |s| (s.unit_mm, s.camera.as_ref()))
    }

    /// Reads the files of the streams that are wanted, in the order of time.
    pub(in crate::recording) fn visit(
        &self,
        wanted: &dyn Fn(&StreamInfo) -> bool,
        visitor: &mut Visitor<'_>,
    ) -> Result<End, ImportError> {
        let mut frames: Vec<(&FileStream, &FileFrame)> = self
            .streams
            .iter()
            .filter(|stream| wanted(&stream.info))
            .flat_map(|stream| stream.frames.iter().map(move |frame| (stream, frame)))
            .collect();
        frames.sort_by_key(|(_, frame)| frame.time_ns);
        for (stream, frame) in frames {
            let (layout, data) = self.contents(stream, frame)?;
            let packet = Packet { stream: &stream.info, layout, time_ns: frame.time_ns, data: Cow::Owned(data) };
            if visitor(packet)?.is_break() {
                return Ok(End::Stopped);
            }
        }
        Ok(End::Whole)
    }

    fn contents(&self, stream: &FileStream, frame: &FileFrame) -> Result<(Layout, Vec<u8>), ImportError> {
        let bytes = fs::read(&frame.path).map_err(|error| ImportError::Read { path: frame.path.clone(), error })?;
        if stream.info.kind == IMAGE_FILES {
            return Ok((Layout::File, bytes));
        }
        let (size, mut values) = match stream.stored {
            Stored::File => {
                let depth = decode_depth_frame(&frame.path, &bytes)?;
                ([depth.width, depth.height], depth.values)
            }
            Stored::Lzfse(size) => (size, DepthValues::Float(Lzfse { path: &frame.path, bytes: &bytes }.floats(size)?)),
        };
        if let Some(confidence) = &frame.confidence {
            self.mask(&mut values, &confidences(stream.stored, confidence, size)?);
        }
        Ok(match values {
            DepthValues::Steps(steps) => {
                let data = steps.iter().flat_map(|v| v.to_le_bytes()).collect();
                (Layout::Pixels(size, Encoding::Mono16Little), data)
            }
            DepthValues::Float(depth) => {
                let data = depth.iter().flat_map(|v| v.to_le_bytes()).collect();
                (Layout::Pixels(size, Encoding::Float32Little), data)
            }
        })
    }

    /// Depth that is not to be trusted is none.
    fn mask(&self, values: &mut DepthValues, confidences: &[u16]) {
        tracing::debug!("{}: depth of the lowest confidence is left out", self.path.display());
        match values {
            DepthValues::Steps(steps) => {
                steps.iter_mut().zip(confidences).filter(|(_, c)| **c == 0).for_each(|(v, _)| *v = 0);
            }
            DepthValues::Float(depth) => {
                depth.iter_mut().zip(confidences).filter(|(_, c)| **c == 0).for_each(|(v, _)| *v = 0.0);
            }
        }
    }
}

/// The confidences of the pixels of a depth image of a size.
fn confidences(stored: Stored, path: &Path, size: [usize; 2]) -> Result<Vec<u16>, ImportError> {
    let bytes = fs::read(path).map_err(|error| ImportError::Read { path: path.to_owned(), error })?;
    let (data, of_confidence) = match stored {
        Stored::Lzfse(_) => {
            let data = Lzfse { path, bytes: &bytes }.unpacked(size[0] * size[1])?;
            (data.into_iter().map(u16::from).collect::<Vec<u16>>(), size)
        }
        Stored::File => {
            let image = decode_gray(path, &bytes)?;
            (image.data, [image.width, image.height])
        }
    };
    if of_confidence != size || data.len() != size[0] * size[1] {
        let [width, height] = size;
        let problem =
            format!("the confidences are not of {width}×{height} px as the depth is: copy or record them anew");
        return Err(fault(path, problem));
    }
    Ok(data)
}
