//! Where in a source mutants go, and what is written there.

use std::collections::HashMap;
use std::ops::Range;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{Arm, BinOp, Block, Expr, ExprBinary, ExprUnary, Signature};

pub struct Mutant {
    number: usize,
    genre: String,
    line: usize,
    column: usize,
    replacement: String,
}

impl Mutant {
    pub fn new(number: usize, mutant: &serde_json::Value) -> Self {
        let text = |value: &serde_json::Value| value.as_str().expect("a text").to_owned();
        let place = |name: &str| mutant["span"]["start"][name].as_u64().expect("a number") as usize;
        Self {
            number,
            genre: text(&mutant["genre"]),
            line: place("line"),
            column: place("column"),
            replacement: text(&mutant["replacement"]),
        }
    }
}

/// Something written between two bytes of the source.
pub struct Insertion {
    /// The byte, then what comes first of those at one byte: ends before beginnings, inner ends and outer beginnings first.
    pub order: (usize, bool, isize),
    /// With the number of the mutant, if it is one's, and whether it is in a `const fn`.
    pub parts: Vec<(String, Option<(usize, bool)>)>,
}

pub fn find(source: &str, mutants: &[Mutant]) -> Vec<Insertion> {
    let starts: Vec<usize> = std::iter::once(0).chain(source.match_indices('\n').map(|(at, _)| at + 1)).collect();
    let mut here: HashMap<(&str, usize), Vec<&Mutant>> = HashMap::new();
    for mutant in mutants {
        let line = &source[starts[mutant.line - 1]..];
        let column = line.char_indices().nth(mutant.column - 1).expect("a column of the line").0;
        here.entry((&mutant.genre, starts[mutant.line - 1] + column)).or_default().push(mutant);
    }
    let mut sites = Sites { source, here, constant: false, found: Vec::new() };
    sites.visit_file(&syn::parse_file(source).expect("Rust"));
    sites.found
}

struct Sites<'a> {
    source: &'a str,
    here: HashMap<(&'a str, usize), Vec<&'a Mutant>>,
    /// Whether it is in a `const fn`.
    constant: bool,
    found: Vec<Insertion>,
}

impl Sites<'_> {
    fn range(&self, of: &impl Spanned) -> Range<usize> {
        of.span().byte_range()
    }

    fn text(&self, of: &impl Spanned) -> String {
        self.source[self.range(of)].to_owned()
    }

    /// Writes a choice around an expression: what `mutated` says for each of the mutants there, or else the expression as it is, with
    /// whatever is woven into it in turn.
    fn choose(
        &mut self,
        genre: &'static str,
        place: usize,
        before: &str,
        whole: Range<usize>,
        mutated: impl Fn(&Mutant) -> String,
    ) {
        let Some(mutants) = self.here.remove(&(genre, place)) else { return };
        let size = whole.len() as isize;
        let mut parts = vec![(format!("{before}(match crate::mutant::on() {{ "), None)];
        for mutant in mutants {
            parts.push((format!("{} => {}, ", mutant.number, mutated(mutant)), Some((mutant.number, self.constant))));
        }
        parts.push(("_ => ".to_owned(), None));
        self.found.push(Insertion { order: (whole.start, true, -size), parts });
        self.found.push(Insertion { order: (whole.end, false, size), parts: vec![("})".to_owned(), None)] });
    }

    fn body(&mut self, signature: &Signature, block: &Block, visit: impl FnOnce(&mut Self)) {
        let before = self.constant;
        self.constant = signature.constness.is_some();
        // One `impl Trait` cannot be two types.
        let one_type = self.text(&signature.output).contains("impl ");
        if let (Some(first), Some(last), false) = (block.stmts.first(), block.stmts.last(), one_type) {
            let whole = self.range(first).start..self.range(last).end;
            if let Some(mutants) = self.here.remove(&("FnValue", whole.start)) {
                let mut parts = vec![("match crate::mutant::on() { ".to_owned(), None)];
                for mutant in mutants {
                    let arm = format!("{} => return {}, ", mutant.number, mutant.replacement);
                    parts.push((arm, Some((mutant.number, self.constant))));
                }
                parts.push(("_ => {} } ".to_owned(), None));
                self.found.push(Insertion { order: (whole.start, true, -(whole.len() as isize) - 1), parts });
            }
        }
        visit(self);
        self.constant = before;
    }
}

