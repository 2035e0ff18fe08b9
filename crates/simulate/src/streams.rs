//! Random numbers: one independent stream per purpose and frame, so that results depend on the seed alone, not on the
//! scheduling of threads.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Use of a stream. Every purpose has numbers of its own, so that switching one feature on leaves the others unchanged.
#[derive(Debug, Clone, Copy)]
#[repr(u64)]
pub(crate) enum Purpose {
    Pose = 1,
    Conditions,
    Background,
    ImageNoise,
    DepthNoise,
    Holes,
    PointMarkers,
    PointDepths,
    PointNoise,
    Defects,
    EffectShape,
    EffectFrames,
    Planting,
    ColourNoise,
}

/// The stream for `purpose` and `index` (a frame, an effect) under `seed`.
pub(crate) fn stream(seed: u64, purpose: Purpose, index: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(((purpose as u64) << 32) | index as u64);
    rng
}

/// A seed combined with a name (FNV-1a), so that dataset kinds and effects differ under the same seed.
pub(crate) fn seed_with_name(seed: u64, name: &str) -> u64 {
    name.bytes().fold(seed ^ 0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}
