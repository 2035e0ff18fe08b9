//! Quantities of whole frames that users record in columns of their own: exposure, power of the laser, gain, ambient light.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::{LazyLock, Mutex, PoisonError};

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Most quantities of a frame besides its time and its temperature. Observations carry their values, so the number is fixed, and
/// small: with it they are two cache lines long.
pub const MOST_QUANTITIES: usize = 6;

/// Ends of names that are units: the end, the unit as formulas have it, and a usual range, over which formulas are checked.
const UNITS: [(&str, &str, [f64; 2]); 21] = [
    ("1", "1", [0.1, 10.0]),
    ("percent", "percent", [1.0, 100.0]),
    ("db", "dB", [1.0, 40.0]),
    ("us", "us", [100.0, 30_000.0]),
    ("ms", "ms", [0.1, 33.0]),
    ("s", "s", [0.1, 100.0]),
    ("hz", "Hz", [1.0, 1000.0]),
    ("rpm", "rpm", [100.0, 10_000.0]),
    ("mm", "mm", [1.0, 1000.0]),
    ("px", "px", [1.0, 1000.0]),
    ("deg", "deg", [1.0, 90.0]),
    ("rad", "rad", [0.01, 1.5]),
    ("c", "°C", [15.0, 45.0]),
    ("g", "g", [0.1, 1.0]),
    ("mw", "mW", [1.0, 500.0]),
    ("w", "W", [0.1, 20.0]),
    ("ma", "mA", [10.0, 3000.0]),
    ("a", "A", [0.1, 5.0]),
    ("mv", "mV", [10.0, 5000.0]),
    ("v", "V", [1.0, 24.0]),
    ("lx", "lx", [1.0, 10_000.0]),
];

/// Longest name, as of any name in a formula.
const LONGEST: usize = 60;

struct Known {
    name: &'static str,
    unit: &'static str,
    range: [f64; 2],
}

/// A column of `frames.csv` whose name ends in an underscore and its unit, such as `exposure_ms` or `gain_1`.
#[derive(Clone, Copy)]
pub struct Quantity(&'static Known);

static KNOWN: LazyLock<Mutex<BTreeMap<&'static str, Quantity>>> = LazyLock::new(Mutex::default);
static LISTS: LazyLock<Mutex<BTreeSet<&'static Names>>> = LazyLock::new(Mutex::default);

impl Quantity {
    /// The quantity of that name; `None` where the name does not end in a unit, or is none that a formula could have.
    pub fn named(name: &str) -> Option<Self> {
        let (stem, end) = name.rsplit_once('_')?;
        let (_, unit, range) = UNITS.iter().find(|(known, ..)| *known == end)?;
        let is_name = stem.starts_with(|c: char| c.is_ascii_alphabetic())
            && stem.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !is_name || name.len() > LONGEST || ["timestamp_s", "temperature_c"].contains(&name) {
            return None;
        }
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(quantity) = known.get(name) {
            return Some(*quantity);
        }
        // Memory grows with the number of different names only.
        let name: &'static str = Box::leak(name.to_owned().into_boxed_str());
        let quantity = Self(Box::leak(Box::new(Known { name, unit, range: *range })));
        known.insert(name, quantity);
        Some(quantity)
    }

    /// Its name: that of the column.
    pub const fn name(self) -> &'static str {
        self.0.name
    }

    /// Its unit, as formulas have it.
    pub const fn unit(self) -> &'static str {
        self.0.unit
    }

    /// A usual range of quantities in this unit.
    pub const fn typical_range(self) -> [f64; 2] {
        self.0.range
    }

    /// The ends of names that are units, with the unit.
    pub fn units() -> impl Iterator<Item = (&'static str, &'static str)> {
        UNITS.iter().map(|(end, unit, _)| (*end, *unit))
    }
}

impl PartialEq for Quantity {
    #[inline]
    fn eq(&self, other: &Self) -> bool {
        // Each name is known once.
        std::ptr::eq(self.0, other.0)
    }
}

impl Eq for Quantity {}

impl Ord for Quantity {
    fn cmp(&self, other: &Self) -> Ordering {
        self.name().cmp(other.name())
    }
}

impl PartialOrd for Quantity {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Hash for Quantity {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.name().hash(state);
    }
}

impl fmt::Debug for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Quantity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::named(&name)
            .ok_or_else(|| D::Error::custom(format!("'{name}' does not end in a unit, as exposure_ms does")))
    }
}

/// Quantities in the order of their names. References to it are half as long as those to a slice.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Names(Vec<Quantity>);

/// The quantities of a frame with their values, in single precision: no sensor tells more digits of an exposure.
#[derive(Clone, Copy)]
pub struct Quantities {
    names: &'static Names,
    /// As many as there are names, then NaN.
    values: [f32; MOST_QUANTITIES],
}

static NO_NAMES: Names = Names(Vec::new());

impl Quantities {
    /// Nothing is known.
    pub const NONE: Self = Self { names: &NO_NAMES, values: [f32::NAN; MOST_QUANTITIES] };

