//! Renders captures of a board by a depth camera whose errors are known, independently of the fitted model.
