//! A scalar that has no value but remembers how it is computed: run through the model's own laws it writes their formulas down.
//!
//! ```text
//! Expression ── the equations of model, law, chain ──▶ graph of nodes, each once ──▶ derivatives, program text
//! ```
//! The nodes of a thread's expressions stand in one graph, so that an expression is a number of four bytes. [`traced`] begins a graph and
//! hands it over; an expression means nothing outside of it. Equal nodes are one node; sums with zero, products with zero and one, and constants are
//! worked out at once. Nothing else is rearranged, so that a program rounds as the model does.

use std::cell::RefCell;
use std::collections::HashMap;
use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

use super::quantity::{FAR_FROM_CORNER, Quantity};
use crate::robot::chain::Arithmetic;

/// A node of the thread's graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Expression(u32);

/// How a value is computed from others, which stand before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Node {
    /// A number, by its bits.
    Constant(u64),
    /// What the program is given, by its place.
    Variable(u32),
    /// a + b.
    Add(Expression, Expression),
    /// a − b.
    Sub(Expression, Expression),
    /// a b.
    Mul(Expression, Expression),
    /// a / b.
    Div(Expression, Expression),
    /// −a.
    Neg(Expression),
    /// A function of one value.
    Call(Function, Expression),
    /// The second where the first is above zero, else the third.
    WherePositive(Expression, Expression, Expression),
    /// The same value, whose derivatives are told from elsewhere: the solution of a linear system.
    Held(Expression),
}

/// A function of one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Function {
    /// sin.
    Sin,
    /// cos.
    Cos,
    /// eˣ.
    Exp,
    /// Natural logarithm.
    Ln,
    /// tanh.
    Tanh,
    /// Square root.
    Sqrt,
    /// |x|.
    Abs,
}

impl Function {
    /// Its value.
    pub fn at(self, x: f64) -> f64 {
        match self {
            Function::Sin => x.sin(),
            Function::Cos => x.cos(),
            Function::Exp => x.exp(),
            Function::Ln => x.ln(),
            Function::Tanh => x.tanh(),
            Function::Sqrt => x.sqrt(),
            Function::Abs => x.abs(),
        }
    }
}

#[derive(Debug, Default)]
struct Graph {
    nodes: Vec<Node>,
    known: HashMap<Node, Expression>,
}

thread_local! {
    static GRAPH: RefCell<Graph> = RefCell::default();
}

/// Runs `work` on a graph of its own; gives its result and all nodes, an expression's own at its [`place`](Expression::place).
pub fn traced<R>(work: impl FnOnce() -> R) -> (R, Vec<Node>) {
    GRAPH.with(|graph| *graph.borrow_mut() = Graph::default());
    let result = work();
    let nodes = GRAPH.with(|graph| std::mem::take(&mut *graph.borrow_mut()).nodes);
    (result, nodes)
}

impl Expression {
    /// What the program is given at this place.
    pub fn variable(place: usize) -> Self {
        Self::of(Node::Variable(u32::try_from(place).unwrap_or(u32::MAX)))
    }

    /// What no program can compute; it spoils everything that depends on it.
    pub fn unknown() -> Self {
        Self::constant(f64::NAN)
    }

    /// Its place in the graph.
    pub fn place(self) -> usize {
        self.0 as usize
    }

    /// How it is computed.
    pub fn node(self) -> Node {
        GRAPH.with(|graph| graph.borrow().nodes[self.place()])
    }

    /// Its number, if it is one.
    pub fn number(self) -> Option<f64> {
        match self.node() {
            Node::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// The same value with derivatives that are told from elsewhere.
    pub fn held(self) -> Self {
        Self::of(Node::Held(self))
    }

    /// √x.
    pub fn sqrt(self) -> Self {
        self.call(Function::Sqrt)
    }

    /// A function of it.
    pub fn call(self, function: Function) -> Self {
        match self.number() {
            Some(number) => Self::constant(function.at(number)),
            None => Self::of(Node::Call(function, self)),
        }
    }

    fn constant(value: f64) -> Self {
        // One zero: signs of zeros are nobody's.
        Self::of(Node::Constant(if value == 0.0 { 0 } else { value.to_bits() }))
    }

    fn of(node: Node) -> Self {
        GRAPH.with(|graph| {
            let graph = &mut *graph.borrow_mut();
            *graph.known.entry(node).or_insert_with(|| {
                graph.nodes.push(node);
                Expression(u32::try_from(graph.nodes.len() - 1).unwrap_or(u32::MAX))
            })
        })
    }
}

impl From<f64> for Expression {
    fn from(value: f64) -> Self {
        Self::constant(value)
    }
}

impl Add for Expression {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        match (self.number(), other.number()) {
            (Some(a), Some(b)) => Self::constant(a + b),
            (Some(0.0), _) => other,
            (_, Some(0.0)) => self,
            _ => match (self.node(), other.node()) {
                (_, Node::Neg(b)) => self - b,
                (Node::Neg(a), _) => other - a,
                _ => Self::of(Node::Add(self.min(other), self.max(other))),
            },
        }
    }
}

impl Sub for Expression {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        match (self.number(), other.number()) {
            (Some(a), Some(b)) => Self::constant(a - b),
            (Some(0.0), _) => -other,
            (_, Some(0.0)) => self,
            _ if self == other => Self::constant(0.0),
            _ => match other.node() {
                Node::Neg(b) => self + b,
                _ => Self::of(Node::Sub(self, other)),
            },
        }
    }
}

