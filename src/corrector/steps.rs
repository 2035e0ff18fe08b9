//! 16-bit depth to 16-bit depth by one Möbius map, the path of most cameras, in one pass.
//!
//! What is added to a depth is rounded, not the sum: the measured steps are whole already. A result that lies so near the
//! middle between two steps that f32 cannot tell the side is looked at again in f64, so that results are those of the
//! exact inverse, rounded; that is one pixel in some ten thousand.

use super::bands::CHUNK;
use super::formats::count_u16;
use super::moebius::{Moebius, Slices, Tables};
use super::simd::{Isa, LANES};

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
    /// Whether all pixels have a ray and nothing is added to their depths: what is valid then stays so.
    whole: bool,
}

/// What f32 may be off, in steps: for a change of `share` of it, and `beside`; and the largest change.
#[derive(Clone, Copy)]
struct Errors {
    share: f32,
    beside: f32,
    change: f32,
}

/// What the exact inverse makes of a pixel (index, steps, what f32 made of it) in steps: the result and whether it was beyond
/// the ends.
pub(super) type Exact<'a> = &'a dyn Fn(usize, u16, u16) -> (u16, bool);

impl Errors {
    /// A result that misses its step by less than this is rounded to the right one.
    #[inline(always)]
    fn undecided(self) -> f32 {
        (0.5 - self.beside - self.share * self.change).max(0.0)
    }
}

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
            let whole = poles.len() == c.r.len() && c.q.is_empty() && p < 0.4;
            Bound { p, q: greatest(c.q), r: greatest(&poles), r_above, whole }
        };
        Self { chunks: (0..pixels).step_by(CHUNK).map(of_chunk).collect() }
    }

    /// Errors for depths of up to `steps`; `None` where results may leave 16 bits, or f32 is not enough.
    #[inline(always)]
    fn of(&self, chunk: usize, steps: u16, unit_mm: f32) -> Option<Errors> {
        let Bound { p, q, r, r_above, whole } = self.chunks[chunk];
        let steps = f32::from(steps);
        let z = steps * unit_mm;
        let left = 1.0 - r_above * z;
        let change = (steps * (p + r * z) + q / unit_mm) / left;
        // Half an ulp (6e-8) each for p, twice for r, for slope, product, what is left before the pole, one and a half for
        // the quotient; and what the pole magnifies of r's.
        let share = 4.2e-7 + 1.3e-7 * r * z / left;
        let usable = left > 0.05 && steps + change < 65535.0 && change * share < 0.05;
        // Depth must not shrink to half: then one step would round to none.
        let kept = !whole || 1.0 - p > 0.55 * (1.0 + r * z);
        // Where p, q and r cancel, the change is less than they are, and its error a share of theirs.
        let beside = 1e-6 + 3e-7 * (steps * p + q / unit_mm);
        (usable && kept).then_some(Errors { share, beside, change })
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
    let c = map.slices(first, measured.len());
    let whole = bounds.chunks[first / CHUNK].whole;
    match (map.tables(), whole) {
        (Tables::Pole, true) => {
            chunk::<I, false, false, true, true>(isa, c, bounds, first, unit_mm, measured, out, exact)
        }
        (Tables::Pole, false) => {
            chunk::<I, false, false, true, false>(isa, c, bounds, first, unit_mm, measured, out, exact)
        }
        (Tables::Scale, true) => {
            chunk::<I, true, false, false, true>(isa, c, bounds, first, unit_mm, measured, out, exact)
        }
        (Tables::Scale, false) => {
            chunk::<I, true, false, false, false>(isa, c, bounds, first, unit_mm, measured, out, exact)
        }
        (Tables::ScaleAndPole, true) => {
            chunk::<I, true, false, true, true>(isa, c, bounds, first, unit_mm, measured, out, exact)
        }
        (Tables::ScaleAndPole, false) => {
            chunk::<I, true, false, true, false>(isa, c, bounds, first, unit_mm, measured, out, exact)
        }
        (Tables::All, _) => chunk::<I, true, true, true, false>(isa, c, bounds, first, unit_mm, measured, out, exact),
    }
}

