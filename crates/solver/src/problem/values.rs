//! Storage of the variables of a problem, addressed by typed keys.

use std::any::{Any, TypeId, type_name};
use std::fmt::Debug;
use std::sync::Arc;

use crate::problem::key::{Key, Place, VariableId};
use crate::problem::variable::Variable;

/// All variables of one type, without the type.
trait AnyColumn: Any + Send + Sync + Debug {
    fn duplicate(&self) -> Arc<dyn AnyColumn>;
    /// Copies the variables of another column into this one; false if that is of another type.
    fn overwrite(&mut self, other: &dyn Any) -> bool;
    /// Copies one variable of another column into this one; does nothing if that is of another type.
    fn copy(&mut self, slot: usize, other: &dyn Any, other_slot: usize);
    fn dim(&self, slot: usize) -> usize;
    /// Writes the tangent vector to a variable of another column; does nothing if that is of another type.
    fn local(&self, slot: usize, other: &dyn Any, other_slot: usize, delta: &mut [f64]);
    fn retract(&mut self, slot: usize, delta: &[f64]);
    fn coordinate(&self, slot: usize, component: usize) -> Option<f64>;
    fn set_coordinate(&mut self, slot: usize, component: usize, value: f64);
    fn type_name(&self) -> &'static str;
    fn state(&self, slot: usize) -> Option<Vec<f64>>;
    /// False, without a change, if `state` is not the state of such a variable.
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

    fn copy(&mut self, slot: usize, other: &dyn Any, other_slot: usize) {
        if let Some(other) = other.downcast_ref::<Self>() {
            self.0[slot].clone_from(&other.0[other_slot]);
        }
    }

    fn dim(&self, slot: usize) -> usize {
        self.0[slot].dim()
    }

    fn local(&self, slot: usize, other: &dyn Any, other_slot: usize, delta: &mut [f64]) {
        if let Some(other) = other.downcast_ref::<Self>() {
            self.0[slot].local(&other.0[other_slot], delta);
        }
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

/// The values of the variables of a problem.
///
/// Variables of one type are stored contiguously. Cloning is cheap: clones share memory until one of them is written to,
/// which copies all variables of the type concerned (copy on write).
#[derive(Clone, Debug, Default)]
pub struct Values {
    types: Arc<Vec<TypeId>>,
    columns: Vec<Arc<dyn AnyColumn>>,
    places: Arc<Vec<Place>>,
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
        let places = Arc::make_mut(&mut self.places);
        let place = Place { column, slot };
        places.push(place);
        Key::new(VariableId(places.len() as u32 - 1), place)
    }

    /// The variable's value.
    ///
    /// # Panics
    /// If the key is not from these values or from values that they were cloned from, like an index out of bounds.
    /// [`try_get`](Self::try_get) does not panic.
    #[inline]
    #[track_caller]
    pub fn get<V: Variable>(&self, key: Key<V>) -> &V {
        match self.try_get(key) {
            Some(value) => value,
            None => panic!("{key:?} is not a key of these values"),
        }
    }

    /// The variable's value, or `None` if the key does not belong to these values.
    #[inline]
    pub fn try_get<V: Variable>(&self, key: Key<V>) -> Option<&V> {
        let Place { column, slot } = key.place();
        self.column::<V>(column as usize)?.get(slot as usize)
    }

    /// Replaces the variable's value.
    ///
    /// # Panics
    /// Like [`get`](Self::get), for a key that does not belong to these values.
    #[track_caller]
    pub fn set<V: Variable>(&mut self, key: Key<V>, value: V) {
        let Place { column, slot } = key.place();
        let item = self.column_mut::<V>(column as usize).and_then(|items| items.get_mut(slot as usize));
        match item {
            Some(item) => *item = value,
            None => panic!("{key:?} is not a key of these values"),
        }
    }

    /// Dimension of a variable's tangent space; 0 for an id that does not belong to these values.
    pub fn dim(&self, id: VariableId) -> usize {
        match self.places.get(id.index()) {
            Some(place) => self.columns[place.column as usize].dim(place.slot as usize),
            None => 0,
        }
    }

    /// Whether the id belongs to these values.
    pub fn contains(&self, id: VariableId) -> bool {
        id.index() < self.places.len()
    }

    /// The typed key of a variable, if it is of type `V`.
    pub fn key<V: Variable>(&self, id: VariableId) -> Option<Key<V>> {
        let place = *self.places.get(id.index())?;
        (self.types[place.column as usize] == TypeId::of::<V>()).then_some(Key::new(id, place))
    }

    /// Number of variables.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there is no variable.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// All variables, in order of insertion.
    pub fn ids(&self) -> impl ExactSizeIterator<Item = VariableId> + use<> {
        (0..self.places.len() as u32).map(VariableId)
    }

    /// Moves one variable by its retraction; `delta` has length [`dim`](Self::dim). An id that does not belong to these
    /// values is ignored.
    pub fn retract(&mut self, id: VariableId, delta: &[f64]) {
        if let Some(Place { column, slot }) = self.places.get(id.index()).copied() {
            unique(&mut self.columns[column as usize]).retract(slot as usize, delta);
        }
    }

    /// Copies a variable from other values that have it under the same id, such as values that these were cloned from.
    pub(crate) fn copy_variable(&mut self, id: VariableId, other: &Self) {
        let (Some(place), Some(theirs)) = (self.places.get(id.index()).copied(), other.places.get(id.index())) else {
            return;
        };
        let source: &dyn Any = other.columns[theirs.column as usize].as_ref();
        unique(&mut self.columns[place.column as usize]).copy(place.slot as usize, source, theirs.slot as usize);
    }

    /// Writes the tangent vector from a variable to that of other values under the same id.
    pub(crate) fn local(&self, id: VariableId, other: &Self, delta: &mut [f64]) {
        let (Some(place), Some(theirs)) = (self.places.get(id.index()), other.places.get(id.index())) else {
            return;
        };
        let target: &dyn Any = other.columns[theirs.column as usize].as_ref();
        self.columns[place.column as usize].local(place.slot as usize, target, theirs.slot as usize, delta);
    }

    /// The coordinate of a variable that belongs to a tangent component, if its type has one: see [`Variable::coordinate`].
    pub fn coordinate(&self, id: VariableId, component: usize) -> Option<f64> {
        let Place { column, slot } = *self.places.get(id.index())?;
        self.columns[column as usize].coordinate(slot as usize, component)
    }

    /// Sets a coordinate of a variable, if its type has one for this component: see [`Variable::set_coordinate`].
    pub fn set_coordinate(&mut self, id: VariableId, component: usize, value: f64) {
        if let Some(Place { column, slot }) = self.places.get(id.index()).copied() {
            unique(&mut self.columns[column as usize]).set_coordinate(slot as usize, component, value);
        }
    }

    /// Name of a variable's type; empty for an id that does not belong to these values.
    pub fn type_name(&self, id: VariableId) -> &'static str {
        self.places.get(id.index()).map_or("", |e| self.columns[e.column as usize].type_name())
    }

