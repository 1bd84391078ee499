//! A program as statements of a language of curly brackets: every node that is used twice gets a name, others stand where they are used.

use std::collections::HashMap;

use super::{Program, operands};
use crate::model::Expression;
use crate::model::expression::{Function, Node};

/// A line gets no longer than about this by expressions that stand in others.
const LONGEST: usize = 90;

/// How a language writes what is not the same in all of them.
pub(super) trait Syntax {
    /// A number.
    fn number(&self, value: f64) -> String;
    /// A function of one value.
    fn call(&self, function: Function, operand: &str) -> String;
    /// `then` where `condition` is above zero.
    fn where_positive(&self, condition: &str, then: &str, otherwise: &str) -> String;
    /// A named value.
    fn name(&self, name: &str, value: &str) -> String;
    /// What the program is given, by its place.
    fn variable(&self, place: usize) -> String;
}

/// Statements that give every place of `outputs` its value.
pub(super) fn statements(program: &Program, outputs: &[(String, Expression)], syntax: &impl Syntax) -> Vec<String> {
    let needed = program.needed(outputs.iter().map(|(_, expression)| *expression));
    let mut uses: HashMap<Expression, usize> = HashMap::new();
    for expression in &needed {
        operands(program.node(*expression)).for_each(|operand| *uses.entry(operand).or_default() += 1);
    }
    outputs.iter().for_each(|(_, expression)| *uses.entry(*expression).or_default() += 1);
    let mut texts: HashMap<Expression, String> = HashMap::new();
    let mut lines = Vec::new();
    for expression in needed {
        let node = program.node(expression);
        let of = |operand: Expression| texts.get(&operand).map_or("", String::as_str);
        let (text, is_atom) = match node {
            Node::Constant(bits) => (syntax.number(f64::from_bits(bits)), true),
            Node::Variable(place) => (syntax.variable(place as usize), true),
            Node::Held(a) => (of(a).to_owned(), !of(a).contains(' ')),
            Node::Add(a, b) => (format!("({} + {})", of(a), of(b)), false),
            Node::Sub(a, b) => (format!("({} - {})", of(a), of(b)), false),
            Node::Mul(a, b) => (format!("{} * {}", factor(of(a)), factor(of(b))), false),
            Node::Div(a, b) => (format!("{} / {}", factor(of(a)), factor(of(b))), false),
            Node::Neg(a) => (format!("(-{})", factor(of(a))), false),
            Node::Call(function, a) => (syntax.call(function, bare(of(a))), false),
            Node::WherePositive(a, b, c) => (syntax.where_positive(bare(of(a)), bare(of(b)), bare(of(c))), false),
        };
        let used = uses.get(&expression).copied().unwrap_or(0);
        let text = if is_atom || used <= 1 && text.len() < LONGEST {
            text
        } else {
            let name = format!("v{}", expression.place());
            lines.push(syntax.name(&name, bare(&text)));
            name
        };
        texts.insert(expression, text);
    }
    for (place, expression) in outputs {
        lines.push(format!("{place} = {};", bare(texts.get(expression).map_or("", String::as_str))));
    }
    lines
}

/// With brackets, where it is a product or a quotient that has none: sums have their own.
fn factor(text: &str) -> String {
    if is_bracketed(text) || !text.contains(" * ") && !text.contains(" / ") {
        text.to_owned()
    } else {
        format!("({text})")
    }
}

/// Without the brackets that enclose all of it.
fn bare(text: &str) -> &str {
    if is_bracketed(text) { &text[1..text.len() - 1] } else { text }
}

/// Whether the first bracket is closed by the last one.
fn is_bracketed(text: &str) -> bool {
    if !text.starts_with('(') {
        return false;
    }
    let mut depth = 0;
    for (i, c) in text.char_indices() {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return i + 1 == text.len();
        }
    }
    false
}
