//! Depth pieces: true to measured inverse depth.

mod cyclic_depth;
mod disparity_ripple;
mod incidence_bias;
mod projective;
mod projector_distortion;
mod quadratic_depth;
mod radial_range;
mod range_offset;
mod reflectivity_bias;
mod temperature_drift;
mod temporal_drift;

pub use cyclic_depth::CyclicDepth;
pub use disparity_ripple::DisparityRipple;
pub use incidence_bias::IncidenceBias;
pub use projective::Projective;
pub use projector_distortion::ProjectorDistortion;
pub use quadratic_depth::QuadraticDepth;
pub use radial_range::RadialRange;
pub use range_offset::RangeOffset;
pub use reflectivity_bias::ReflectivityBias;
pub use temperature_drift::TemperatureDrift;
pub use temporal_drift::TemporalDrift;
