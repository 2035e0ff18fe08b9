//! Datasets, images, calibration files and exports of depthcal.
