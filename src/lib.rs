//! depthcal calibrates depth cameras.
