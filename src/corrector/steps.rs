//! 16-bit depth to 16-bit depth by one Möbius map, the path of most cameras, in one pass.
//!
//! What is added to a depth is rounded, not the sum: the measured steps are whole already. A result that lies so near the
//! middle between two steps that f32 cannot tell the side is looked at again in f64, so that results are those of the
//! exact inverse, rounded; that is one pixel in some ten thousand.

use super::bands::CHUNK;
use super::formats::count_u16;
use super::moebius::{Moebius, Slices, Tables};
use super::simd::Isa;

/// 1.5 · 2²³: as [`super::formats::ROUND`], for negative numbers too.
const ROUND_SIGNED: f32 = 12_582_912.0;

/// Largest coefficients of each chunk, which bound what a chunk's largest depth can become.
#[derive(Debug, Clone)]
pub(super) struct Bounds {
    chunks: Vec<Bound>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Bound {
    p: f32,
    q: f32,
    r: f32,
    r_above: f32,
}

/// What the exact inverse makes of a pixel (index, steps, what f32 made of it) in steps: the result and whether it was beyond
/// the ends.
pub(super) type Exact<'a> = &'a dyn Fn(usize, u16, u16) -> (u16, bool);

impl Bounds {
    /// The bounds of a map over `pixels` pixels.
    pub fn new(map: &Moebius, pixels: usize) -> Self {
        let of_chunk = |first: usize| {
            let c = map.slices(first, CHUNK.min(pixels - first));
            let greatest = |values: &[f32]| values.iter().fold(0.0f32, |m, v| m.max(v.abs()));
            // Pixels that correct nothing have no part: whatever their depth, they have none.
            let poles: Vec<f32> = c.r.iter().copied().filter(|r| *r < 1e29).collect();
            let r_above = poles.iter().copied().fold(0.0, f32::max);
            let p = if c.p.is_empty() { c.p0.abs() } else { greatest(c.p) };
            Bound { p, q: greatest(c.q), r: greatest(&poles), r_above }
        };
        Self { chunks: (0..pixels).step_by(CHUNK).map(of_chunk).collect() }
    }

