//! Functions of depth as tables whose steps grow with depth.
//!
//! The nodes divide every octave of depth into [`PER_OCTAVE`] equal steps, so that the node of a depth is the upper bits of
//! its f32 and the fraction the lower ones: no logarithm, no division, and an index that cannot leave the table.

/// Nodes of a table.
pub(super) const NODES: usize = 1 << 15;
/// Nodes per octave.
const PER_OCTAVE: u32 = 1 << 12;
/// Bits of an f32 below a node's.
const SHIFT: u32 = 23 - PER_OCTAVE.trailing_zeros();
/// First depth of a table; the last lies eight octaves above.
const FIRST: f32 = 64.0;

/// One table, in mm or whatever the function's values are.
pub(super) type Values = [f32; NODES];

/// Abscissa of a node.
pub(super) fn node(index: usize) -> f32 {
    f32::from_bits(FIRST.to_bits() + ((index as u32) << SHIFT))
}

/// A table of zeros.
pub(super) fn zeros() -> Box<Values> {
    vec![0.0; NODES].into_boxed_slice().try_into().unwrap_or_else(|_| Box::new([0.0; NODES]))
}

/// Where an abscissa lies: node, the fraction of the step behind it, and whether the table reaches that far.
#[derive(Clone, Copy)]
pub(super) struct Cell {
    pub index: usize,
    pub fraction: f32,
    pub inside: bool,
}

impl Cell {
    /// The cell of an abscissa; any number has one, so that a loop needs no test before it.
    #[inline(always)]
    pub fn of(x: f32) -> Self {
        let above = x.to_bits().wrapping_sub(FIRST.to_bits());
        let node = above >> SHIFT;
        let fraction = (above & ((1 << SHIFT) - 1)) as f32 * (1.0 / (1u32 << SHIFT) as f32);
        Self { index: (node as usize) & (NODES - 1), fraction, inside: node < NODES as u32 - 1 }
    }

    /// Length of its step.
    #[inline(always)]
    pub fn step(self) -> f32 {
        f32::from_bits(FIRST.to_bits() + ((self.index as u32 + 1) << SHIFT))
            - f32::from_bits(FIRST.to_bits() + ((self.index as u32) << SHIFT))
    }

    /// Linear between the nodes: the value and the rise over the step.
    #[inline(always)]
    pub fn value_and_rise(self, values: &Values) -> (f32, f32) {
        let here = values[self.index];
        let rise = values[(self.index + 1) & (NODES - 1)] - here;
        (here + self.fraction * rise, rise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_found_from_the_bits() {
        assert_eq!((node(0), node(NODES - 1) < 16384.0), (64.0, true));
        for x in [64.0f32, 64.01, 100.0, 999.9, 1024.0, 5000.1, 16370.0] {
            let cell = Cell::of(x);
            assert!(cell.inside);
            let found = node(cell.index) + cell.fraction * cell.step();
            assert!((found - x).abs() <= x * 1e-7, "{x} {found}");
        }
        for x in [0.0f32, 1.0, 63.9, 16384.0, f32::MAX, f32::INFINITY, f32::NAN, -100.0] {
            assert!(!Cell::of(x).inside, "{x}");
        }
    }

    #[test]
    fn interpolation_is_linear() {
        let mut values = zeros();
        for (i, value) in values.iter_mut().enumerate() {
            *value = 3.0 * node(i);
        }
        let (value, rise) = Cell::of(777.77).value_and_rise(&values);
        assert!((value - 3.0 * 777.77).abs() < 1e-3 && (rise - 3.0 * Cell::of(777.77).step()).abs() < 1e-3);
    }
}
