//! Comparisons of calibrations with OpenCV's, in `tests/`. They are the only tests above `depthcal-detect` that link OpenCV,
//! which no other package has to build for them.
