//! Corrections that depend on a second quantity of the pixel: its amplitude or its angle of incidence.
//!
//! At a value of that quantity the piece is affine in depth, z_m = m z + c, and so is its inverse: z = z_m + p z_m + q with
//! p = 1/m − 1, q = −c/m. Both are tables over the quantity.

/// Entries of the table over amplitude: one for each 16-bit value.
const AMPLITUDES: usize = 1 << 16;
/// Entries of the table over the cosine of the angle of incidence.
const COSINES: usize = 1 << 12;

/// p and q (mm) over a quantity.
#[derive(Debug, Clone)]
pub(super) struct Lookup<const N: usize> {
    p: Box<[f32; N]>,
    q: Box<[f32; N]>,
}

pub(super) type ByAmplitude = Lookup<AMPLITUDES>;
pub(super) type ByCosine = Lookup<COSINES>;

impl<const N: usize> Lookup<N> {
    /// `affine` gives m and c (mm) of an entry.
    fn from_entries(affine: impl Fn(usize) -> [f64; 2]) -> Self {
        let table = |value: &dyn Fn([f64; 2]) -> f64| {
            let values: Vec<f32> = (0..N).map(|i| value(affine(i)) as f32).collect();
            values.into_boxed_slice().try_into().unwrap_or_else(|_| Box::new([0.0; N]))
        };
        // A falling map has no inverse: NaN is then inverted exactly, that is, found not to be correctable.
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
    /// `affine` gives m and c (mm) at an amplitude.
    pub fn over_amplitude(affine: impl Fn(f64) -> [f64; 2]) -> Self {
        Self::from_entries(|i| affine(i as f64))
    }

    /// Measured to true depth (mm) in place; 0 and NaN stay.
    #[inline(always)]
    pub fn correct(&self, amplitudes: &[u16], z: &mut [f32]) {
        for (z, amplitude) in z.iter_mut().zip(amplitudes) {
            let i = usize::from(*amplitude);
            *z = Self::apply(self.p[i], self.q[i], *z);
        }
    }
}

impl ByCosine {
    /// `affine` gives m and c (mm) at the cosine of an angle.
    pub fn over_cosine(affine: impl Fn(f64) -> [f64; 2]) -> Self {
        // Entry 0 is unused: surfaces seen edge-on have no depth.
        Self::from_entries(|i| affine((i.max(1)) as f64 / (COSINES - 1) as f64))
    }

    /// Measured to true depth (mm) in place; 0 and NaN stay.
    #[inline(always)]
    pub fn correct(&self, cosines: &[f32], z: &mut [f32]) {
        const LAST: f32 = (COSINES - 1) as f32;
        for (z, cosine) in z.iter_mut().zip(cosines) {
            let at = (*cosine * LAST).clamp(1.0, LAST);
            // Rounded down by the addition: at ≥ 1, so what is taken away leaves no half.
            let node = (at - 0.5 + 8_388_608.0) - 8_388_608.0;
            let (i, t) = ((node.to_bits_index()) & (COSINES - 1), at - node);
            let next = (i + 1) & (COSINES - 1);
            let p = self.p[i] + t * (self.p[next] - self.p[i]);
            let q = self.q[i] + t * (self.q[next] - self.q[i]);
            *z = Self::apply(p, q, *z);
        }
    }
}

trait Index {
    fn to_bits_index(self) -> usize;
}

impl Index for f32 {
    /// The whole number that an f32 below 2²³ is.
    #[inline(always)]
    fn to_bits_index(self) -> usize {
        (self + 8_388_608.0).to_bits() as usize & 0x7f_ffff
    }
}
