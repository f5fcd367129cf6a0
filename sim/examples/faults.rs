//! Runs every fault on every protocol at random times, and prints the worst of each.
//!
//! ```sh
//! cargo run --release -p palpate-sim --example faults -- [RUNS [SEED]]
//! ```
//!
//! Default: 100 runs of each from the seed 1. Ends with an error if a run failed; each failure is printed with its seed.

use sim::faults::{Kind, Protocol, Worst, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1).map(|text| text.parse());
    let (runs, seed) = match (arguments.next(), arguments.next()) {
        (None, None) => (100, 1),
        (Some(Ok(runs)), None) => (runs, 1),
        (Some(Ok(runs)), Some(Ok(seed))) => (runs, seed),
        _ => {
            eprintln!("usage: faults [RUNS [SEED]], both whole numbers");
            return ExitCode::FAILURE;
        }
    };
    let mut failed = 0;
    println!("{}", Worst::HEAD);
    for protocol in Protocol::ALL {
        for kind in Kind::ALL {
            let mut worst = Worst::default();
            for seed in seed..seed + runs {
                let outcome = run(protocol, kind, seed);
                worst.take(&outcome);
                for failure in &outcome.failures {
                    eprintln!("{protocol}, {kind}, seed {seed}: {failure}");
                }
            }
            failed += worst.failed;
            println!("{}", worst.row(protocol, kind));
        }
    }
    if failed > 0 {
        eprintln!("{failed} runs failed");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
