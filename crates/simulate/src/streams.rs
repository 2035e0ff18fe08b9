//! Random numbers: one independent stream per purpose and frame, so that the result depends on the seed alone and
//! not on the order in which threads ask.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What a stream is used for. Each purpose has its own numbers, so that switching one thing on leaves the others as
/// they were.
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
}

/// The stream for `purpose` and `index` (a frame, an effect) under `seed`.
pub(crate) fn stream(seed: u64, purpose: Purpose, index: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(((purpose as u64) << 32) | index as u64);
    rng
}

/// Mixes a name into a seed (FNV-1a), so that dataset kinds differ under the same seed.
pub(crate) fn seed_with_name(seed: u64, name: &str) -> u64 {
    name.bytes().fold(seed ^ 0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}