    /// Largest error of a change in f32, as a share of it and in steps beside, for depths of up to `steps`; `None` where
    /// results may leave 16 bits, or f32 is not enough.
    #[inline(always)]
    fn of(&self, chunk: usize, steps: u16, unit_mm: f32) -> Option<[f32; 2]> {
        let Bound { p, q, r, r_above } = self.chunks[chunk];
        let steps = f32::from(steps);
        let z = steps * unit_mm;
        let left = 1.0 - r_above * z;
        let change = (steps * (p + r * z) + q / unit_mm) / left;
        // Half an ulp each for the two coefficients, the products, the quotient; and what the pole magnifies.
        let error = 4e-7 + 2e-7 * (1.0 + r * z) / left;
        let usable = left > 0.05 && steps + change < 65535.0 && change * error < 0.05;
        // Where p, q and r cancel, the change is less than they are, and its error a share of theirs.
        usable.then_some([error, 1e-6 + 3e-7 * (steps * p + q / unit_mm)])
    }
}

/// What became of some pixels.
pub(super) struct Done {
    pub depths: usize,
    pub corrected: usize,
    pub saturated: usize,
}

/// Corrects a chunk; `None`, with `out` undefined, where it is beyond what this path can do.
#[inline(always)]
pub(super) fn correct<I: Isa>(
    isa: I,
    (map, bounds): (&Moebius, &Bounds),
    first: usize,
    unit_mm: f32,
    measured: &[u16],
    out: &mut [u16],
    exact: Exact<'_>,
) -> Option<Done> {
    let (mut most, mut depths) = (0, 0u16);
    for raw in measured {
        most = most.max(*raw);
        // A chunk has fewer pixels than 16 bits count.
        depths += (*raw).min(1);
    }
    let depths = usize::from(depths);
    let [error, beside] = bounds.of(first / CHUNK, most, unit_mm)?;
    let c = map.slices(first, measured.len());
    let worst = match map.tables() {
        Tables::Pole => rounded::<I, false, false, true>(isa, c, (unit_mm, error), measured, out),
        Tables::Scale => rounded::<I, true, false, false>(isa, c, (unit_mm, error), measured, out),
        Tables::ScaleAndPole => rounded::<I, true, false, true>(isa, c, (unit_mm, error), measured, out),
        Tables::All => rounded::<I, true, true, true>(isa, c, (unit_mm, error), measured, out),
    };
    let mut saturated = 0;
    let undecided = 0.5 - beside;
    if worst >= undecided {
        saturated = match map.tables() {
            Tables::Pole => {
                settle::<I, false, false, true>(isa, c, (unit_mm, error), measured, out, undecided, first, exact)
            }
            Tables::Scale => {
                settle::<I, true, false, false>(isa, c, (unit_mm, error), measured, out, undecided, first, exact)
            }
            Tables::ScaleAndPole => {
                settle::<I, true, false, true>(isa, c, (unit_mm, error), measured, out, undecided, first, exact)
            }
            Tables::All => {
                settle::<I, true, true, true>(isa, c, (unit_mm, error), measured, out, undecided, first, exact)
            }
        };
    }
    let mut corrected = count_u16(out);
    if depths != corrected && !map.q.is_empty() {
        // An offset may take small depths below half a step, which is no reason to lose them.
        for (i, (raw, out)) in measured.iter().zip(out.iter_mut()).enumerate() {
            if *raw > 0 && *out == 0 {
                let (steps, beyond) = exact(first + i, *raw, 0);
                *out = steps;
                saturated += usize::from(beyond);
            }
        }
        corrected = count_u16(out);
    }
    Some(Done { depths, corrected, saturated })
}

/// The change of one pixel, in steps, and what is left of 1 before the pole.
#[inline(always)]
fn change<I: Isa, const Q: bool, const R: bool>(
    isa: I,
    (p, q, r): (f32, f32, f32),
    unit_mm: f32,
    per_mm: f32,
    steps: f32,
) -> (f32, f32) {
    let r = r * unit_mm;
    let slope = if R { isa.mul_add(r, steps, p) } else { p };
    let above = if Q { isa.mul_add(steps, slope, q * per_mm) } else { steps * slope };
    let left = if R { isa.mul_add(-r, steps, 1.0) } else { 1.0 };
    (if R { above / left } else { above }, left)
}

/// Corrects, and returns the largest distance of a result from the step that it was rounded to, with its error.
#[inline(always)]
fn rounded<I: Isa, const P: bool, const Q: bool, const R: bool>(
    isa: I,
    c: Slices<'_>,
    (unit_mm, error): (f32, f32),
    measured: &[u16],
    out: &mut [u16],
) -> f32 {
    let n = measured.len();
    let p = if P { &c.p[..n] } else { c.p };
    let q = if Q { &c.q[..n] } else { c.q };
    let r = if R { &c.r[..n] } else { c.r };
    let out = &mut out[..n];
    let per_mm = 1.0 / unit_mm;
    // The maximum of f32 above 0 is that of their bits, which the compiler may take in any order.
    let mut worst = 0u32;
    for i in 0..n {
        let k = (if P { p[i] } else { c.p0 }, if Q { q[i] } else { 0.0 }, if R { r[i] } else { 0.0 });
        let (change, left) = change::<I, Q, R>(isa, k, unit_mm, per_mm, f32::from(measured[i]));
        let rounded = change + ROUND_SIGNED;
        let missing = change - (rounded - ROUND_SIGNED);
        worst = worst.max(isa.mul_add(change.abs(), error, missing.abs()).to_bits());
        let sum = u32::from(measured[i]).wrapping_add(rounded.to_bits()) as u16;
        let steps = f32::from(measured[i]);
        let is_depth =
            if R { left > 0.0 } else { true } & if Q { (steps > 0.0) & (steps + change > 0.5) } else { true };
        out[i] = if is_depth { sum } else { 0 };
    }
    f32::from_bits(worst)
}

/// Goes through a chunk again and takes the pixels whose distance from their step is `undecided` from f64. Returns how many
/// of those were beyond the ends.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn settle<I: Isa, const P: bool, const Q: bool, const R: bool>(
    isa: I,
    c: Slices<'_>,
    (unit_mm, error): (f32, f32),
    measured: &[u16],
    out: &mut [u16],
    undecided: f32,
    first: usize,
    exact: Exact<'_>,
) -> usize {
    let n = measured.len();
    let p = if P { &c.p[..n] } else { c.p };
    let q = if Q { &c.q[..n] } else { c.q };
    let r = if R { &c.r[..n] } else { c.r };
    let per_mm = 1.0 / unit_mm;
    let mut distances = [0.0f32; CHUNK];
    let distances = &mut distances[..n];
    for i in 0..n {
        let k = (if P { p[i] } else { c.p0 }, if Q { q[i] } else { 0.0 }, if R { r[i] } else { 0.0 });
        let (change, _) = change::<I, Q, R>(isa, k, unit_mm, per_mm, f32::from(measured[i]));
        let missing = change - ((change + ROUND_SIGNED) - ROUND_SIGNED);
        distances[i] = isa.mul_add(change.abs(), error, missing.abs());
    }
    let mut saturated = 0;
    for (b, block) in distances.chunks(BLOCK).enumerate() {
        let worst = block.iter().fold(0, |m: u32, d| m.max(d.to_bits()));
        if f32::from_bits(worst) < undecided {
            continue;
        }
        for i in b * BLOCK..b * BLOCK + block.len() {
            if distances[i] >= undecided && measured[i] > 0 && out[i] > 0 {
                let (steps, beyond) = exact(first + i, measured[i], out[i]);
                out[i] = steps;
                saturated += usize::from(beyond);
            }
        }
    }
    saturated
}

/// Pixels that are looked through together for those that are undecided.
const BLOCK: usize = 64;
