//! Directed graphs of named nodes, and their strongly connected components.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Why one node depends on another: the first line that says so, and how many do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edge {
    /// File and line, `src/a.rs:12`.
    pub place: String,
    /// The path that is written there, `super::b::Thing`.
    pub path: String,
    /// The file that defines it.
    pub definition: String,
    /// Number of references that make this edge.
    pub count: usize,
}

/// A directed graph whose edges say where they come from.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    edges: BTreeMap<String, BTreeMap<String, Edge>>,
}

impl Graph {
    /// Adds a reference. References of a node to itself are left out; of several between two nodes the first is kept.
    pub fn add(&mut self, from: &str, to: &str, edge: Edge) {
        if from == to {
            return;
        }
        let edges = self.edges.entry(from.to_owned()).or_default();
        edges.entry(to.to_owned()).and_modify(|e| e.count += edge.count).or_insert(edge);
    }

    /// The edge from one node to another.
    pub fn edge(&self, from: &str, to: &str) -> Option<&Edge> {
        self.edges.get(from)?.get(to)
    }

    /// All edges as (from, to, why), sorted by name.
    pub fn edges(&self) -> impl Iterator<Item = (&str, &str, &Edge)> {
        self.edges.iter().flat_map(|(from, to)| to.iter().map(move |(to, e)| (from.as_str(), to.as_str(), e)))
    }

    /// The graph of groups of nodes.
    pub fn grouped(&self, group: impl Fn(&str) -> String) -> Graph {
        let mut grouped = Graph::default();
        for (from, to, edge) in self.edges() {
            grouped.add(&group(from), &group(to), edge.clone());
        }
        grouped
    }

    /// The shortest walk from `from` to `to` as nodes including both ends; `None` if there is none.
    pub fn shortest(&self, from: &str, to: &str) -> Option<Vec<String>> {
        let mut previous: BTreeMap<&str, &str> = BTreeMap::new();
        let mut queue = VecDeque::from([from]);
        let mut seen = BTreeSet::from([from]);
        while let Some(node) = queue.pop_front() {
            if node == to {
                let mut walk = vec![node.to_owned()];
                let mut last = node;
                while let Some(&before) = previous.get(last) {
                    walk.push(before.to_owned());
                    last = before;
                }
                walk.reverse();
                return Some(walk);
            }
            for next in self.edges.get(node).into_iter().flatten().map(|(to, _)| to.as_str()) {
                if seen.insert(next) {
                    previous.insert(next, node);
                    queue.push_back(next);
                }
            }
        }
        None
    }
}