    /// Values of quantities; of more than [`MOST_QUANTITIES`] the first by their names.
    pub fn new(given: impl IntoIterator<Item = (Quantity, f64)>) -> Self {
        let given: BTreeMap<Quantity, f64> = given.into_iter().collect();
        if given.is_empty() {
            return Self::NONE;
        }
        let names = Names(given.keys().copied().take(MOST_QUANTITIES).collect());
        let mut values = [f32::NAN; MOST_QUANTITIES];
        values.iter_mut().zip(given.values()).for_each(|(value, given)| *value = *given as f32);
        let mut lists = LISTS.lock().unwrap_or_else(PoisonError::into_inner);
        let known = lists.get(&names).copied();
        let names = known.unwrap_or_else(|| {
            let leaked: &'static Names = Box::leak(Box::new(names));
            lists.insert(leaked);
            leaked
        });
        Self { names, values }
    }

    /// The value of one; NaN where it is unknown.
    #[inline]
    pub fn value(&self, quantity: Quantity) -> f64 {
        self.names.0.iter().position(|name| *name == quantity).map_or(f64::NAN, |i| f64::from(self.values[i]))
    }

    /// Those that are known, with their values.
    pub fn iter(&self) -> impl Iterator<Item = (Quantity, f64)> + '_ {
        let values = self.values.into_iter().map(f64::from);
        self.names.0.iter().copied().zip(values).filter(|(_, value)| !value.is_nan())
    }

    /// The names of all that any of several frames has.
    pub fn names_of<'a>(all: impl IntoIterator<Item = &'a Self>) -> BTreeSet<Quantity> {
        let mut lists: Vec<&'static Names> = Vec::new();
        for quantities in all {
            if !lists.iter().any(|list| std::ptr::eq(*list, quantities.names)) {
                lists.push(quantities.names);
            }
        }
        lists.into_iter().flat_map(|list| &list.0).copied().collect()
    }

    /// Of every quantity what `summary` makes of its values in several frames, such as their median.
    pub fn summarized<'a>(
        all: impl Iterator<Item = &'a Self> + Clone,
        summary: impl Fn(&mut dyn Iterator<Item = f64>) -> f64,
    ) -> Self {
        let names = Self::names_of(all.clone());
        Self::new(names.into_iter().map(|name| {
            let mut values = all.clone().map(|quantities| quantities.value(name)).filter(|value| value.is_finite());
            (name, summary(&mut values))
        }))
    }
}

impl Default for Quantities {
    fn default() -> Self {
        Self::NONE
    }
}

impl PartialEq for Quantities {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl fmt::Debug for Quantities {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map().entries(self.iter()).finish()
    }
}

impl Serialize for Quantities {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter())
    }
}

impl<'de> Deserialize<'de> for Quantities {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Self::new(BTreeMap::<Quantity, f64>::deserialize(deserializer)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str) -> Quantity {
        Quantity::named(name).unwrap()
    }

    #[test]
    fn names_end_in_their_units() {
        for (name, unit) in [("exposure_ms", "ms"), ("gain_1", "1"), ("laser_power_mw", "mW"), ("board_c", "°C")] {
            assert_eq!((named(name).name(), named(name).unit()), (name, unit));
        }
        for name in ["exposure", "exposure_parsec", "_ms", "2nd_ms", "größe_mm", "laser power_mw", "temperature_c", ""]
        {
            assert!(Quantity::named(name).is_none(), "{name}");
        }
        assert!(Quantity::named(&format!("{}_ms", "x".repeat(LONGEST))).is_none());
        assert_eq!(named("exposure_ms"), named("exposure_ms"));
        assert_ne!(named("exposure_ms"), named("exposure_us"));
    }

    #[test]
    fn values_are_found_by_name() {
        let quantities = Quantities::new([(named("gain_1"), 2.0), (named("exposure_ms"), 8.5)]);
        assert_eq!((quantities.value(named("gain_1")), quantities.value(named("exposure_ms"))), (2.0, 8.5));
        assert!(quantities.value(named("laser_mw")).is_nan() && Quantities::NONE.value(named("gain_1")).is_nan());
        let text = serde_json::to_string(&quantities).unwrap();
        assert_eq!(text, r#"{"exposure_ms":8.5,"gain_1":2.0}"#);
        assert_eq!(serde_json::from_str::<Quantities>(&text).unwrap(), quantities);
        assert!(serde_json::from_str::<Quantities>(r#"{"exposure":1.0}"#).is_err());
    }

    /// More than there is room for: those that come first by name, whatever the order in which they are given.
    #[test]
    fn no_more_are_taken_than_there_is_room_for() {
        let all = (0..12).rev().map(|i| (named(&format!("q{i:02}_v")), f64::from(i)));
        let quantities = Quantities::new(all);
        assert_eq!(quantities.iter().map(|(_, value)| value).collect::<Vec<_>>(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert!(quantities.value(named("q06_v")).is_nan());
    }

    #[test]
    fn a_summary_is_of_each_alone() {
        let frames = [
            Quantities::new([(named("gain_1"), 1.0), (named("exposure_ms"), 4.0)]),
            Quantities::new([(named("gain_1"), 3.0)]),
        ];
        let sum = Quantities::summarized(frames.iter(), |values| values.sum());
        assert_eq!((sum.value(named("gain_1")), sum.value(named("exposure_ms"))), (4.0, 4.0));
    }

    /// Observations with their covariates are two cache lines, of which these are a quarter.
    #[test]
    fn observations_stay_small() {
        assert_eq!((size_of::<Quantities>(), size_of::<crate::Context>()), (32, 128));
    }
}
