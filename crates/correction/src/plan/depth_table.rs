//! Functions of depth as tables whose node spacing grows with depth.
//!
//! The nodes divide every octave of depth into [`PER_OCTAVE`] equal intervals. The upper bits of a depth's f32 are then
//! its node and the lower bits its fraction of the interval: no logarithm, no division, and an index that cannot leave
//! the table.

/// Nodes of a table.
pub(crate) const NODES: usize = 1 << 15;
/// Nodes per octave.
const PER_OCTAVE: u32 = 1 << 12;
/// Bits of an f32 that are the fraction between two nodes.
const SHIFT: u32 = 23 - PER_OCTAVE.trailing_zeros();
/// Abscissa of the first node; the last lies eight octaves above.
const FIRST: f32 = 64.0;

/// The function's values at all nodes.
pub(crate) type Values = [f32; NODES];

/// Abscissa of a node.
pub(crate) fn node(index: usize) -> f32 {
    f32::from_bits(FIRST.to_bits() + ((index as u32) << SHIFT))
}

/// A table of zeros.
pub(crate) fn zeros() -> Box<Values> {
    vec![0.0; NODES].into_boxed_slice().try_into().unwrap_or_else(|_| Box::new([0.0; NODES]))
}

/// The interval of a table that an abscissa lies in.
#[derive(Clone, Copy)]
pub(crate) struct Cell {
    /// The node at the start of the interval.
    pub index: usize,
    /// Distance from that node as a share of the interval.
    pub fraction: f32,
    /// Whether the abscissa lies within the table. Where it does not, the other fields are those of some interval.
    pub inside: bool,
}

impl Cell {
    /// The cell of an abscissa. Every f32 has one, so that loops need no branch.
    #[inline(always)]
    pub fn of(x: f32) -> Self {
        let above = x.to_bits().wrapping_sub(FIRST.to_bits());
        let node = above >> SHIFT;
        let fraction = (above & ((1 << SHIFT) - 1)) as f32 * (1.0 / (1u32 << SHIFT) as f32);
        Self { index: (node as usize) & (NODES - 1), fraction, inside: node < NODES as u32 - 1 }
    }

    /// Length of the interval.
    #[inline(always)]
    pub fn length(self) -> f32 {
        f32::from_bits(FIRST.to_bits() + ((self.index as u32 + 1) << SHIFT))
            - f32::from_bits(FIRST.to_bits() + ((self.index as u32) << SHIFT))
    }

    /// Linear interpolation: the value, and its rise over the interval.
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
            let interpolated = node(cell.index) + cell.fraction * cell.length();
            assert!((interpolated - x).abs() <= x * 1e-7, "{x} {interpolated}");
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
        assert!((value - 3.0 * 777.77).abs() < 1e-3 && (rise - 3.0 * Cell::of(777.77).length()).abs() < 1e-3);
    }
}
