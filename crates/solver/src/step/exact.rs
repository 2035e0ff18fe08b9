//! Floating-point numbers as text that preserves every bit.

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

/// Numbers, serialised as one string of their shortest decimal forms that parse to the same bits, infinities and NaN
/// included. Numbers in JSON have neither infinities nor NaN, and readers may round them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Exact(pub Vec<f64>);

impl Serialize for Exact {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let words: Vec<String> = self.0.iter().map(|x| format!("{x:?}")).collect();
        serializer.serialize_str(&words.join(" "))
    }
}

impl<'de> Deserialize<'de> for Exact {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let number = |word: &str| word.parse().map_err(|_| D::Error::custom(format!("\"{word}\" is not a number")));
        text.split_ascii_whitespace().map(number).collect::<Result<_, _>>().map(Exact)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_survive() {
        let mut numbers = vec![
            0.0,
            -0.0,
            0.1,
            1.0 / 3.0,
            f64::MIN_POSITIVE,
            5e-324,
            f64::MAX,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
        ];
        let mut bits = 1_u64;
        for _ in 0..2000 {
            bits = bits.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            numbers.extend(Some(f64::from_bits(bits)).filter(|x| x.is_finite()));
        }
        let text = serde_json::to_string(&Exact(numbers.clone())).unwrap();
        let back: Exact = serde_json::from_str(&text).unwrap();
        let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&back.0), bits(&numbers));
        assert!(serde_json::from_str::<Exact>("\"1.0 x\"").is_err());
    }
}
