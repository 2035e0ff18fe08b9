//! Sizes of paper.

use std::str::FromStr;

use super::error::BoardPrintError;

/// A sheet of paper, upright.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Paper {
    /// Width and height, mm.
    pub size_mm: [f64; 2],
}

/// ISO 216 and the American sizes, mm.
const NAMED: &[(&str, [f64; 2])] = &[
    ("a5", [148.0, 210.0]),
    ("a4", [210.0, 297.0]),
    ("a3", [297.0, 420.0]),
    ("a2", [420.0, 594.0]),
    ("a1", [594.0, 841.0]),
    ("a0", [841.0, 1189.0]),
    ("letter", [215.9, 279.4]),
    ("legal", [215.9, 355.6]),
    ("tabloid", [279.4, 431.8]),
];

impl Paper {
    /// The smallest of A4 … A0, upright or turned, that holds `needs_mm`; where none does, a sheet of that size.
    pub fn fitting(needs_mm: [f64; 2]) -> Paper {
        let series = NAMED.iter().filter(|(name, _)| name.starts_with('a') && *name != "a5");
        let sheets = series.flat_map(|(_, [w, h])| [[*w, *h], [*h, *w]]);
        let holds = |sheet: &[f64; 2]| needs_mm[0] <= sheet[0] && needs_mm[1] <= sheet[1];
        Paper { size_mm: sheets.into_iter().find(holds).unwrap_or(needs_mm.map(f64::ceil)) }
    }

    /// The sheet, turned where only that holds `needs_mm`.
    pub fn turned_for(self, needs_mm: [f64; 2]) -> Paper {
        let [w, h] = self.size_mm;
        let holds = |size: [f64; 2]| needs_mm[0] <= size[0] && needs_mm[1] <= size[1];
        if !holds([w, h]) && holds([h, w]) { Paper { size_mm: [h, w] } } else { self }
    }
}

impl FromStr for Paper {
    type Err = BoardPrintError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let name = text.trim().to_lowercase();
        if let Some((_, size_mm)) = NAMED.iter().find(|(known, _)| *known == name) {
            return Ok(Paper { size_mm: *size_mm });
        }
        let side = |text: &str| text.trim().parse().ok().filter(|side: &f64| (10.0..=20_000.0).contains(side));
        let size = name.split_once(['x', '×']).and_then(|(w, h)| Some([side(w)?, side(h)?]));
        size.map(|size_mm| Paper { size_mm }).ok_or_else(|| BoardPrintError::UnknownPaper { name: text.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_sizes_and_what_fits() {
        assert_eq!("A4".parse::<Paper>().unwrap().size_mm, [210.0, 297.0]);
        assert_eq!("600x400".parse::<Paper>().unwrap().size_mm, [600.0, 400.0]);
        for wrong in ["a9", "600", "0x5", "nanx5", ""] {
            assert!(wrong.parse::<Paper>().unwrap_err().to_string().contains("a0"), "{wrong}");
        }
        assert_eq!(Paper::fitting([200.0, 250.0]).size_mm, [210.0, 297.0]);
        assert_eq!(Paper::fitting([250.0, 200.0]).size_mm, [297.0, 210.0]);
        assert_eq!(Paper::fitting([300.0, 300.0]).size_mm, [420.0, 594.0]);
        assert_eq!(Paper::fitting([2000.0, 30.2]).size_mm, [2000.0, 31.0]);
        assert_eq!("a4".parse::<Paper>().unwrap().turned_for([250.0, 200.0]).size_mm, [297.0, 210.0]);
    }
}
