//! Memory of values that are no longer needed.

use crate::values::Values;

/// How many are kept: those that argmin's state still shares become free one after the other.
const KEPT: usize = 3;

/// Former values whose memory is used again, so that iterations need not allocate.
#[derive(Debug, Default)]
pub(crate) struct Spare(Vec<Values>);

impl Spare {
    /// Keeps values for later.
    pub fn put(&mut self, values: Values) {
        if self.0.len() == KEPT {
            self.0.remove(0);
        }
        self.0.push(values);
    }

    /// A copy that shares no memory with others, or will not once it is written to.
    pub fn take_copy(&mut self, values: &Values) -> Values {
        let free = self.0.iter_mut().position(|spare| spare.overwrite(values));
        free.map_or_else(|| values.clone(), |i| self.0.remove(i))
    }
}
