//! Derivatives of expressions by one variable, written down as expressions.

use std::collections::HashMap;

use super::operands;
use crate::model::expression::{Function, Node};
use crate::model::{Expression, Quantity};

/// Expressions that are to be differentiated, with all that they need, in the order of computing.
pub(super) struct Tape {
    nodes: Vec<(Expression, Node)>,
}

/// The derivatives that are not zero.
pub(super) struct Slopes(HashMap<Expression, Expression>);

impl Slopes {
    /// Of one of the tape's expressions.
    pub(super) fn of(&self, expression: Expression) -> Expression {
        self.0.get(&expression).copied().unwrap_or_else(|| Expression::from(0.0))
    }
}

impl Tape {
    pub(super) fn of(roots: &[Expression]) -> Self {
        let mut known = HashMap::new();
        let mut stack = roots.to_vec();
        while let Some(expression) = stack.pop() {
            if let std::collections::hash_map::Entry::Vacant(entry) = known.entry(expression) {
                stack.extend(operands(*entry.insert(expression.node())));
            }
        }
        let mut nodes: Vec<_> = known.into_iter().collect();
        nodes.sort_by_key(|(expression, _)| *expression);
        Tape { nodes }
    }

    /// By the variable at this place. Held expressions have the derivatives told here, or none.
    pub(super) fn slopes(&self, variable: usize, held: &[(Expression, Expression)]) -> Slopes {
        let zero = Expression::from(0.0);
        let mut slopes: HashMap<Expression, Expression> = HashMap::new();
        for &(expression, node) in &self.nodes {
            let of = |operand: Expression| slopes.get(&operand).copied().unwrap_or(zero);
            let slope = match node {
                Node::Variable(place) if place as usize == variable => Expression::from(1.0),
                Node::Held(_) => held.iter().find(|(own, _)| *own == expression).map_or(zero, |(_, slope)| *slope),
                Node::Constant(_) | Node::Variable(_) => continue,
                _ if operands(node).all(|operand| !slopes.contains_key(&operand)) => continue,
                Node::Add(a, b) => of(a) + of(b),
                Node::Sub(a, b) => of(a) - of(b),
                Node::Mul(a, b) => of(a) * b + a * of(b),
                Node::Div(a, b) => (of(a) - expression * of(b)).over(b),
                Node::Neg(a) => -of(a),
                Node::Call(function, a) => of(a) * slope_of(function, a, expression),
                Node::WherePositive(condition, then, otherwise) => condition.where_positive(of(then), of(otherwise)),
            };
            if slope != zero {
                slopes.insert(expression, slope);
            }
        }
        Slopes(slopes)
    }
}

/// f′(a) where f(a) is known.
fn slope_of(function: Function, a: Expression, value: Expression) -> Expression {
    let number = Expression::from;
    match function {
        Function::Sin => a.call(Function::Cos),
        Function::Cos => -a.call(Function::Sin),
        Function::Exp => value,
        Function::Ln => a.recip(),
        Function::Tanh => number(1.0) - value * value,
        Function::Sqrt => number(0.5).over(value),
        Function::Abs => (-a).where_positive(number(-1.0), number(1.0)),
    }
}
