//! Circles of a graph: for every edge that lies on one, the shortest.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use crate::graph::Graph;

/// The shortest circle through each edge that lies on a circle, each once, short ones first; nodes in order of the arrows,
/// the least name first. Empty for a graph without circles: every circle has edges, so none is missed.
pub fn circles(graph: &Graph) -> Vec<Vec<String>> {
    let mut circles = BTreeSet::new();
    for (from, to, _) in graph.edges() {
        if let Some(mut circle) = graph.shortest(to, from) {
            let first = circle.iter().enumerate().min_by_key(|(_, n)| n.as_str()).map_or(0, |(i, _)| i);
            circle.rotate_left(first);
            circles.insert((circle.len(), circle));
        }
    }
    circles.into_iter().map(|(_, circle)| circle).collect()
}

/// A circle as text: its nodes, and for each arrow the line that makes it.
pub fn describe(graph: &Graph, circle: &[String]) -> String {
    let mut text = format!("circle of {}: {}\n", circle.len(), circle.join(" -> "));
    for (i, from) in circle.iter().enumerate() {
        let to = &circle[(i + 1) % circle.len()];
        if let Some(edge) = graph.edge(from, to) {
            let more = if edge.count > 1 { format!(" (and {} more)", edge.count - 1) } else { String::new() };
            let _ = writeln!(text, "    {}: `{}` is defined in {}{more}", edge.place, edge.path, edge.definition);
        }
    }
    text
}
