//! Tables that are models, and tables that are none.

use std::vec;

use crate::{Input, Instruction, Model, Operation, Output, Table, TableError, TableModel, Tape};

const fn does(operation: Operation, a: u16, b: u16, c: u16) -> Instruction {
    Instruction { operation, operands: [a, b, c] }
}

/// x₀′ = −2 x₀ + u, y = sin x₀ + x₁ where u > 0, else x₁; values: x₀ x₁ u t, then constants.
const RATES: Tape<'static, f64> = Tape {
    constants: &[2.0],
    instructions: &[does(Operation::Mul, 4, 0, 0), does(Operation::Sub, 2, 5, 0)],
    outputs: &[Output { place: 0, value: 6 }],
};
const RATES_SLOPES: Tape<'static, f64> = Tape {
    constants: &[2.0, -2.0],
    instructions: &[does(Operation::Mul, 4, 0, 0), does(Operation::Sub, 2, 6, 0)],
    outputs: &[Output { place: 0, value: 7 }, Output { place: 1, value: 5 }],
};
const READINGS: Tape<'static, f64> = Tape {
    constants: &[0.0, 1.0],
    instructions: &[
        does(Operation::Sin, 0, 0, 0),
        does(Operation::WherePositive, 2, 6, 4),
        does(Operation::Add, 7, 1, 0),
        does(Operation::Cos, 0, 0, 0),
        does(Operation::WherePositive, 2, 9, 4),
    ],
    outputs: &[Output { place: 0, value: 8 }, Output { place: 1, value: 10 }, Output { place: 2, value: 5 }],
};
const TABLE: Table<'static, f64> = Table {
    moving: 1,
    states: 2,
    inputs: 1,
    readings: 1,
    rates: RATES,
    rates_slopes: RATES_SLOPES,
    readings_slopes: READINGS,
};

#[test]
fn a_table_is_the_model_that_it_tells() {
    assert_eq!(TABLE.memory(), 11);
    let mut model = TableModel::new(TABLE, vec![0.0; 11]).unwrap();
    assert_eq!((model.moving(), model.states(), model.inputs(), model.readings()), (1, 2, 1, 1));
    for u in [0.5, -0.5] {
        let (x, input) = ([0.3, 0.1], Input { u: &[u], time_s: 0.0 });
        let (mut rate, mut slope) = ([f64::NAN], [f64::NAN]);
        model.rates(&x, input, &mut rate);
        assert_eq!(rate, [u - 0.6]);
        model.rates_slopes(&x, input, &mut rate, &mut slope);
        assert_eq!((rate, slope), ([u - 0.6], [-2.0]));
        let (mut y, mut by_x) = ([f64::NAN], [f64::NAN; 2]);
        model.readings_slopes(&x, input, &mut y, &mut by_x);
        let (sin, cos) = if u > 0.0 { 0.3_f64.sin_cos() } else { (0.0, 0.0) };
        // The functions are right to a unit of the last place.
        assert!((y[0] - sin - 0.1).abs() < 1e-15 && (by_x[0] - cos).abs() < 1e-15 && by_x[1] == 1.0);
    }
    // Slices of other lengths are no reason to panic.
    model.rates(&[], Input { u: &[1.0; 9], time_s: 0.0 }, &mut [0.0]);
}

#[test]
fn tables_that_are_none_are_refused() {
    let refused = |table: Table<'static, f64>, memory: usize| TableModel::new(table, vec![0.0; memory]).err();
    const LATER: &[Instruction] = &[does(Operation::Neg, 5, 0, 0)];
    let later = Tape { instructions: LATER, ..RATES };
    let expected = TableError::Operand { of: "instruction", number: 0 };
    assert_eq!(refused(Table { rates: later, ..TABLE }, 99), Some(expected));
    const WRONG: [&[Output]; 2] = [&[Output { place: 1, value: 0 }], &[Output { place: 0, value: 7 }]];
    for output in WRONG {
        let wrong = Tape { outputs: output, ..RATES };
        let expected = TableError::Operand { of: "output", number: 0 };
        assert_eq!(refused(Table { rates: wrong, ..TABLE }, 99), Some(expected));
    }
    assert_eq!(refused(Table { moving: 3, ..TABLE }, 99), Some(TableError::Sizes));
    assert_eq!(refused(TABLE, 10), Some(TableError::Memory { needed: 11, given: 10 }));
}
