//! The units of constants that have none declared, as far as a formula determines them.

use super::unit::{Base, Unit};

/// Units of constants as far as they are known, by number: a unit may itself contain others that are not known.
#[derive(Debug, Clone, Default)]
pub(crate) struct Inference {
    known: Vec<Option<Unit>>,
}

impl Inference {
    /// A unit that is not known yet.
    pub fn unknown(&mut self) -> Unit {
        self.known.push(None);
        Unit::base(Base::Unknown(self.known.len() - 1))
    }

    /// The unit with everything put in that is known.
    pub fn resolve(&self, unit: &Unit) -> Unit {
        unit.exponents.iter().fold(Unit::one(), |product, (base, exponent)| {
            let resolved = match base {
                Base::Unknown(i) => self.known[*i].as_ref().map(|known| self.resolve(known)),
                _ => None,
            };
            product.times(&resolved.unwrap_or_else(|| Unit::base(*base)).power(*exponent))
        })
    }

    /// Makes two units equal, which may determine an unknown one; false where they differ.
    pub fn equate(&mut self, a: &Unit, b: &Unit) -> bool {
        let quotient = self.resolve(&a.over(b));
        if quotient.is_one() {
            return true;
        }
        let unknown = quotient.exponents.iter().find_map(|(base, exponent)| match base {
            Base::Unknown(i) => Some((*i, *exponent)),
            _ => None,
        });
        let Some((i, exponent)) = unknown else { return false };
        let others = quotient.over(&Unit::base(Base::Unknown(i)).power(exponent));
        self.known[i] = Some(others.power(-1.0 / exponent));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_units_follow_from_equations() {
        let mut inference = Inference::default();
        let (a, b) = (inference.unknown(), inference.unknown());
        let mm = Unit::parse("mm").unwrap();
        assert!(inference.equate(&a.over(&b), &mm));
        assert!(inference.equate(&b.times(&b), &mm));
        assert_eq!(inference.resolve(&a).to_string(), "mm^1.5");
        assert!(!inference.equate(&a, &mm));
        assert!(inference.equate(&a, &mm.power(1.5)));
    }
}
