//! The nodes of fields: where they lie over the image and in depth, how values between them are interpolated, and how the
//! parameters of a field are numbered.

pub(crate) mod layout;
pub(crate) mod nodes;

pub use layout::FieldLayout;
pub use nodes::{Domain, Grid, Interpolation};
