//! Macros that write to the process' standard output or standard error.

use proc_macro2::{TokenStream, TokenTree};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

use crate::modules::{Tree, attributes, is_test};

const PRINTING: [&str; 5] = ["print", "println", "eprint", "eprintln", "dbg"];

/// Places where code that is not a test prints, as `src/a.rs:3: println!`.
pub fn prints(tree: &Tree) -> Vec<String> {
    let mut found = Vec::new();
    for module in &tree.modules {
        let mut visitor = Prints { found: Vec::new() };
        module.syntax.iter().for_each(|item| visitor.visit_item(item));
        let file = tree.files[module.file].0.display();
        found.extend(visitor.found.into_iter().map(|(line, name)| format!("{file}:{line}: {name}!")));
    }
    found
}

struct Prints {
    found: Vec<(usize, String)>,
}

impl Prints {
    fn scan(&mut self, tokens: TokenStream) {
        let tokens: Vec<_> = tokens.into_iter().collect();
        for (i, token) in tokens.iter().enumerate() {
            match token {
                TokenTree::Group(group) => self.scan(group.stream()),
                TokenTree::Ident(name)
                    if PRINTING.iter().any(|p| name == p)
                        && matches!(tokens.get(i + 1), Some(TokenTree::Punct(p)) if p.as_char() == '!') =>
                {
                    self.found.push((name.span().start().line, name.to_string()));
                }
                _ => {}
            }
        }
    }
}

impl<'ast> Visit<'ast> for Prints {
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

    fn visit_macro(&mut self, invocation: &'ast syn::Macro) {
        if let Some(name) = invocation.path.segments.last()
            && PRINTING.iter().any(|p| name.ident == p)
        {
            self.found.push((invocation.span().start().line, name.ident.to_string()));
        }
        self.scan(invocation.tokens.clone());
    }
}
