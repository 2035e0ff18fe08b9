//! The tree of modules of a crate, without what is compiled for tests only.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use syn::{Attribute, Item, UseTree};

use crate::error::StructureError;
use crate::sources::Sources;

/// One module: a file, or a `mod name { … }` inside one.
pub struct Module {
    pub parent: Option<usize>,
    /// Index into [`Tree::files`].
    pub file: usize,
    pub children: HashMap<String, usize>,
    /// Names that this module defines, modules and imports excepted.
    pub items: HashSet<String>,
    /// Those of `items` that are traits.
    pub traits: HashSet<String>,
    /// Imported name → paths as written.
    pub imports: HashMap<String, Vec<Vec<String>>>,
    /// Paths of `use path::*`.
    pub globs: Vec<Vec<String>>,
    /// Everything that is written in this module, submodules and tests excepted.
    pub syntax: Vec<Item>,
}

/// All modules of a crate; the root is the first.
pub struct Tree {
    pub modules: Vec<Module>,
    /// Files by path relative to the crate, with the names from the crate's root to their modules (none for the root).
    pub files: Vec<(PathBuf, Vec<String>)>,
    /// `macro_rules!` name → file.
    pub macros: HashMap<String, usize>,
}

impl Tree {
    /// The tree below `root` (`src/lib.rs`).
    pub fn build(sources: &Sources, root: &Path) -> Result<Self, StructureError> {
        let mut tree = Self { modules: Vec::new(), files: Vec::new(), macros: HashMap::new() };
        let folder = root.parent().unwrap_or(Path::new("")).to_owned();
        tree.add_file(sources, root, None, Vec::new(), &folder)?;
        Ok(tree)
    }

    fn add_file(
        &mut self,
        sources: &Sources,
        file: &Path,
        parent: Option<usize>,
        path: Vec<String>,
        folder: &Path,
    ) -> Result<usize, StructureError> {
        let text = sources.text(file).ok_or_else(|| StructureError::Read {
            path: file.to_owned(),
            source: std::io::ErrorKind::NotFound.into(),
        })?;
        let items = parse(file, text)?;
        self.files.push((file.to_owned(), path.clone()));
        let index = self.files.len() - 1;
        self.add_module(sources, index, parent, path, folder, items)
    }

    fn add_module(
        &mut self,
        sources: &Sources,
        file: usize,
        parent: Option<usize>,
        path: Vec<String>,
        folder: &Path,
        items: Vec<Item>,
    ) -> Result<usize, StructureError> {
        let index = self.modules.len();
        self.modules.push(Module {
            parent,
            file,
            children: HashMap::new(),
            items: HashSet::new(),
            traits: HashSet::new(),
            imports: HashMap::new(),
            globs: Vec::new(),
            syntax: Vec::new(),
        });
        for item in items {
            if is_test(attributes(&item)) {
                continue;
            }
            let Item::Mod(module) = item else {
                self.add_item(index, item);
                continue;
            };
            let name = module.ident.to_string();
            if name == "tests" {
                continue;
            }
            let below: Vec<_> = path.iter().cloned().chain([name.clone()]).collect();
            let inner = folder.join(&name);
            let child = if let Some((_, items)) = module.content {
                self.add_module(sources, file, Some(index), below, &inner, items)?
            } else {
                let here = self.files[file].0.clone();
                let given = module.attrs.iter().find_map(path_attribute);
                let beside = here.parent().unwrap_or(Path::new(""));
                let candidates = match given {
                    Some(given) => vec![beside.join(given)],
                    None => vec![folder.join(format!("{name}.rs")), inner.join("mod.rs")],
                };
                let Some(file) = candidates.into_iter().find(|c| sources.text(c).is_some()) else {
                    return Err(StructureError::MissingModule { path: here, name });
                };
                self.add_file(sources, &file, Some(index), below, &inner)?
            };
            self.modules[index].children.insert(name, child);
        }
        Ok(index)
    }

    fn add_item(&mut self, index: usize, item: Item) {
        let file = self.modules[index].file;
        let module = &mut self.modules[index];
        match &item {
            Item::Use(import) => {
                if import.leading_colon.is_none() {
                    for Import { path, name } in imports(&import.tree) {
                        match name {
                            Some(name) => module.imports.entry(name).or_default().push(path),
                            None => module.globs.push(path),
                        }
                    }
                }
            }
            Item::Macro(definition) => {
                if let Some(name) = &definition.ident {
                    self.macros.insert(name.to_string(), file);
                }
            }
            _ => {
                if let Some(name) = name_of(&item) {
                    if matches!(item, Item::Trait(_) | Item::TraitAlias(_)) {
                        module.traits.insert(name.clone());
                    }
                    module.items.insert(name);
                }
            }
        }
        self.modules[index].syntax.push(item);
    }
}

