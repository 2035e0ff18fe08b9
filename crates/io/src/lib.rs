//! Datasets, images, calibration files and exports of depthcal.

pub mod image;

pub use image::{DepthImage, GrayImage};
