//! The files that a file's code refers to.

use std::collections::{HashMap, HashSet};

use proc_macro2::{Spacing, Span, TokenStream, TokenTree};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

use crate::graph::{Edge, Graph};
use crate::modules::{Tree, attributes, imports, is_test};
use crate::names::Target;

/// (module, type) → name of an associated function → files of the inherent `impl` blocks that define it.
type Methods = HashMap<(usize, String), HashMap<String, HashSet<usize>>>;

/// The graph of files of a crate: an arrow from a file to each file that defines what it names.
pub fn file_graph(tree: &Tree) -> Graph {
    let methods = methods(tree);
    let mut graph = Graph::default();
    for (index, module) in tree.modules.iter().enumerate() {
        let mut visitor = References {
            tree,
            methods: &methods,
            module: index,
            file: module.file,
            scopes: Vec::new(),
            this: Vec::new(),
            graph: &mut graph,
        };
        module.syntax.iter().for_each(|item| visitor.visit_item(item));
    }
    graph
}

fn methods(tree: &Tree) -> Methods {
    let mut methods = Methods::new();
    for (index, module) in tree.modules.iter().enumerate() {
        for item in &module.syntax {
            let syn::Item::Impl(block) = item else { continue };
            if block.trait_.is_some() {
                continue;
            }
            for (module_of_type, name) in type_items(tree, index, &block.self_ty) {
                let of_type = methods.entry((module_of_type, name)).or_default();
                for function in &block.items {
                    let name = match function {
                        syn::ImplItem::Fn(f) if !is_test(&f.attrs) => f.sig.ident.to_string(),
                        syn::ImplItem::Const(c) => c.ident.to_string(),
                        _ => continue,
                    };
                    of_type.entry(name).or_default().insert(module.file);
                }
            }
        }
    }
    methods
}

/// The items that the type of an `impl` block is.
fn type_items(tree: &Tree, module: usize, ty: &syn::Type) -> Vec<(usize, String)> {
    let syn::Type::Path(path) = ty else { return Vec::new() };
    let targets = tree.resolve(module, &segments(&path.path));
    let items = targets.into_iter().filter_map(|t| match t {
        Target::Item { module, name, .. } => Some((module, name)),
        Target::Module(_) => None,
    });
    items.collect()
}

fn segments(path: &syn::Path) -> Vec<String> {
    path.segments.iter().map(|s| s.ident.to_string()).collect()
}

struct References<'a> {
    tree: &'a Tree,
    methods: &'a Methods,
    module: usize,
    file: usize,
    /// Imports of the blocks around.
    scopes: Vec<HashMap<String, Vec<String>>>,
    /// The type of the `impl` block around.
    this: Vec<(usize, String)>,
    graph: &'a mut Graph,
}

