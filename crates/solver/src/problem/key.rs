//! Names of variables: with and without their type.

use std::any::type_name;
use std::fmt::{self, Debug};
use std::hash::{Hash, Hasher};
use std::marker::PhantomData;

/// Identifies a variable of any type. Ids are numbered in the order of insertion into [`Values`](crate::Values).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct VariableId(pub(crate) u32);

impl VariableId {
    /// The position in the order of insertion, from 0.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Identifies a variable of type `V` in [`Values`](crate::Values).
pub struct Key<V> {
    id: VariableId,
    place: Place,
    variable: PhantomData<fn() -> V>,
}

/// Where the values of a variable are stored: the column of its type, and the slot within it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub column: u32,
    pub slot: u32,
}

impl<V> Key<V> {
    pub(crate) fn new(id: VariableId, place: Place) -> Self {
        Self { id, place, variable: PhantomData }
    }

    #[inline(always)]
    pub(crate) fn place(self) -> Place {
        self.place
    }

    /// The variable without its type.
    pub fn id(self) -> VariableId {
        self.id
    }
}

impl<V> Clone for Key<V> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<V> Copy for Key<V> {}

impl<V> PartialEq for Key<V> {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

impl<V> Eq for Key<V> {}

impl<V> Hash for Key<V> {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.id.hash(state);
    }
}

impl<V> Debug for Key<V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Key<{}>({})", type_name::<V>(), self.id.0)
    }
}

impl<V> From<Key<V>> for VariableId {
    fn from(key: Key<V>) -> Self {
        key.id
    }
}
