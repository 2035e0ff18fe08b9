//! Lengths of functions, signatures and files.

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};

use crate::source_files::SourceFile;

/// Most lines of a function from `fn` to its closing brace, with the functions and closures inside it: what fits on a screen and
/// is read in one go.
pub const FUNCTION_LINES: usize = 80;
/// Most arguments of a function, `self` included: a call with more cannot be read without its signature.
pub const ARGUMENTS: usize = 8;
/// Most lines of a file: one concept, with its tests if they are short.
pub const FILE_LINES: usize = 500;

/// The functions of a file that are too long or take too many arguments, and the file itself if it is too long.
pub fn check_size(file: &SourceFile) -> Vec<String> {
    let mut violations = Vec::new();
    let lines = file.lines.len();
    if lines > FILE_LINES {
        violations.push(file.violation(1, &format!("the file has {lines} lines, at most {FILE_LINES} are allowed")));
    }
    let mut functions = Vec::new();
    add_functions(file.tokens.clone(), &mut functions);
    for Function { name, line, lines, arguments } in functions {
        if lines > FUNCTION_LINES {
            let text = format!("`{name}` has {lines} lines, at most {FUNCTION_LINES} are allowed");
            violations.push(file.violation(line, &text));
        }
        if arguments > ARGUMENTS {
            let text = format!("`{name}` takes {arguments} arguments, at most {ARGUMENTS} are allowed");
            violations.push(file.violation(line, &text));
        }
    }
    violations
}

/// A function as it is written, in a macro's arguments or definition too.
struct Function {
    name: String,
    /// Line of `fn`.
    line: usize,
    /// From `fn` to the closing brace; to the signature's end for a function without a body.
    lines: usize,
    arguments: usize,
}

fn add_functions(tokens: TokenStream, functions: &mut Vec<Function>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    for (i, token) in tokens.iter().enumerate() {
        match token {
            TokenTree::Group(group) => add_functions(group.stream(), functions),
            TokenTree::Ident(keyword) if keyword == "fn" => functions.extend(function(&tokens[i..])),
            _ => {}
        }
    }
}

/// The function that begins with `fn` at the first of these tokens; `None` for the type of a function pointer.
fn function(tokens: &[TokenTree]) -> Option<Function> {
    // `fn $name` in the definition of a macro.
    let name_at = 1 + usize::from(tokens.get(1).is_some_and(|token| is_punct(token, '$')));
    let Some(TokenTree::Ident(name)) = tokens.get(name_at) else { return None };
    let line = tokens[0].span().start().line;
    let mut end = line;
    let mut arguments = None;
    for token in outside_angles(&tokens[name_at + 1..]) {
        end = token.span().end().line;
        match token {
            TokenTree::Group(group) if group.delimiter() == Delimiter::Parenthesis && arguments.is_none() => {
                arguments = Some(argument_count(group.stream()));
            }
            TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => break,
            TokenTree::Punct(punct) if punct.as_char() == ';' => break,
            _ => {}
        }
    }
    Some(Function { name: name.to_string(), line, lines: end + 1 - line, arguments: arguments? })
}

fn argument_count(arguments: TokenStream) -> usize {
    let arguments: Vec<TokenTree> = arguments.into_iter().collect();
    let outside: Vec<&TokenTree> = outside_angles(&arguments).collect();
    outside.split(|token| is_punct(token, ',')).filter(|argument| !argument.is_empty()).count()
}

/// The tokens that are not between `<` and `>`, which are brackets here: of signatures only. The brackets are left out, arrows
/// are not taken for any.
fn outside_angles(tokens: &[TokenTree]) -> impl Iterator<Item = &TokenTree> {
    let mut depth = 0_usize;
    let mut after_dash = false;
    tokens.iter().filter(move |token| {
        let is_arrow = after_dash && is_punct(token, '>');
        after_dash = matches!(token, TokenTree::Punct(p) if p.as_char() == '-' && p.spacing() == Spacing::Joint);
        if is_arrow {
            return depth == 0;
        }
        let (opens, closes) = (is_punct(token, '<'), is_punct(token, '>'));
        depth = (depth + usize::from(opens)).saturating_sub(usize::from(closes));
        depth == 0 && !closes
    })
}

fn is_punct(token: &TokenTree, character: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == character)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(text: &str, violations: &[&str]) {
        assert_eq!(check_size(&SourceFile::new("a.rs", text).unwrap()), violations, "{text}");
    }

    #[test]
    fn functions_of_at_most_the_allowed_lines_pass() {
        let body = |lines: usize| "    f();\n".repeat(lines);
        check(&format!("/// Doc\n#[test]\nfn a() {{\n{}}}\n", body(78)), &[]);
        let long = ["a.rs:3: `a` has 81 lines, at most 80 are allowed"];
        check(&format!("\n\npub(crate) fn a() {{\n{}}}\nfn b() {{}}", body(79)), &long);
        check(&format!("impl A {{\n\nfn a(\n&self,) -> [u8; {{ 1 }}] {{\n{}}}}}", body(78)), &long);
        check(
            &format!("mod m {{ proptest! {{\nfn a(x in 0..2) {{\n{}}} }} }}", body(79)),
            &["a.rs:2: `a` has 81 lines, at most 80 are allowed"],
        );
        // Inner functions and closures count in their parents.
        check(&format!("\n\nfn a() {{\nlet g = || {{\nfn inner() {{\n{}}} }}; }}", body(77)), &long);
        check(&format!("const F: fn(u8) = f;\nstruct S;\n{}", "fn a() {}\n".repeat(81)), &[]);
    }

    #[test]
    fn arguments_are_counted_outside_of_brackets() {
        let eight =
            "a: A, (b, c): (B, C), d: Map<K, V>, e: impl Fn(E, E) -> Map<K, V>, f: [F; 2], g: G<{ 1 }, 2>, h: &dyn H,";
        check(
            &format!(
                "fn f<T: Fn(A, B) -> C, const N: usize>(&self, {eight}\n) -> Option<(A, B)> where T: Fn(A, B) {{}}"
            ),
            &[],
        );
        let nine = ["a.rs:1: `f` takes 9 arguments, at most 8 are allowed"];
        check(&format!("fn f<T: Fn(A) -> C>({eight} i: I, j: J) {{}}"), &nine);
        check(&format!("trait T {{ fn f(&self, {eight} i: I); }}"), &nine);
        check(&format!("macro_rules! m {{ () => {{ fn $f({eight} i: I, j: J) {{}} }} }}"), &nine);
        check(&format!("type F = fn({eight} u8, u8);"), &[]);
    }

    #[test]
    fn files_of_at_most_the_allowed_lines_pass() {
        check(&"// A comment.\n".repeat(500), &[]);
        check(&"\n".repeat(501), &["a.rs:1: the file has 501 lines, at most 500 are allowed"]);
    }
}
