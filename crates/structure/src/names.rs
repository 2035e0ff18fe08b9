//! Resolution of paths: the module whose file defines an item.

use std::collections::HashSet;

use crate::modules::Tree;

/// The end of a path.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// A module itself.
    Module(usize),
    /// An item, with the segment that follows it (an associated function, a variant).
    Item {
        /// The module that defines it.
        module: usize,
        /// Its name there.
        name: String,
        /// `new` of `Type::new`.
        associated: Option<String>,
    },
}

/// Names under resolution, so that imports of each other come to an end.
type Visited = HashSet<(usize, String)>;

impl Tree {
    /// Everything that a path written in `module` may mean, in all name spaces; empty where it leads out of the crate.
    pub fn resolve(&self, module: usize, path: &[String]) -> Vec<Target> {
        self.follow(module, path, &mut Visited::new())
    }

    fn follow(&self, module: usize, path: &[String], visited: &mut Visited) -> Vec<Target> {
        let Some((first, mut remaining)) = path.split_first() else { return vec![Target::Module(module)] };
        let mut targets = match first.as_str() {
            "crate" => vec![Target::Module(0)],
            "self" => vec![Target::Module(module)],
            "super" => self.parent(module),
            name => self.lookup(module, name, visited).unwrap_or_default(),
        };
        while let Some((next, after)) = remaining.split_first() {
            remaining = after;
            targets = targets
                .into_iter()
                .flat_map(|target| match target {
                    Target::Module(m) if next == "super" => self.parent(m),
                    // A name that is not found is made by a macro of that module.
                    Target::Module(m) => self
                        .lookup(m, next, visited)
                        .unwrap_or_else(|| vec![Target::Item { module: m, name: next.clone(), associated: None }]),
                    Target::Item { module, name, associated } => {
                        vec![Target::Item { module, name, associated: associated.or_else(|| Some(next.clone())) }]
                    }
                })
                .collect();
        }
        targets
    }

    fn parent(&self, module: usize) -> Vec<Target> {
        self.modules[module].parent.map(Target::Module).into_iter().collect()
    }

    /// The targets of a name in a module: `None` if the module does not know it, empty if it comes from another crate.
    fn lookup(&self, module: usize, name: &str, visited: &mut Visited) -> Option<Vec<Target>> {
        if !visited.insert((module, name.to_owned())) {
            return None;
        }
        let targets = self.lookup_new(module, name, visited);
        visited.remove(&(module, name.to_owned()));
        targets
    }

    fn lookup_new(&self, module: usize, name: &str, visited: &mut Visited) -> Option<Vec<Target>> {
        let here = &self.modules[module];
        let mut targets = Vec::new();
        targets.extend(here.children.get(name).map(|&child| Target::Module(child)));
        if here.items.contains(name) {
            targets.push(Target::Item { module, name: name.to_owned(), associated: None });
        }
        let imports = here.imports.get(name);
        for path in imports.into_iter().flatten() {
            targets.extend(self.follow(module, path, visited));
        }
        if !targets.is_empty() || imports.is_some() {
            return Some(targets);
        }
        here.globs.iter().find_map(|path| {
            self.follow(module, path, visited).into_iter().find_map(|target| match target {
                Target::Module(m) => self.lookup(m, name, visited),
                Target::Item { .. } => None,
            })
        })
    }

    /// Modules that define the traits which `use path::*` brings into scope.
    pub fn traits_of_glob(&self, module: usize, path: &[String]) -> Vec<Target> {
        let mut targets = Vec::new();
        for target in self.resolve(module, path) {
            let Target::Module(m) = target else {
                targets.push(target);
                continue;
            };
            let inside = &self.modules[m];
            for name in inside.traits.iter().chain(inside.imports.keys()) {
                targets.extend(self.resolve(m, &["self".to_owned(), name.clone()]).into_iter().filter(|t| match t {
                    Target::Item { module, name, .. } => self.modules[*module].traits.contains(name),
                    Target::Module(_) => false,
                }));
            }
        }
        targets
    }
}
