//! Images of frames: in memory, or left in their files where a dataset has more than memory should hold.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_io::{DepthFrame, DepthValues, GrayImage, ImageError, read_depth_frame, read_gray};

/// An image that can be read from a file.
pub trait ImageFile: Sized {
    /// Reads it.
    ///
    /// # Errors
    ///
    /// [`ImageError`] with the file and what is wrong with it.
    fn read(path: &Path) -> Result<Self, ImageError>;
    /// Bytes that it takes in memory.
    fn bytes(&self) -> usize;
}

impl ImageFile for GrayImage {
    fn read(path: &Path) -> Result<Self, ImageError> {
        read_gray(path)
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.data[..])
    }
}

impl ImageFile for DepthFrame {
    fn read(path: &Path) -> Result<Self, ImageError> {
        read_depth_frame(path)
    }

    fn bytes(&self) -> usize {
        DepthFrame::bytes(self)
    }
}

/// An image in memory or in its file.
#[derive(Debug, Clone)]
pub enum Stored<T> {
    /// In memory, shared by all copies of the frame.
    Memory(Arc<T>),
    /// In its file, which is read again each time.
    File(Arc<PathBuf>),
}

impl<T: ImageFile> Stored<T> {
    /// The image.
    ///
    /// # Errors
    ///
    /// [`ImageError`] where it has to be read from its file and that has become unreadable.
    pub fn get(&self) -> Result<Arc<T>, ImageError> {
        match self {
            Self::Memory(image) => Ok(image.clone()),
            Self::File(path) => T::read(path).map(Arc::new),
        }
    }
}

impl<T> From<T> for Stored<T> {
    fn from(image: T) -> Self {
        Self::Memory(Arc::new(image))
    }
}

/// A number that is equal for equal depth images and different for others but by chance (1 in 2⁶⁴); `None` of an image without
/// any measurement.
pub fn depth_digest(depth: &DepthFrame) -> Option<u64> {
    (0..depth.len()).any(|i| depth.measurement(i).is_some()).then(|| {
        let mut hasher = DefaultHasher::new();
        (depth.width, depth.height).hash(&mut hasher);
        match &depth.values {
            DepthValues::Steps(values) => values.hash(&mut hasher),
            DepthValues::Float(values) => values.iter().for_each(|value| value.to_bits().hash(&mut hasher)),
        }
        hasher.finish()
    })
}
