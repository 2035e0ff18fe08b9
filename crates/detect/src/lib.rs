//! Finds calibration boards in images with OpenCV and refines their markers.