/// Whether names are bound in a chain of conditions, which must not be taken apart.
fn binds(condition: &Expr) -> bool {
    match condition {
        Expr::Let(_) => true,
        Expr::Binary(ExprBinary { left, op: BinOp::And(_), right, .. }) => binds(left) || binds(right),
        _ => false,
    }
}

impl<'ast> Visit<'ast> for Sites<'_> {
    fn visit_expr_binary(&mut self, node: &'ast ExprBinary) {
        if !binds(&node.left) && !binds(&node.right) {
            let (left, right) = (self.text(&node.left), self.text(&node.right));
            let place = self.range(&node.op).start;
            self.choose("BinaryOperator", place, "", self.range(node), |mutant| {
                format!("({left}) {} ({right})", mutant.replacement)
            });
        }
        visit::visit_expr_binary(self, node);
    }

    fn visit_expr_unary(&mut self, node: &'ast ExprUnary) {
        let inner = self.text(&node.expr);
        self.choose("UnaryOperator", self.range(&node.op).start, "", self.range(node), |_| inner.clone());
        visit::visit_expr_unary(self, node);
    }

    fn visit_expr_struct(&mut self, node: &'ast syn::ExprStruct) {
        if let Some(rest) = &node.rest {
            let rest = self.text(rest);
            for field in &node.fields {
                let (whole, name) = (self.range(&field.expr), self.text(&field.member));
                let before = if field.colon_token.is_some() { String::new() } else { format!("{name}: ") };
                self.choose("StructField", self.range(field).start, &before, whole, |_| format!("({rest}).{name}"));
            }
        }
        visit::visit_expr_struct(self, node);
    }

    fn visit_arm(&mut self, node: &'ast Arm) {
        let guard = node.guard.as_ref().map(|(_, guard)| guard);
        if guard.is_none_or(|guard| !binds(guard)) {
            if let Some(mutants) = self.here.remove(&("MatchArm", self.range(node).start)) {
                let number = mutants[0].number;
                let there = Some((number, self.constant));
                match guard.map(|guard| self.range(guard)) {
                    Some(guard) => {
                        let (text, size) = (format!("crate::mutant::on() != {number} && ("), guard.len() as isize + 1);
                        self.found.push(Insertion { order: (guard.start, true, -size), parts: vec![(text, there)] });
                        self.found
                            .push(Insertion { order: (guard.end, false, size), parts: vec![(")".to_owned(), None)] });
                    }
                    None => {
                        let text = format!(" if crate::mutant::on() != {number}");
                        self.found.push(Insertion {
                            order: (self.range(&node.pat).end, false, 0),
                            parts: vec![(text, there)],
                        });
                    }
                }
            }
            if let Some(guard) = guard {
                let whole = self.range(guard);
                self.choose("MatchArmGuard", whole.start, "", whole, |mutant| mutant.replacement.clone());
            }
        }
        visit::visit_arm(self, node);
    }

    fn visit_item_fn(&mut self, node: &'ast syn::ItemFn) {
        self.body(&node.sig, &node.block, |sites| visit::visit_item_fn(sites, node));
    }

    fn visit_impl_item_fn(&mut self, node: &'ast syn::ImplItemFn) {
        self.body(&node.sig, &node.block, |sites| visit::visit_impl_item_fn(sites, node));
    }

    fn visit_trait_item_fn(&mut self, node: &'ast syn::TraitItemFn) {
        if let Some(block) = &node.default {
            self.body(&node.sig, block, |sites| visit::visit_trait_item_fn(sites, node));
        }
    }

    // What is computed by the compiler cannot be chosen later.
    fn visit_item_const(&mut self, _: &'ast syn::ItemConst) {}
    fn visit_impl_item_const(&mut self, _: &'ast syn::ImplItemConst) {}
    fn visit_trait_item_const(&mut self, _: &'ast syn::TraitItemConst) {}
    fn visit_item_static(&mut self, _: &'ast syn::ItemStatic) {}
    fn visit_expr_const(&mut self, _: &'ast syn::ExprConst) {}
    fn visit_expr_repeat(&mut self, node: &'ast syn::ExprRepeat) {
        self.visit_expr(&node.expr);
    }
    fn visit_type(&mut self, _: &'ast syn::Type) {}
    fn visit_pat(&mut self, _: &'ast syn::Pat) {}
    fn visit_generic_argument(&mut self, _: &'ast syn::GenericArgument) {}
    fn visit_variant(&mut self, _: &'ast syn::Variant) {}
}
