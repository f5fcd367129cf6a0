//! Faults on every protocol, in virtual time: the short form of `palpate stress connections`.

use sim::emulated::fault::Kind;
use sim::protocol::Protocol;
use study::stress::connections::run::{Outcome, run};

/// The first of the seeds.
const SEED: u64 = 100;
/// Runs of each fault on each protocol: 320 in all. `palpate stress connections --runs 1250` makes 100,000.
const RUNS: u64 = 4;

fn runs(protocol: Protocol, kind: Kind) -> impl Iterator<Item = (u64, Outcome)> {
    (SEED..SEED + RUNS).map(move |seed| (seed, run(protocol, kind, seed)))
}

/// Every fault, order and delay on one protocol: the force ends in time, returns without a step, and gives no energy. The
/// runs read the force that the motors of the emulated device make.
fn no_force_stays_or_comes_in_a_step(protocol: Protocol) {
    for kind in Kind::ALL {
        for (seed, outcome) in runs(protocol, kind) {
            // The motors of WoodenHaptics hold their currents for half a second after a cut: what its hand is given then,
            // no host can prevent.
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

#[test]
fn no_force_stays_or_comes_in_a_step_over_hid() {
    no_force_stays_or_comes_in_a_step(Protocol::Reports);
}

#[test]
fn no_force_stays_or_comes_in_a_step_over_a_stream() {
    no_force_stays_or_comes_in_a_step(Protocol::Stream);
}

#[test]
fn no_force_stays_or_comes_in_a_step_on_woodenhaptics() {
    no_force_stays_or_comes_in_a_step(Protocol::WoodenHaptics);
}

#[test]
fn no_force_stays_or_comes_in_a_step_on_a_falcon() {
    no_force_stays_or_comes_in_a_step(Protocol::Falcon);
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