    /// The numbers that represent a variable in a file, if its type supports that: see [`Variable::state`].
    pub fn state(&self, id: VariableId) -> Option<Vec<f64>> {
        let Place { column, slot } = *self.places.get(id.index())?;
        self.columns[column as usize].state(slot as usize)
    }

    /// Sets a variable from its [`state`](Self::state). Returns false, and leaves the variable unchanged, if these
    /// numbers are not the state of a variable of its type and size.
    #[must_use]
    pub fn set_state(&mut self, id: VariableId, state: &[f64]) -> bool {
        let Some(Place { column, slot }) = self.places.get(id.index()).copied() else { return false };
        unique(&mut self.columns[column as usize]).set_state(slot as usize, state)
    }

    /// Copies other values of the same problem into this one's memory, without allocating. False if this memory is shared
    /// with a clone or belongs to another problem; the former contents are then undefined.
    pub(crate) fn overwrite(&mut self, other: &Self) -> bool {
        if !Arc::ptr_eq(&self.places, &other.places) || self.columns.len() != other.columns.len() {
            return false;
        }
        self.columns.iter_mut().zip(&other.columns).all(|(column, other)| {
            let other: &dyn Any = other.as_ref();
            Arc::get_mut(column).is_some_and(|column| column.overwrite(other))
        })
    }

    /// A number that identifies the variable's type.
    pub(crate) fn type_index(&self, id: VariableId) -> u32 {
        self.places.get(id.index()).map_or(u32::MAX, |e| e.column)
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

/// Write access to a column; it is copied first if a clone of the values shares it.
fn unique(column: &mut Arc<dyn AnyColumn>) -> &mut dyn AnyColumn {
    if Arc::get_mut(column).is_none() {
        *column = column.duplicate();
    }
    Arc::get_mut(column).expect("a column just copied is not shared")
}
