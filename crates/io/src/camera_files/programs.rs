//! The programs whose documents are read, and the cameras of a document.

use super::error::CameraFileError;
use super::intrinsics::Intrinsics;
use super::node::Node;
use super::{azure_kinect, camodocal, kalibr, matrix, mrcal, named, nerf, open3d, orb_slam, orbbec, realsense};

/// How the cameras of a mapping are recognised and read.
struct Program {
    /// Names of the cameras of a mapping, empty for the only one; none where it is not this program's.
    cameras: fn(&Node<'_>) -> Vec<String>,
    /// Reads the camera of such a name.
    read: fn(&Node<'_>, &str) -> Result<Intrinsics, CameraFileError>,
}

/// The programs, those with the most particular keys first.
const PROGRAMS: [Program; 11] = [
    Program { cameras: mrcal::cameras, read: mrcal::read },
    Program { cameras: azure_kinect::cameras, read: azure_kinect::read },
    Program { cameras: kalibr::cameras, read: kalibr::read },
    Program { cameras: camodocal::cameras, read: camodocal::read },
    Program { cameras: orb_slam::cameras, read: orb_slam::read },
    Program { cameras: nerf::cameras, read: nerf::read },
    Program { cameras: realsense::cameras, read: realsense::read },
    Program { cameras: orbbec::cameras, read: orbbec::read },
    Program { cameras: open3d::cameras, read: open3d::read },
    Program { cameras: matrix::cameras, read: matrix::read },
    Program { cameras: named::cameras, read: named::read },
];

/// A camera of a document.
pub(super) struct Found<'a> {
    /// Its name, the keys that lead to it; empty for the document itself.
    pub name: String,
    node: Node<'a>,
    part: String,
    read: fn(&Node<'_>, &str) -> Result<Intrinsics, CameraFileError>,
}

impl Found<'_> {
    pub fn read(&self) -> Result<Intrinsics, CameraFileError> {
        (self.read)(&self.node, &self.part)
    }
}

/// The cameras of a document: of the first program that recognises a mapping, else of the mappings in it.
pub(super) fn cameras<'a>(node: &Node<'a>) -> Vec<Found<'a>> {
    for Program { cameras, read } in PROGRAMS {
        let parts = cameras(node);
        if !parts.is_empty() {
            let camera = |part: String| Found { name: node.name_of(&part), node: node.clone(), part, read };
            return parts.into_iter().map(camera).collect();
        }
    }
    node.children().iter().flat_map(cameras).collect()
}
