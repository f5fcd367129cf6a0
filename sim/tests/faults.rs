//! Faults on every protocol, in virtual time: the short form of the example `faults`.

use sim::faults::{Kind, Outcome, Protocol, run};

/// The first of the seeds.
const SEED: u64 = 100;
/// Runs of each fault on each protocol.
const RUNS: u64 = 5;

fn runs(protocol: Protocol, kind: Kind) -> impl Iterator<Item = (u64, Outcome)> {
    (SEED..SEED + RUNS).map(move |seed| (seed, run(protocol, kind, seed)))
}

/// Every fault but those of a cut of WoodenHaptics, whose motors hold their currents for half a second: what its hand is
/// given then, no host can prevent.
#[test]
fn no_fault_leaves_a_force_or_gives_energy() {
    for protocol in Protocol::ALL {
        for kind in Kind::ALL {
            for (seed, outcome) in runs(protocol, kind) {
                let excused = protocol == Protocol::WoodenHaptics
                    && matches!(
                        kind,
                        Kind::Unplugged
                            | Kind::Silent
                            | Kind::Stopped
                            | Kind::Killed
                            | Kind::Deaf
                            | Kind::BrieflyDeaf
                    );
                let failures = outcome.failures.iter();
                let failures: Vec<_> = failures
                    .filter(|text| !(excused && text.starts_with("net energy")))
                    .collect();
                assert!(
                    failures.is_empty(),
                    "{protocol}, {kind}, seed {seed}: {failures:?} in {outcome:#?}"
                );
            }
        }
    }
}

/// The runs are not empty: the hand pushes, and the faults take the force.
#[test]
fn the_faults_are_there() {
    for protocol in Protocol::ALL {
        for (seed, outcome) in runs(protocol, Kind::Nothing) {
            let [before, _] = outcome.forces;
            assert!(before > 0.3, "{protocol}, seed {seed}: {before} N");
            assert_eq!(outcome.missed, 0, "{protocol}, seed {seed}");
        }
        for (seed, outcome) in runs(protocol, Kind::Silent) {
            let host = outcome.host.expect("the host commands no force");
            // Five periods, less the age of the last state.
            assert!(host > 0.004, "{protocol}, seed {seed}: {host} s");
            assert!(outcome.missed > 40, "{protocol}, seed {seed}");
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_run() {
    let once = || run(Protocol::Stream, Kind::Corrupt, 3);
    assert_eq!(once(), once());
}
