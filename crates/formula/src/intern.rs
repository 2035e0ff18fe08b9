//! Texts and lists that live as long as the program, as pieces have them. Each is kept once, so that memory grows with the number
//! of different formulas only.

use std::collections::HashSet;
use std::hash::Hash;
use std::sync::{LazyLock, Mutex, PoisonError};

use depthcal_model::Covariate;

static TEXTS: LazyLock<Mutex<HashSet<&'static str>>> = LazyLock::new(Mutex::default);
static COVARIATES: LazyLock<Mutex<HashSet<&'static [Covariate]>>> = LazyLock::new(Mutex::default);

/// The text for the rest of the program's time.
pub(crate) fn text(text: &str) -> &'static str {
    kept(&TEXTS, text, |text| Box::leak(text.to_owned().into_boxed_str()))
}

/// The covariates for the rest of the program's time.
pub(crate) fn covariates(list: &[Covariate]) -> &'static [Covariate] {
    kept(&COVARIATES, list, |list| Box::leak(list.to_vec().into_boxed_slice()))
}

fn kept<T: ?Sized + Eq + Hash>(
    known: &Mutex<HashSet<&'static T>>,
    value: &T,
    keep: impl Fn(&T) -> &'static T,
) -> &'static T {
    let mut known = known.lock().unwrap_or_else(PoisonError::into_inner);
    match known.get(value) {
        Some(kept) => kept,
        None => {
            let leaked = keep(value);
            known.insert(leaked);
            leaked
        }
    }
}
