//! The values of all variables of a problem, under typed keys.

use std::any::{Any, TypeId, type_name};
use std::fmt::{self, Debug};
use std::hash::{Hash, Hasher};
use std::marker::PhantomData;
use std::sync::Arc;

use crate::variable::Variable;

/// Names a variable, whatever its type. Numbers are given in order of insertion into [`Values`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct VariableId(pub(crate) u32);

impl VariableId {
    /// The position in the order of insertion.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Names a variable of type `V` in [`Values`].
pub struct Key<V> {
    id: VariableId,
    column: u32,
    slot: u32,
    variable: PhantomData<fn() -> V>,
}

impl<V> Key<V> {
    /// The same variable without its type.
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

/// All variables of one type.
trait AnyColumn: Any + Send + Sync + Debug {
    fn duplicate(&self) -> Arc<dyn AnyColumn>;
    /// Takes over the variables of another column; false if it is of another type.
    fn overwrite(&mut self, other: &dyn Any) -> bool;
    fn dim(&self, slot: usize) -> usize;
    fn retract(&mut self, slot: usize, delta: &[f64]);
    fn coordinate(&self, slot: usize, component: usize) -> Option<f64>;
    fn set_coordinate(&mut self, slot: usize, component: usize, value: f64);
    fn type_name(&self) -> &'static str;
    fn state(&self, slot: usize) -> Option<Vec<f64>>;
    /// Whether the state was that of such a variable.
    fn set_state(&mut self, slot: usize, state: &[f64]) -> bool;
}

#[derive(Clone, Debug)]
struct Column<V>(Vec<V>);

impl<V: Variable> AnyColumn for Column<V> {
    fn duplicate(&self) -> Arc<dyn AnyColumn> {
        Arc::new(self.clone())
    }

    fn overwrite(&mut self, other: &dyn Any) -> bool {
        other.downcast_ref::<Self>().map(|other| self.0.clone_from(&other.0)).is_some()
    }

    fn dim(&self, slot: usize) -> usize {
        self.0[slot].dim()
    }

    fn retract(&mut self, slot: usize, delta: &[f64]) {
        self.0[slot] = self.0[slot].retract(delta);
    }

    fn coordinate(&self, slot: usize, component: usize) -> Option<f64> {
        self.0[slot].coordinate(component)
    }

    fn set_coordinate(&mut self, slot: usize, component: usize, value: f64) {
        self.0[slot].set_coordinate(component, value);
    }

    fn type_name(&self) -> &'static str {
        type_name::<V>()
    }

    fn state(&self, slot: usize) -> Option<Vec<f64>> {
        self.0[slot].state()
    }

    fn set_state(&mut self, slot: usize, state: &[f64]) -> bool {
        self.0[slot].with_state(state).map(|variable| self.0[slot] = variable).is_some()
    }
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    column: u32,
    slot: u32,
}

/// The values of the variables of a problem.
///
/// Variables of one type lie side by side in memory. A clone shares them and is cheap; what is written to later is
/// copied first, one type at a time.
#[derive(Clone, Debug, Default)]
pub struct Values {
    types: Arc<Vec<TypeId>>,
    columns: Vec<Arc<dyn AnyColumn>>,
    entries: Arc<Vec<Entry>>,
}

impl Values {
    /// No variables.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a variable and returns its key.
    pub fn insert<V: Variable>(&mut self, variable: V) -> Key<V> {
        let of_type = TypeId::of::<V>();
        let column = self.types.iter().position(|t| *t == of_type).unwrap_or_else(|| {
            Arc::make_mut(&mut self.types).push(of_type);
            self.columns.push(Arc::new(Column::<V>(Vec::new())));
            self.columns.len() - 1
        });
        let mut slot = 0;
        if let Some(items) = self.column_mut::<V>(column) {
            slot = items.len();
            items.push(variable);
        }
        let (column, slot) = (column as u32, slot as u32);
        let entries = Arc::make_mut(&mut self.entries);
        entries.push(Entry { column, slot });
        Key { id: VariableId(entries.len() as u32 - 1), column, slot, variable: PhantomData }
    }

    /// The variable's value.
    ///
    /// # Panics
    /// If the key was not given by these values or by values that they are a clone of, as an index out of bounds would.
    /// [`try_get`](Self::try_get) does not panic.
    #[inline]
    #[track_caller]
    pub fn get<V: Variable>(&self, key: Key<V>) -> &V {
        match self.try_get(key) {
            Some(value) => value,
            None => panic!("{key:?} is not a key of these values"),
        }
    }

    /// The variable's value, or nothing if the key does not belong to these values.
    #[inline]
    pub fn try_get<V: Variable>(&self, key: Key<V>) -> Option<&V> {
        self.column::<V>(key.column as usize)?.get(key.slot as usize)
    }

