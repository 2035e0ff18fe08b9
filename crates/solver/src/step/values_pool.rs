//! A pool of values whose memory is used again.

use crate::problem::values::Values;

/// Capacity of the pool. Values that argmin's state still shares become free one iteration after the other.
const CAPACITY: usize = 3;

/// Former values whose memory is used again, so that iterations do not allocate.
#[derive(Debug, Default)]
pub(crate) struct ValuesPool(Vec<Values>);

impl ValuesPool {
    /// Returns values to the pool; the oldest ones are dropped if it is full.
    pub fn put(&mut self, values: Values) {
        if self.0.len() == CAPACITY {
            self.0.remove(0);
        }
        self.0.push(values);
    }

    /// A copy of `values`: in memory from the pool, or, if none is free, a clone that allocates when it is written to.
    pub fn copy_of(&mut self, values: &Values) -> Values {
        let free = self.0.iter_mut().position(|pooled| pooled.overwrite(values));
        free.map_or_else(|| values.clone(), |i| self.0.remove(i))
    }
}