/// The items of a file with this text.
pub fn parse(file: &Path, text: &str) -> Result<Vec<Item>, StructureError> {
    match syn::parse_file(text) {
        Ok(syntax) => Ok(syntax.items),
        Err(error) => Err(StructureError::Syntax {
            path: file.to_owned(),
            line: error.span().start().line,
            message: error.to_string(),
        }),
    }
}

/// A name that a `use` brings into scope (`None`: all names) and the path that it stands for.
pub struct Import {
    pub path: Vec<String>,
    pub name: Option<String>,
}

/// The imports of a tree of `use`.
pub fn imports(tree: &UseTree) -> Vec<Import> {
    fn walk(tree: &UseTree, prefix: &[String], imports: &mut Vec<Import>) {
        let with = |name: String| prefix.iter().cloned().chain([name]).collect::<Vec<_>>();
        match tree {
            UseTree::Path(p) => walk(&p.tree, &with(p.ident.to_string()), imports),
            UseTree::Group(g) => g.items.iter().for_each(|t| walk(t, prefix, imports)),
            UseTree::Glob(_) => imports.push(Import { path: prefix.to_vec(), name: None }),
            UseTree::Name(n) if n.ident == "self" => {
                imports.push(Import { path: prefix.to_vec(), name: prefix.last().cloned() });
            }
            UseTree::Name(n) => {
                imports.push(Import { path: with(n.ident.to_string()), name: Some(n.ident.to_string()) })
            }
            UseTree::Rename(r) => {
                let path = if r.ident == "self" { prefix.to_vec() } else { with(r.ident.to_string()) };
                imports.push(Import { path, name: Some(r.rename.to_string()) });
            }
        }
    }
    let mut all = Vec::new();
    walk(tree, &[], &mut all);
    all
}

/// Whether an item is compiled for tests only.
pub fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|a| {
        let path = a.path();
        if path.is_ident("test") {
            return true;
        }
        let syn::Meta::List(list) = &a.meta else { return false };
        path.is_ident("cfg") && needs_test(list.tokens.clone())
    })
}

/// Whether a `cfg` predicate can hold under `test` only: `test`, or `all(…)` with such a part.
fn needs_test(tokens: proc_macro2::TokenStream) -> bool {
    use syn::parse::Parser;
    use syn::punctuated::Punctuated;
    let parser = Punctuated::<syn::Meta, syn::Token![,]>::parse_terminated;
    let Ok(parts) = parser.parse2(tokens) else { return false };
    parts.iter().any(|part| match part {
        syn::Meta::Path(p) => p.is_ident("test"),
        syn::Meta::List(l) => l.path.is_ident("all") && needs_test(l.tokens.clone()),
        syn::Meta::NameValue(_) => false,
    })
}

fn path_attribute(attribute: &Attribute) -> Option<String> {
    let syn::Meta::NameValue(value) = &attribute.meta else { return None };
    let syn::Expr::Lit(syn::ExprLit { lit: syn::Lit::Str(text), .. }) = &value.value else { return None };
    attribute.path().is_ident("path").then(|| text.value())
}

/// The attributes of an item.
pub fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(i) => &i.attrs,
        Item::Enum(i) => &i.attrs,
        Item::ExternCrate(i) => &i.attrs,
        Item::Fn(i) => &i.attrs,
        Item::ForeignMod(i) => &i.attrs,
        Item::Impl(i) => &i.attrs,
        Item::Macro(i) => &i.attrs,
        Item::Mod(i) => &i.attrs,
        Item::Static(i) => &i.attrs,
        Item::Struct(i) => &i.attrs,
        Item::Trait(i) => &i.attrs,
        Item::TraitAlias(i) => &i.attrs,
        Item::Type(i) => &i.attrs,
        Item::Union(i) => &i.attrs,
        Item::Use(i) => &i.attrs,
        _ => &[],
    }
}

fn name_of(item: &Item) -> Option<String> {
    let name = match item {
        Item::Const(i) => &i.ident,
        Item::Enum(i) => &i.ident,
        Item::Fn(i) => &i.sig.ident,
        Item::Static(i) => &i.ident,
        Item::Struct(i) => &i.ident,
        Item::Trait(i) => &i.ident,
        Item::TraitAlias(i) => &i.ident,
        Item::Type(i) => &i.ident,
        Item::Union(i) => &i.ident,
        _ => return None,
    };
    Some(name.to_string())
}