/// [`correct`] for one kind of tables.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn chunk<I: Isa, const P: bool, const Q: bool, const R: bool, const WHOLE: bool>(
    isa: I,
    c: Slices<'_>,
    bounds: &Bounds,
    first: usize,
    unit_mm: f32,
    measured: &[u16],
    out: &mut [u16],
    exact: Exact<'_>,
) -> Option<Done> {
    let Worst(worst) = rounded::<I, P, Q, R, WHOLE>(isa, c, unit_mm, measured, out);
    // After the pass, when the chunk is in the first-level cache.
    let (most, depths) = isa.most_and_count(measured);
    let errors = bounds.of(first / CHUNK, most, unit_mm)?;
    let mut saturated = 0;
    let undecided = errors.undecided().to_bits();
    for (group, worst) in worst.as_chunks::<LANES>().0.iter().enumerate() {
        if worst.iter().fold(0, |most, miss| (*miss).max(most)) < undecided {
            continue;
        }
        for column in (0..LANES).filter(|lane| worst[*lane] >= undecided).map(|lane| group * LANES + lane) {
            saturated += settle::<I, P, Q, R>(isa, c, (unit_mm, errors), column, measured, out, first, exact);
        }
    }
    // What is settled stays a depth.
    let mut corrected = if WHOLE { depths } else { count_u16(out) };
    if Q && depths != corrected {
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
    (if R { isa.divide(above, left) } else { above }, left)
}

/// Largest distances of results from the steps that they were rounded to, of every [`BLOCK`]th pixel: bits of f32, which order
/// as the numbers do. On lines of the cache, so that no store touches two.
#[repr(align(64))]
struct Worst([u32; BLOCK]);

/// Corrects and rounds, whether the errors allow it or not.
#[inline(always)]
fn rounded<I: Isa, const P: bool, const Q: bool, const R: bool, const WHOLE: bool>(
    isa: I,
    c: Slices<'_>,
    unit_mm: f32,
    measured: &[u16],
    out: &mut [u16],
) -> Worst {
    let mut worst = Worst([0; BLOCK]);
    let (blocks, rest) = measured.as_chunks::<BLOCK>();
    let (out_blocks, out_rest) = out.as_chunks_mut::<BLOCK>();
    for (b, (measured, out)) in blocks.iter().zip(out_blocks).enumerate() {
        rounded_block::<I, P, Q, R, WHOLE>(isa, c.part(b * BLOCK, BLOCK), unit_mm, measured, out, &mut worst.0);
    }
    let c = c.part(blocks.len() * BLOCK, rest.len());
    rounded_block::<I, P, Q, R, WHOLE>(isa, c, unit_mm, rest, out_rest, &mut worst.0);
    worst
}

/// [`rounded`] for up to a block.
#[inline(always)]
fn rounded_block<I: Isa, const P: bool, const Q: bool, const R: bool, const WHOLE: bool>(
    isa: I,
    c: Slices<'_>,
    unit_mm: f32,
    measured: &[u16],
    out: &mut [u16],
    worst: &mut [u32; BLOCK],
) {
    let n = measured.len();
    let p = if P { &c.p[..n] } else { c.p };
    let q = if Q { &c.q[..n] } else { c.q };
    let r = if R { &c.r[..n] } else { c.r };
    let (out, worst) = (&mut out[..n], &mut worst[..n]);
    let per_mm = 1.0 / unit_mm;
    for i in 0..n {
        let k = (if P { p[i] } else { c.p0 }, if Q { q[i] } else { 0.0 }, if R { r[i] } else { 0.0 });
        let steps = f32::from(measured[i]);
        let (change, left) = change::<I, Q, R>(isa, k, unit_mm, per_mm, steps);
        let rounded = change + ROUND_SIGNED;
        let miss = (change - (rounded - ROUND_SIGNED)).abs();
        worst[i] = worst[i].max(miss.to_bits());
        let sum = u32::from(measured[i]).wrapping_add(rounded.to_bits()) as u16;
        out[i] = if WHOLE {
            sum
        } else {
            let is_depth =
                if R { left > 0.0 } else { true } & if Q { (steps > 0.0) & (steps + change > 0.5) } else { true };
            if is_depth { sum } else { 0 }
        };
    }
}

/// Takes the pixels of a column of blocks that are undecided from f64. Returns how many of those were beyond the ends.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn settle<I: Isa, const P: bool, const Q: bool, const R: bool>(
    isa: I,
    c: Slices<'_>,
    (unit_mm, errors): (f32, Errors),
    column: usize,
    measured: &[u16],
    out: &mut [u16],
    first: usize,
    exact: Exact<'_>,
) -> usize {
    let mut saturated = 0;
    for i in (column..measured.len()).step_by(BLOCK) {
        let k = (if P { c.p[i] } else { c.p0 }, if Q { c.q[i] } else { 0.0 }, if R { c.r[i] } else { 0.0 });
        let (change, _) = change::<I, Q, R>(isa, k, unit_mm, 1.0 / unit_mm, f32::from(measured[i]));
        let miss = (change - ((change + ROUND_SIGNED) - ROUND_SIGNED)).abs();
        let undecided = isa.mul_add(change.abs(), errors.share, miss) >= 0.5 - errors.beside;
        if undecided && measured[i] > 0 && out[i] > 0 {
            let (steps, beyond) = exact(first + i, measured[i], out[i]);
            out[i] = steps;
            saturated += usize::from(beyond);
        }
    }
    saturated
}

/// Pixels that are taken at a time.
const BLOCK: usize = 64;
