//! Depth pieces: true to measured inverse depth.

mod bspline;
mod cyclic_depth;
mod disparity_decay;
mod disparity_ripple;
mod free_map;
mod incidence_bias;
mod multiplier;
mod polynomial_map;
mod projective;
mod projector_distortion;
mod quadratic_depth;
mod radial_range;
mod range_offset;
mod reflectivity_bias;
mod signal_mixing;
mod temperature_drift;
mod temporal_drift;

pub use bspline::Bspline;
pub use cyclic_depth::CyclicDepth;
pub use disparity_decay::DisparityDecay;
pub use disparity_ripple::DisparityRipple;
pub use free_map::FreeMap;
pub use incidence_bias::IncidenceBias;
pub use multiplier::Multiplier;
pub use polynomial_map::PolynomialMap;
pub use projective::Projective;
pub use projector_distortion::ProjectorDistortion;
pub use quadratic_depth::QuadraticDepth;
pub use radial_range::RadialRange;
pub use range_offset::RangeOffset;
pub use reflectivity_bias::ReflectivityBias;
pub use signal_mixing::SignalMixing;
pub use temperature_drift::TemperatureDrift;
pub use temporal_drift::TemporalDrift;
