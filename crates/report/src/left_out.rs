//! Board pixels that are no measurements of the board, and markers that were found in the wrong place. They are in none of the
//! errors: in words and numbers.

use super::format::{number, percent};
use depthcal_io::Outliers;

/// A share in per cent, of pixels of which some were left out: `0.04 %`, `< 0.01 %`, `0 %`; a dash where there is none.
pub(crate) fn share(share: Option<f64>) -> String {
    match share {
        None => "–".to_owned(),
        Some(0.0) => "0 %".to_owned(),
        Some(share) if 100.0 * share < 0.005 => "< 0.01 %".to_owned(),
        Some(share) => percent(100.0 * share),
    }
}

/// Pixels that were left out, in a sentence.
pub(crate) fn sentence(o: &Outliers) -> String {
    if o.count == 0 {
        return "None of the board's pixels were left out.".to_owned();
    }
    format!(
        "{} of the board's pixels were left out: more than {} mm off at the median distance, they are no measurements of the board.",
        share(Some(o.share)),
        number(o.limit_mm)
    )
}

/// The markers that were left out, in a sentence.
pub(crate) fn markers(wrong: usize) -> String {
    format!(
        "{} left out: more than a pixel from where the fit has them.",
        match wrong {
            1 => "One marker was".to_owned(),
            more => format!("{more} markers were"),
        }
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_keep_what_little_there_is() {
        let shares = [None, Some(0.0), Some(1e-6), Some(0.0004), Some(0.0567), Some(0.5)].map(share);
        assert_eq!(shares, ["–", "0 %", "< 0.01 %", "0.04 %", "5.67 %", "50.0 %"]);
        let some = Outliers { count: 3, share: 0.0004, limit_mm: 52.34 };
        assert!(sentence(&some).starts_with("0.04 % of the board's pixels were left out: more than 52.3 mm off"));
        assert!(sentence(&Outliers { count: 0, ..some }).starts_with("None of the board's pixels"));
    }
}
