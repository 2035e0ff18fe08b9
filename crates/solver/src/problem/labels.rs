//! Labels of variables, for reports and errors.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::problem::key::VariableId;

/// Labels of those variables that have one.
pub(crate) type Labels = Arc<BTreeMap<VariableId, String>>;

/// The variable's label, by default its number.
pub(crate) fn label(labels: &Labels, id: VariableId) -> String {
    labels.get(&id).cloned().unwrap_or_else(|| format!("variable {}", id.index()))
}