    /// Replaces the variable's value.
    ///
    /// # Panics
    /// Like [`get`](Self::get), for a key that does not belong to these values.
    #[track_caller]
    pub fn set<V: Variable>(&mut self, key: Key<V>, value: V) {
        let item = self.column_mut::<V>(key.column as usize).and_then(|items| items.get_mut(key.slot as usize));
        match item {
            Some(item) => *item = value,
            None => panic!("{key:?} is not a key of these values"),
        }
    }

    /// Tangent dimension of a variable; 0 for an id that does not belong to these values.
    pub fn dim(&self, id: VariableId) -> usize {
        match self.entries.get(id.index()) {
            Some(entry) => self.columns[entry.column as usize].dim(entry.slot as usize),
            None => 0,
        }
    }

    /// Whether the id belongs to these values.
    pub fn contains(&self, id: VariableId) -> bool {
        id.index() < self.entries.len()
    }

    /// The typed key of a variable, if it is of type `V`.
    pub fn key<V: Variable>(&self, id: VariableId) -> Option<Key<V>> {
        let Entry { column, slot } = *self.entries.get(id.index())?;
        (self.types[column as usize] == TypeId::of::<V>()).then_some(Key { id, column, slot, variable: PhantomData })
    }

    /// Number of variables.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there is no variable.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// All variables, in order of insertion.
    pub fn ids(&self) -> impl ExactSizeIterator<Item = VariableId> + use<> {
        (0..self.entries.len() as u32).map(VariableId)
    }

    /// Moves one variable by its retraction. An id that does not belong to these values is ignored.
    pub fn retract(&mut self, id: VariableId, delta: &[f64]) {
        if let Some(Entry { column, slot }) = self.entries.get(id.index()).copied() {
            unique(&mut self.columns[column as usize]).retract(slot as usize, delta);
        }
    }

    /// A coordinate of a variable, if its type has one for this component: see [`Variable::coordinate`].
    pub fn coordinate(&self, id: VariableId, component: usize) -> Option<f64> {
        let Entry { column, slot } = *self.entries.get(id.index())?;
        self.columns[column as usize].coordinate(slot as usize, component)
    }

    /// Replaces a coordinate of a variable, if there is one: see [`Variable::set_coordinate`].
    pub fn set_coordinate(&mut self, id: VariableId, component: usize, value: f64) {
        if let Some(Entry { column, slot }) = self.entries.get(id.index()).copied() {
            unique(&mut self.columns[column as usize]).set_coordinate(slot as usize, component, value);
        }
    }

    /// Name of a variable's type; empty for an id that does not belong to these values.
    pub fn type_name(&self, id: VariableId) -> &'static str {
        self.entries.get(id.index()).map_or("", |e| self.columns[e.column as usize].type_name())
    }

    /// The numbers that a variable consists of, if its type tells them: see [`Variable::state`].
    pub fn state(&self, id: VariableId) -> Option<Vec<f64>> {
        let Entry { column, slot } = *self.entries.get(id.index())?;
        self.columns[column as usize].state(slot as usize)
    }

    /// Replaces a variable by that with the given [`state`](Self::state). Returns whether there is one; if not, the
    /// variable stays as it is.
    #[must_use]
    pub fn set_state(&mut self, id: VariableId, state: &[f64]) -> bool {
        let Some(Entry { column, slot }) = self.entries.get(id.index()).copied() else { return false };
        unique(&mut self.columns[column as usize]).set_state(slot as usize, state)
    }

    /// Becomes a copy of other values of the same problem in the memory that it has; false if that memory is shared, or
    /// does not fit. Its own values are lost in any case.
    pub(crate) fn overwrite(&mut self, other: &Self) -> bool {
        if !Arc::ptr_eq(&self.entries, &other.entries) || self.columns.len() != other.columns.len() {
            return false;
        }
        self.columns.iter_mut().zip(&other.columns).all(|(own, other)| {
            let other: &dyn Any = other.as_ref();
            Arc::get_mut(own).is_some_and(|own| own.overwrite(other))
        })
    }

    /// A number that is the same for variables of the same type.
    pub(crate) fn class(&self, id: VariableId) -> u32 {
        self.entries.get(id.index()).map_or(u32::MAX, |e| e.column)
    }

    #[inline]
    fn column<V: Variable>(&self, column: usize) -> Option<&Vec<V>> {
        let any: &dyn Any = self.columns.get(column)?.as_ref();
        any.downcast_ref::<Column<V>>().map(|c| &c.0)
    }

    fn column_mut<V: Variable>(&mut self, column: usize) -> Option<&mut Vec<V>> {
        let any: &mut dyn Any = unique(self.columns.get_mut(column)?);
        any.downcast_mut::<Column<V>>().map(|c| &mut c.0)
    }
}

/// Copies a column that is shared with a clone of the values.
fn unique(column: &mut Arc<dyn AnyColumn>) -> &mut dyn AnyColumn {
    if Arc::get_mut(column).is_none() {
        *column = column.duplicate();
    }
    Arc::get_mut(column).expect("a column just copied is not shared")
}
