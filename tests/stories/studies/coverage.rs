//! Intervals hold the truth as often as they say, on twenty simulated robots with process noise.

use std::io::Write;

use tests::coverage::{Outcome, Table, chi_square_band, study};

const RUNS: u64 = 20;

/// What the twenty errors are under the covariances, summed, is χ² of 20 · 12 degrees of freedom for the dynamics: in 99.9 % of
/// studies within 174 to 319. Intervals a factor 1.5 too narrow make 540 of it, a factor 2 too wide 60.
#[test]
fn intervals_of_twenty_robots_hold_the_truth() {
    let scratch = tempfile::tempdir().unwrap();
    let file = scratch.path().join("coverage.jsonl");
    // It was stopped after two recordings, in the middle of writing the second.
    study(&file, 1, 1, 1.0, 1, |_| {}).unwrap();
    let first = std::fs::read_to_string(&file).unwrap();
    std::fs::OpenOptions::new().append(true).open(&file).unwrap().write_all(b"{\"seed\":2,\"process_no").unwrap();
    let outcomes = study(&file, 1, RUNS, 1.0, 2, |_| {}).unwrap();
    let table = Table::of(&outcomes);
    eprint!("{table}");
    let lines = std::fs::read_to_string(&file).unwrap();
    assert!(lines.starts_with(&first), "what the file holds stays as it is");
    assert_eq!(lines.matches("\"seed\":1,").count(), 1, "and is not made again");
    let seeds: Vec<u64> = outcomes.iter().map(|outcome| outcome.seed).collect();
    assert_eq!(seeds, (1..=RUNS).collect::<Vec<_>>());
    assert!(outcomes.iter().all(|outcome| outcome.status == "converged"), "{outcomes:?}");

    for (name, distance) in [
        ("dynamics", (|outcome| outcome.dynamics) as fn(&Outcome) -> tests::coverage::Distance),
        ("all", |outcome| outcome.all),
    ] {
        let dof: usize = outcomes.iter().map(|outcome| distance(outcome).parameters).sum();
        let chi2: f64 = outcomes.iter().map(|outcome| distance(outcome).chi2).sum();
        let band = chi_square_band(dof as f64, 0.999);
        eprintln!("{name}: χ² {chi2:.0} of {dof} degrees of freedom, band {band:.0?}");
        assert!(band.contains(&chi2), "{name}: {chi2:.0} is not in {band:.0?}");
    }
    for row in &table.rows {
        assert!(row.band().contains(&row.covering), "{row:?}");
    }
}
