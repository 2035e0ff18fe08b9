//! Files of depthcal: datasets, images, calibrations, evaluations, observations, cameras of other programs and point clouds.
//!
//! This crate reads and writes; it computes nothing about cameras but what a file of another program loses of one. Whatever a
//! user can get wrong is an error that names the file, the field and the remedy, never a panic. Error messages are complete: an
//! operating system's error is part of the text, not a separate source. Every file is written under a temporary name and renamed
//! ([`write_atomically`]), so that an interrupted run leaves no incomplete file.

pub mod board_print;
pub mod camera_files;
pub mod corner_file;
pub mod dataset;
pub mod file;
pub mod image;
pub mod pcd;
pub mod ply;
pub mod record;
pub mod schema;

pub use board_print::{
    BoardFileError, BoardFiles, BoardPage, BoardPrintError, DictionaryCells, Paper, TagCells, board_pdf, board_svg,
    write_board,
};
pub use camera_files::{
    CameraFileError, CameraFormat, Export, ExportCamera, ExportError, ExportWarning, FileLens, Intrinsics, read_camera,
};
pub use corner_file::{CornerFileError, FileCorner, ImageCorners, read_corners};
pub use dataset::{
    CAMERA, CameraHint, CameraSection, DATASET_FILE, Dataset, DatasetCamera, DatasetError, DatasetFile, Frame,
    FrameMetadata, IntrinsicNumbers, Pairing, Stray,
};
pub use file::{
    Displaced, FileError, OF_CALIBRATION, StagedDataset, StagedResults, check_writable, digest_contents, digest_files,
    digest_json, is_of_depthcal, is_temporary, read_json, write_atomically, write_json, write_json_compact,
};
pub use image::{
    DEPTH_EXTENSIONS, DepthFrame, DepthImage, DepthValues, Disparity, GrayImage, IMAGE_EXTENSIONS, ImageError,
    RgbImage, check_same_size, decode_depth_frame, decode_gray, decode_rgb, read_depth, read_depth_frame, read_gray,
    read_rgb, write_depth, write_depth_frame, write_gray, write_rgb,
};
pub use pcd::write_pcd;
pub use ply::{Cloud, write_ply};
pub use record::*;
pub use schema::SchemaName;
