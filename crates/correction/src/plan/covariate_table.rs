//! Corrections that depend on a second quantity of the pixel: its amplitude or its angle of incidence.
//!
//! For a given value of that quantity the piece is affine in depth, z_m = m z + c, and so is its inverse: z = z_m + p
//! z_m + q with p = 1/m − 1, q = −c/m. p and q are tabulated over the quantity.

/// Entries of the table over amplitude: one for each 16-bit value.
const AMPLITUDES: usize = 1 << 16;
/// Entries of the table over the cosine of the angle of incidence.
const COSINES: usize = 1 << 12;

/// p and q (mm) over the quantity.
#[derive(Debug, Clone)]
pub(crate) struct CovariateTable<const N: usize> {
    p: Box<[f32; N]>,
    q: Box<[f32; N]>,
}

/// Over the 16-bit amplitude: one entry per value.
pub(crate) type ByAmplitude = CovariateTable<AMPLITUDES>;
/// Over the cosine of the angle of incidence from 0 to 1, linear between entries.
pub(crate) type ByCosine = CovariateTable<COSINES>;

impl<const N: usize> CovariateTable<N> {
    /// The table, given m and c (mm) of every entry.
    fn from_entries(affine: impl Fn(usize) -> [f64; 2]) -> Self {
        let table = |value: &dyn Fn([f64; 2]) -> f64| {
            let values: Vec<f32> = (0..N).map(|i| value(affine(i)) as f32).collect();
            values.into_boxed_slice().try_into().unwrap_or_else(|_| Box::new([0.0; N]))
        };
        // A map that falls with depth has no inverse. NaN sends the pixel to the inverse in f64, which rejects it.
        let rising = |m: f64| if m > 0.0 { m } else { f64::NAN };
        Self { p: table(&|[m, _]| 1.0 / rising(m) - 1.0), q: table(&|[m, c]| -c / rising(m)) }
    }

    #[inline(always)]
    fn apply(p: f32, q: f32, z: f32) -> f32 {
        let corrected = z + (z * p + q);
        if z > 0.0 { if corrected > 0.0 { corrected } else { f32::NAN } } else { z }
    }
}

impl ByAmplitude {
    /// The table, given m and c (mm) as functions of amplitude.
    pub fn over_amplitude(affine: impl Fn(f64) -> [f64; 2]) -> Self {
        Self::from_entries(|i| affine(i as f64))
    }

    /// Takes measured to true depth (mm), in place. 0 and NaN stay; NaN where there is no true depth.
    #[inline(always)]
    pub fn correct(&self, amplitudes: &[u16], z: &mut [f32]) {
        for (z, amplitude) in z.iter_mut().zip(amplitudes) {
            let i = usize::from(*amplitude);
            *z = Self::apply(self.p[i], self.q[i], *z);
        }
    }
}

impl ByCosine {
    /// The table, given m and c (mm) as functions of the cosine.
    pub fn over_cosine(affine: impl Fn(f64) -> [f64; 2]) -> Self {
        // Entry 0 is not used: a surface seen edge-on has no depth.
        Self::from_entries(|i| affine((i.max(1)) as f64 / (COSINES - 1) as f64))
    }

    /// Takes measured to true depth (mm), in place. 0 and NaN stay; NaN where there is no true depth.
    #[inline(always)]
    pub fn correct(&self, cosines: &[f32], z: &mut [f32]) {
        const LAST: f32 = (COSINES - 1) as f32;
        for (z, cosine) in z.iter_mut().zip(cosines) {
            let position = (*cosine * LAST).clamp(1.0, LAST);
            // Rounds down: at ≥ 1, so at − 0.5 is positive, and adding 2²³ rounds it to a whole number.
            let node = (position - 0.5 + 8_388_608.0) - 8_388_608.0;
            let (i, t) = ((node.to_index()) & (COSINES - 1), position - node);
            let next = (i + 1) & (COSINES - 1);
            let p = self.p[i] + t * (self.p[next] - self.p[i]);
            let q = self.q[i] + t * (self.q[next] - self.q[i]);
            *z = Self::apply(p, q, *z);
        }
    }
}

/// The whole number in an f32, without a conversion instruction.
trait Index {
    fn to_index(self) -> usize;
}

impl Index for f32 {
    /// For whole numbers below 2²³.
    #[inline(always)]
    fn to_index(self) -> usize {
        (self + 8_388_608.0).to_bits() as usize & 0x7f_ffff
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Linear between entries, up to a surface that is seen at a right angle.
    #[test]
    fn a_table_over_the_cosine_is_the_function() {
        let affine = |cosine: f64| [1.0 + 0.02 * (1.0 / cosine - 1.0), 8.0 * (1.0 / cosine - 1.0)];
        let table = ByCosine::over_cosine(affine);
        let cosines: Vec<f32> = (0..=800).map(|i| 0.2 + 0.001 * i as f32).chain([1.0]).collect();
        let mut z = vec![1000.0; cosines.len()];
        table.correct(&cosines, &mut z);
        for (cosine, z) in cosines.iter().zip(&z) {
            let [m, c] = affine(f64::from(*cosine).min(1.0));
            let expected = (1000.0 - c) / m;
            // f32 has steps of 6e-5 mm here; curvature 16/cos³ times an eighth of the squared distance of entries is 1.5e-5 mm.
            assert!((f64::from(*z) - expected).abs() < 2e-4, "{cosine}: {z} instead of {expected}");
        }
    }

    #[test]
    fn a_table_over_amplitude_has_every_value_of_its_own() {
        let affine = |amplitude: f64| [1.0 + 1e-6 * amplitude, 3.0 - 1e-4 * amplitude];
        let table = ByAmplitude::over_amplitude(affine);
        let amplitudes = [0, 1, 2, 40_000, u16::MAX];
        let mut z = [1000.0; 5];
        table.correct(&amplitudes, &mut z);
        for (amplitude, z) in amplitudes.into_iter().zip(z) {
            let [m, c] = affine(f64::from(amplitude));
            assert!((f64::from(z) - (1000.0 - c) / m).abs() < 2e-4, "{amplitude}: {z}");
        }
    }

    #[test]
    fn what_is_invalid_stays_and_what_has_no_depth_is_nan() {
        let table = ByAmplitude::over_amplitude(|amplitude| [if amplitude > 10.0 { -1.0 } else { 1.0 }, 50.0]);
        let mut z = [0.0, f32::NAN, 60.0, 40.0, 60.0, 50.0];
        table.correct(&[5, 5, 5, 5, 11, 5], &mut z);
        assert_eq!((z[0], z[2]), (0.0, 10.0));
        assert!(z[1].is_nan() && z[3..].iter().all(|z| z.is_nan()), "{z:?}");
    }
}
