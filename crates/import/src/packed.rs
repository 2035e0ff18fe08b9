//! Grey values of 10 and 12 bits without gaps between them, as cameras send them.

/// How values lie in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Packing {
    /// A stream of bits, the lowest first: GenICam's Mono10p and Mono12p (Pixel Format Naming Convention 2.1).
    Stream(usize),
    /// The high bytes of two values, and between them their low bits: GigE Vision's Mono10Packed and Mono12Packed.
    Pairs(usize),
    /// The high bytes of four or two values, then one byte with their low bits: MIPI's RAW10 and RAW12, V4L2's Y10P and Y12P.
    Groups(usize),
}

impl Packing {
    /// By the name of an encoding.
    pub fn of(name: &str) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_str() {
            "mono10p" => Packing::Stream(10),
            "mono12p" => Packing::Stream(12),
            "mono10packed" => Packing::Pairs(10),
            "mono12packed" => Packing::Pairs(12),
            "y10p" | "raw10" => Packing::Groups(10),
            "y12p" | "raw12" => Packing::Groups(12),
            _ => return None,
        })
    }

    /// Bytes and values of what repeats.
    fn group(self) -> [usize; 2] {
        match self {
            Packing::Stream(10) | Packing::Groups(10) => [5, 4],
            _ => [3, 2],
        }
    }

    /// Bytes of a row; `None` where there is no such number.
    pub fn row_bytes(self, width: usize) -> Option<usize> {
        let [bytes, values] = self.group();
        width.div_ceil(values).checked_mul(bytes)
    }

    /// The values of an image of `width` and `height` whose rows are `step` bytes apart; rows that the data lack are left out.
    pub fn unpack(self, data: &[u8], step: usize, [width, height]: [usize; 2]) -> Vec<u16> {
        let bytes = self.row_bytes(width).unwrap_or(usize::MAX);
        let rows = (0..height).filter_map(|row| data.get(row * step..)?.get(..bytes));
        rows.flat_map(|row| (0..width).map(move |u| self.value(row, u))).collect()
    }

    fn value(self, row: &[u8], u: usize) -> u16 {
        let [bytes, values] = self.group();
        let group = &row[u / values * bytes..][..bytes];
        let byte = |i: usize| u16::from(group[i]);
        let k = u % values;
        match self {
            Packing::Stream(bits) => {
                let all = group.iter().rev().fold(0_u64, |all, byte| all << 8 | u64::from(*byte));
                (all >> (k * bits)) as u16 & ((1 << bits) - 1)
            }
            Packing::Pairs(bits) => byte(2 * k) << (bits - 8) | byte(1) >> (4 * k) & ((1 << (bits - 8)) - 1),
            Packing::Groups(bits) => byte(k) << (bits - 8) | byte(values) >> (k * (bits - 8)) & ((1 << (bits - 8)) - 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_by_the_definitions_of_the_formats() {
        // Two values of 12 bits, 0xabc and 0x123; four of 10 bits, 0x3ff, 0x000, 0x155 and 0x2aa.
        let two = [0xabc, 0x123];
        assert_eq!(Packing::Stream(12).unpack(&[0xbc, 0x3a, 0x12], 3, [2, 1]), two);
        assert_eq!(Packing::Pairs(12).unpack(&[0xab, 0x3c, 0x12], 3, [2, 1]), two);
        assert_eq!(Packing::Groups(12).unpack(&[0xab, 0x12, 0x3c], 3, [2, 1]), two);
        let four = [0x3ff, 0x000, 0x155, 0x2aa];
        assert_eq!(Packing::Stream(10).unpack(&[0xff, 0x03, 0x50, 0x95, 0xaa], 5, [4, 1]), four);
        assert_eq!(Packing::Groups(10).unpack(&[0xff, 0x00, 0x55, 0xaa, 0b1001_0011], 5, [4, 1]), four);
        assert_eq!(Packing::Pairs(10).unpack(&[0xff, 0x03, 0x00, 0x55, 0x21, 0xaa], 6, [4, 1]), four);
        // Odd widths end within a group, and rows have their own beginnings.
        let rows = [0xbc, 0x3a, 0x12, 0xff, 0x23, 0xf1, 0x00, 0xff];
        assert_eq!(Packing::Stream(12).unpack(&rows, 4, [1, 2]), [0xabc, 0x123]);
        assert_eq!(Packing::Stream(12).row_bytes(3), Some(6));
    }
}