impl References<'_> {
    fn name(&self, file: usize) -> String {
        self.tree.files[file].0.to_string_lossy().replace('\\', "/")
    }

    fn add(&mut self, file: usize, path: &str, span: Span) {
        let (from, to) = (self.name(self.file), self.name(file));
        let place = format!("{from}:{}", span.start().line);
        self.graph.add(&from, &to, Edge { place, path: path.to_owned(), definition: to.clone(), count: 1 });
    }

    /// Notes what a path refers to. Modules by themselves are no reference: what is named through them is.
    fn refer(&mut self, path: &[String], span: Span) {
        let Some(first) = path.first() else { return };
        if first == "Self" {
            if let Some(method) = path.get(1) {
                self.refer_to_method(&self.this.clone(), method, "Self", span);
            }
            return;
        }
        let local = self.scopes.iter().rev().find_map(|s| s.get(first)).cloned();
        let full = match local {
            Some(import) => import.into_iter().chain(path[1..].iter().cloned()).collect(),
            None => path.to_vec(),
        };
        let targets = self.tree.resolve(self.module, &full);
        self.refer_to(targets, &path.join("::"), span);
    }

    fn refer_to(&mut self, targets: Vec<Target>, path: &str, span: Span) {
        for target in targets {
            let Target::Item { module, name, associated } = target else { continue };
            self.add(self.tree.modules[module].file, path, span);
            if let Some(method) = associated {
                self.refer_to_method(&[(module, name)], &method, path.trim_end_matches(&format!("::{method}")), span);
            }
        }
    }

    fn refer_to_method(&mut self, types: &[(usize, String)], method: &str, receiver: &str, span: Span) {
        let methods = self.methods;
        for ty in types {
            let files = methods.get(ty).and_then(|m| m.get(method));
            // Several blocks may define one name, each for other type arguments: this file's own is meant if it has one.
            if files.is_some_and(|f| f.contains(&self.file)) {
                continue;
            }
            for &file in files.into_iter().flatten() {
                self.add(file, &format!("{receiver}::{method}"), span);
            }
        }
    }

    /// Paths in tokens that are not parsed: arguments and definitions of macros, attributes.
    fn refer_in_tokens(&mut self, tokens: TokenStream, strings: bool) {
        let tokens: Vec<_> = tokens.into_iter().collect();
        let colons = |i: usize| {
            let is_colon = |t: Option<&TokenTree>, joint: bool| matches!(t, Some(TokenTree::Punct(p)) if p.as_char() == ':' && (!joint || p.spacing() == Spacing::Joint));
            is_colon(tokens.get(i), true) && is_colon(tokens.get(i + 1), false)
        };
        let mut i = 0;
        while i < tokens.len() {
            match &tokens[i] {
                TokenTree::Group(group) => self.refer_in_tokens(group.stream(), strings),
                TokenTree::Literal(literal) if strings => self.refer_in_string(&literal.to_string(), literal.span()),
                TokenTree::Ident(first) => {
                    let after_colons = i >= 2 && colons(i - 2);
                    let method_of_self =
                        first == "self" && matches!(tokens.get(i + 1), Some(TokenTree::Punct(p)) if p.as_char() == '.');
                    if method_of_self
                        && let (Some(TokenTree::Ident(method)), Some(TokenTree::Group(_))) =
                            (tokens.get(i + 2), tokens.get(i + 3))
                    {
                        self.refer_to_method(&self.this.clone(), &method.to_string(), "self", first.span());
                    }
                    let mut path = vec![first.to_string()];
                    while colons(i + 1) {
                        let Some(TokenTree::Ident(next)) = tokens.get(i + 3) else { break };
                        path.push(next.to_string());
                        i += 3;
                    }
                    let is_macro = path.len() == 1
                        && matches!(tokens.get(i + 1), Some(TokenTree::Punct(p)) if p.as_char() == '!')
                        && matches!(tokens.get(i + 2), Some(TokenTree::Group(_)));
                    if is_macro {
                        self.refer_to_macro(&path, first.span());
                    } else if !after_colons && (path.len() > 1 || is_type_name(&path[0])) {
                        self.refer(&path, first.span());
                    }
                }
                _ => {}
            }
            i += 1;
        }
    }

    /// `#[serde(with = "super::numbers")]`.
    fn refer_in_string(&mut self, literal: &str, span: Span) {
        let path: Vec<_> = literal.trim_matches('"').split("::").map(str::to_owned).collect();
        let is_name = |s: &String| {
            s.chars().enumerate().all(|(i, c)| c == '_' || c.is_ascii_alphabetic() || (i > 0 && c.is_ascii_digit()))
                && !s.is_empty()
        };
        if !path.iter().all(is_name) {
            return;
        }
        // `with` names a module of which functions are called.
        for target in self.tree.resolve(self.module, &path) {
            match target {
                Target::Module(m) if path.len() > 1 => self.add(self.tree.modules[m].file, &path.join("::"), span),
                Target::Module(_) => {}
                item @ Target::Item { .. } => self.refer_to(vec![item], &path.join("::"), span),
            }
        }
    }

    fn refer_to_macro(&mut self, path: &[String], span: Span) {
        let targets = self.tree.resolve(self.module, path);
        if !targets.is_empty() {
            self.refer_to(targets, &path.join("::"), span);
        } else if let [name] = path
            && let Some(&file) = self.tree.macros.get(name)
        {
            self.add(file, &format!("{name}!"), span);
        }
    }
}

