//! Units of quantities as powers of base units, by which tools check connections and convert.

/// Exponents of kg, m, s, A and rad.
type Powers = [i32; 5];

const BASES: [&str; 5] = ["kg", "m", "s", "A", "rad"];

/// The attributes of the standard's `BaseUnit`; none of what is no product of powers.
pub(super) fn base_unit(unit: &str) -> Option<String> {
    let powers = match unit.split_once('/') {
        None => product(unit)?,
        Some((above, below)) => {
            let below = below.strip_prefix('(').and_then(|below| below.strip_suffix(')')).unwrap_or(below);
            let (above, below) = (product(above)?, product(below)?);
            std::array::from_fn(|i| above[i] - below[i])
        }
    };
    let named = BASES.iter().zip(powers).filter(|(_, power)| *power != 0);
    Some(named.map(|(base, power)| format!(" {base}=\"{power}\"")).collect())
}

fn product(text: &str) -> Option<Powers> {
    let mut powers = [0; 5];
    for word in text.split_whitespace() {
        let (symbol, exponent) = match word.split_once('^') {
            Some((symbol, exponent)) => (symbol, exponent.parse::<i32>().ok()?),
            None => (word, 1),
        };
        for (power, own) in powers.iter_mut().zip(symbol_of(symbol)?) {
            *power += exponent * own;
        }
    }
    Some(powers)
}

fn symbol_of(symbol: &str) -> Option<Powers> {
    Some(match symbol {
        "1" => [0; 5],
        "kg" => [1, 0, 0, 0, 0],
        "m" => [0, 1, 0, 0, 0],
        "s" => [0, 0, 1, 0, 0],
        "A" => [0, 0, 0, 1, 0],
        "rad" => [0, 0, 0, 0, 1],
        "N" => [1, 1, -2, 0, 0],
        "V" => [1, 2, -3, -1, 0],
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::base_unit;

    #[test]
    fn units_of_parameters_are_products_of_base_units() {
        let of = |unit| base_unit(unit).unwrap();
        assert_eq!(of("N m/rad"), " kg=\"1\" m=\"2\" s=\"-2\" rad=\"-1\"");
        assert_eq!(of("V/(N m)"), " s=\"-1\" A=\"-1\"");
        assert_eq!(of("N m s^2/rad^2"), " kg=\"1\" m=\"2\" rad=\"-2\"");
        assert_eq!(of("1/s"), " s=\"-1\"");
        assert_eq!(of("1"), "");
        assert_eq!((base_unit("of its own"), base_unit("N^x")), (None, None));
    }
}
