//! Phasors from ranges, in plain arithmetic that compiles to vector instructions and gives the same bits on every machine.

use super::modulation::{FREQUENCIES, LIGHT_MM_PER_S, Modulation};

/// Turns of phase per millimetre of range at each frequency: 2 f / c.
pub fn turns_per_mm(modulation: &Modulation) -> [f32; FREQUENCIES] {
    modulation.mhz.map(|f| (2e6 * f / LIGHT_MM_PER_S) as f32)
}

/// Adding this to an f32 below 2²² and taking it off again rounds to the nearest whole number.
const ROUND: f32 = 12_582_912.0;

/// (cos 2πt, sin 2πt) to within 4·10⁻⁷, for |t| < 2²². `t` is the phase in turns.
#[inline(always)]
pub fn phasor(t: f32) -> [f32; 2] {
    // Quarter turns, and what is left of t, in radians from −π/4 to π/4.
    let shifted = 4.0 * t + ROUND;
    let quarters = shifted - ROUND;
    let quadrant = shifted.to_bits();
    let x = (t - 0.25 * quarters) * std::f32::consts::TAU;
    let x2 = x * x;
    let sine = x + x * x2 * (-0.166_666_55 + x2 * (8.332_161e-3 + x2 * -1.951_53e-4));
    let cosine = 1.0 - 0.5 * x2 + x2 * x2 * (4.166_664_6e-2 + x2 * (-1.388_731_6e-3 + x2 * 2.443_316e-5));
    let (a, b) = if quadrant & 1 == 0 { (cosine, sine) } else { (sine, cosine) };
    // The signs of cosine and sine in the four quadrants.
    let re = f32::from_bits(a.to_bits() ^ ((quadrant.wrapping_add(1) & 2) << 30));
    let im = f32::from_bits(b.to_bits() ^ ((quadrant & 2) << 30));
    [re, im]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phasors_are_cosine_and_sine() {
        for i in -40_000..40_000 {
            let t = i as f32 * 3.1e-4;
            let angle = f64::from(t) * std::f64::consts::TAU;
            let [re, im] = phasor(t).map(f64::from);
            assert!((re - angle.cos()).abs() < 4e-7 && (im - angle.sin()).abs() < 4e-7, "{t}: {re} {im}");
        }
    }
}
