//! Means against closed forms, and files that must not count.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{Estimates, Merged};

fn estimates(values: &[f64], covariance: &[&[f64]]) -> Estimates {
    Estimates {
        names: (0..values.len()).map(|i| format!("p[{}]", i + 1)).collect(),
        units: vec!["N m".to_owned(); values.len()],
        values: values.to_vec(),
        covariance: covariance.iter().map(|row| row.to_vec()).collect(),
    }
}

#[test]
fn two_numbers_have_the_mean_of_the_textbook() {
    let (a, b) = (estimates(&[10.0], &[&[4.0]]), estimates(&[13.0], &[&[1.0]]));
    let merged = Merged::of(&[&a, &b]);
    let p = &merged.parameters[0];
    // Weights 1/4 and 1: (2.5 + 13) / 1.25, error 1/√1.25, χ² = 3² / 5.
    assert!((p.mean - 12.4).abs() < 1e-12 && (p.std_error - 0.8f64.sqrt()).abs() < 1e-12, "{p:?}");
    assert!((p.chi2 - 1.8).abs() < 1e-12 && (merged.chi2 - 1.8).abs() < 1e-12, "{p:?}");
    assert_eq!((merged.dof, merged.count, merged.consistent), (1, 2, true));
    // A normal number squared exceeds 1.8 in 17.97 % of cases.
    assert!((merged.p_value.unwrap() - 0.1797).abs() < 1e-4, "{merged:?}");
    // The excess 0.8 of χ² over the room 1.25 − 1.0625/1.25 = 0.4.
    assert!((p.spread - 2f64.sqrt()).abs() < 1e-12, "{}", p.spread);
}

#[test]
fn a_single_member_is_passed_through() {
    let a = estimates(&[10.0, -2.0], &[&[4.0, 0.5], &[0.5, 1.0]]);
    let merged = Merged::of(&[&a]);
    assert_eq!((merged.dof, merged.p_value, merged.consistent), (0, None, true));
    let again = merged.estimates();
    for i in 0..2 {
        assert!((again.values[i] - a.values[i]).abs() < 1e-12);
        assert!((0..2).all(|j| (again.covariance[i][j] - a.covariance[i][j]).abs() < 1e-12), "{again:?}");
    }
}

#[test]
fn a_parameter_that_only_one_member_has_profits_from_the_others() {
    // p[2] of the first is tied to its p[1], which the second knows exactly.
    let a = estimates(&[1.0, 5.0], &[&[1.0, 0.9], &[0.9, 1.0]]);
    let b = estimates(&[0.0], &[&[1e-12]]);
    let merged = Merged::of(&[&a, &b]);
    assert_eq!(merged.parameters[1].count, 1);
    assert!((merged.parameters[1].mean - 4.1).abs() < 1e-6, "{merged:?}"); // 5 − 0.9 · 1
    assert!((merged.parameters[1].std_error - 0.19f64.sqrt()).abs() < 1e-6);
}

/// p-values of members that share their parameters are uniform, intervals hold the truth, and a spread is found where there
/// is one: 400 fleets of 5 with correlated errors.
#[test]
fn the_test_and_the_intervals_are_calibrated() {
    let covariance = DMatrix::from_row_slice(2, 2, &[1.0, -1.6, -1.6, 4.0]);
    let root = covariance.clone().cholesky().unwrap().l();
    let rows: Vec<Vec<f64>> = (0..2).map(|i| (0..2).map(|j| covariance[(i, j)]).collect()).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for (spread, seen) in [(0.0, 0..1), (3.0, 1..2)] {
        let (mut rejected, mut held, mut spreads) = (0, 0, 0.0);
        for _ in 0..400 {
            let members: Vec<Estimates> = (0..5)
                .map(|_| {
                    let noise = DVector::from_fn(2, |_, _| StandardNormal.sample(&mut rng));
                    let own: f64 = StandardNormal.sample(&mut rng);
                    let values = &root * noise + DVector::from_vec(vec![7.0 + spread * own, -3.0]);
                    Estimates { covariance: rows.clone(), ..estimates(values.as_slice(), &[]) }
                })
                .collect();
            let merged = Merged::of(&members.iter().collect::<Vec<_>>());
            assert_eq!(merged.dof, 8);
            rejected += usize::from(merged.p_value.unwrap() < 0.05);
            let p = &merged.parameters[0];
            let (mean, error) =
                if spread > 0.0 { (p.population_mean, p.population_error) } else { (p.mean, p.std_error) };
            held += usize::from((mean - 7.0).abs() < 1.96 * error);
            spreads += p.spread / 400.0;
        }
        // Binomial: 20 ± 4.4 rejected of 400, 380 ± 4.4 held; with a spread from five members, intervals are short.
        match seen.start {
            0 => assert!((6..=36).contains(&rejected) && (365..=394).contains(&held), "{rejected} {held}"),
            _ => {
                assert!(rejected > 380 && (330..=390).contains(&held), "{rejected} {held}");
                assert!((2.4..3.2).contains(&spreads), "{spreads}");
            }
        }
    }
}