fn is_type_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_uppercase())
}

impl<'ast> Visit<'ast> for References<'_> {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        if !is_test(attributes(item)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, function: &'ast syn::ImplItemFn) {
        if !is_test(&function.attrs) {
            visit::visit_impl_item_fn(self, function);
        }
    }

    fn visit_item_impl(&mut self, block: &'ast syn::ItemImpl) {
        let this = type_items(self.tree, self.module, &block.self_ty);
        let outer = std::mem::replace(&mut self.this, this);
        visit::visit_item_impl(self, block);
        self.this = outer;
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        if item.leading_colon.is_some() {
            return;
        }
        for import in imports(&item.tree) {
            let targets = match import.name {
                Some(_) => self.tree.resolve(self.module, &import.path),
                None => self.tree.traits_of_glob(self.module, &import.path),
            };
            let star = if import.name.is_none() { "::*" } else { "" };
            self.refer_to(targets, &format!("{}{star}", import.path.join("::")), item.span());
        }
    }

    fn visit_block(&mut self, block: &'ast syn::Block) {
        let mut scope = HashMap::new();
        for statement in &block.stmts {
            let syn::Stmt::Item(syn::Item::Use(item)) = statement else { continue };
            for import in imports(&item.tree) {
                if let Some(name) = import.name {
                    scope.insert(name, import.path);
                }
            }
        }
        self.scopes.push(scope);
        visit::visit_block(self, block);
        self.scopes.pop();
    }

    fn visit_stmt(&mut self, statement: &'ast syn::Stmt) {
        match statement {
            syn::Stmt::Local(local) if is_test(&local.attrs) => {}
            _ => visit::visit_stmt(self, statement),
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.leading_colon.is_none() {
            let names = segments(path);
            // A single name in lower case is a variable or was imported by name, which its `use` has told already; functions
            // of a glob are in `visit_expr_call`.
            if names.len() > 1 || is_type_name(&names[0]) {
                self.refer(&names, path.span());
            }
        }
        visit::visit_path(self, path);
    }

    fn visit_expr_call(&mut self, call: &'ast syn::ExprCall) {
        if let syn::Expr::Path(function) = &*call.func
            && let [name] = &segments(&function.path)[..]
            && !is_type_name(name)
        {
            self.refer(std::slice::from_ref(name), call.span());
        }
        visit::visit_expr_call(self, call);
    }

    fn visit_expr_method_call(&mut self, call: &'ast syn::ExprMethodCall) {
        if let syn::Expr::Path(receiver) = &*call.receiver
            && receiver.path.is_ident("self")
        {
            self.refer_to_method(&self.this.clone(), &call.method.to_string(), "self", call.span());
        }
        visit::visit_expr_method_call(self, call);
    }

    fn visit_visibility(&mut self, _: &'ast syn::Visibility) {}

    fn visit_attribute(&mut self, attribute: &'ast syn::Attribute) {
        match &attribute.meta {
            syn::Meta::List(list) if !list.path.is_ident("cfg") && !list.path.is_ident("allow") => {
                self.refer_in_tokens(list.tokens.clone(), list.path.is_ident("serde"));
            }
            _ => {}
        }
    }

    fn visit_macro(&mut self, invocation: &'ast syn::Macro) {
        self.refer_to_macro(&segments(&invocation.path), invocation.path.span());
        self.refer_in_tokens(invocation.tokens.clone(), false);
    }
}