impl Mul for Expression {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        match (self.number(), other.number()) {
            (Some(a), Some(b)) => Self::constant(a * b),
            (Some(0.0), _) | (_, Some(0.0)) => Self::constant(0.0),
            (Some(1.0), _) => other,
            (_, Some(1.0)) => self,
            (Some(-1.0), _) => -other,
            (_, Some(-1.0)) => -self,
            _ => match (self.node(), other.node()) {
                (Node::Neg(a), Node::Neg(b)) => a * b,
                (Node::Neg(a), _) => -(a * other),
                (_, Node::Neg(b)) => -(self * b),
                _ => Self::of(Node::Mul(self.min(other), self.max(other))),
            },
        }
    }
}

impl Mul<f64> for Expression {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        self * Self::constant(factor)
    }
}

impl Neg for Expression {
    type Output = Self;
    fn neg(self) -> Self {
        match self.node() {
            Node::Constant(bits) => Self::constant(-f64::from_bits(bits)),
            Node::Neg(a) => a,
            Node::Sub(a, b) => b - a,
            _ => Self::of(Node::Neg(self)),
        }
    }
}

impl AddAssign for Expression {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Expression {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl Arithmetic for Expression {
    fn sin_cos(self) -> (Self, Self) {
        (self.call(Function::Sin), self.call(Function::Cos))
    }
}

impl Quantity for Expression {
    fn recip(self) -> Self {
        Self::constant(1.0).over(self)
    }

    fn over(self, divisor: Self) -> Self {
        match (self.number(), divisor.number()) {
            (Some(a), Some(b)) => Self::constant(a / b),
            (Some(0.0), _) => self,
            (_, Some(1.0)) => self,
            _ => Self::of(Node::Div(self, divisor)),
        }
    }

    fn abs(self) -> Self {
        self.call(Function::Abs)
    }

    fn exp(self) -> Self {
        self.call(Function::Exp)
    }

    fn ln(self) -> Self {
        self.call(Function::Ln)
    }

    fn tanh(self) -> Self {
        self.call(Function::Tanh)
    }

    fn ramp(self, width: f64) -> Self {
        let (a, one) = (self.over(Self::constant(width)), Self::constant(1.0));
        let near = Self::constant(FAR_FROM_CORNER) - a.abs();
        let e = near.where_positive((-a.abs()).exp(), Self::constant(0.0));
        // (a + |a|) / 2 has the slope 1 at the corner if |a| has; ½ is left by the logarithm.
        ((a + a.abs()) * 0.5 + (one + e).ln()) * width
    }

    fn step(self, width: f64) -> Self {
        ((self * 0.5).over(Self::constant(width))).tanh() * 0.5 + Self::constant(0.5)
    }

    fn where_positive(self, then: Self, otherwise: Self) -> Self {
        match self.number() {
            Some(number) if number > 0.0 => then,
            Some(_) => otherwise,
            None if then == otherwise => then,
            None => Self::of(Node::WherePositive(self, then, otherwise)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_nodes_are_one_and_constants_are_worked_out() {
        let ((), nodes) = traced(|| {
            let (x, y) = (Expression::variable(0), Expression::variable(1));
            assert_eq!(x * y + y * x, (y * x) + (x * y));
            assert_eq!((x * 0.0 + Expression::from(2.0) * 3.0).number(), Some(6.0));
            assert_eq!(x - x, Expression::from(0.0));
            assert_eq!(-(x - y), y - x);
            assert_eq!((-x) * (-y), x * y);
            assert_eq!(x.sin_cos().0, x.sin_cos().0);
            assert_eq!(Expression::from(1.0).where_positive(x, y), x);
        });
        let products = nodes.iter().filter(|node| matches!(node, Node::Mul(..))).count();
        assert_eq!(products, 1, "{nodes:?}");
    }
}
