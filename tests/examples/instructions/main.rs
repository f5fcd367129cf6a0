//! The cost of one tick of the control law, in instructions and in time, at best and at worst:
//!
//! ```sh
//! cargo run --release -p palpate-tests --example instructions              # compare
//! cargo run --release -p palpate-tests --example instructions -- --refresh # write the table anew
//! ```
//!
//! Valgrind's callgrind counts the optimized code that users run. The program fails where a count is more than 5 %
//! above `tests/instructions/expected.toml`, or where the most expensive tick of a scheme takes more than
//! [`MOST_RATIO`] times the instructions of the cheapest. Times are printed beside the counts, without a limit.
//!
//! With the argument `count`, the program runs every case once for valgrind.

mod callgrind;
mod cases;
mod expected;

use callgrind::Count;
use cases::{Case, Situation};
use expected::Table;
use palpate_tests::law::{HANDLES, SCHEMES};
use std::process::ExitCode;
use std::time::Instant;

/// Largest ratio of the most expensive tick to the cheapest. Every loop of the law runs over all handles of the body,
/// whatever the numbers, so there is a most expensive tick: the tick that accepts a model during a blend. It evaluates
/// a linear model five times where the cheapest tick does so once (both models of a blend before the change and after
/// it, and the old model at the new reference). It checks the new model, and first mixes the two old ones. The rest of
/// the tick is done once in both. The ratio is therefore slightly above five.
const MOST_RATIO: f64 = 6.0;
const TABLE: Table = Table {
    file: "expected.toml",
    head: "\
# What one tick of the control law takes: [instructions, calls of the C library's memory copies], by
# compiler and by case (scheme, handles, situation). The instructions inside those copies are left out:
# they depend on the processor. Made by
#
#     cargo run --release -p palpate-tests --example instructions -- --refresh
#
# and compared by the same command without `--refresh`.
",
    // The law makes so few copies that each has been examined.
    more_copies: 0.0,
};
/// Number of times each tick is timed.
const TIMED: usize = 301;

fn main() -> ExitCode {
    let argument = std::env::args().nth(1);
    let done = match argument.as_deref() {
        None => compare(),
        Some("--refresh") => refresh(),
        Some("count") => run_each(),
        Some(other) => Err(format!("found {other}, allowed: --refresh")),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

/// Runs every case once.
fn run_each() -> Result<(), String> {
    for case in Case::all() {
        let mut prepared = case.prepare();
        let telemetry = prepared.run();
        if !prepared.met(case.situation, &telemetry) {
            return Err(format!(
                "{}: the tick met another situation: {telemetry:?}",
                case.name()
            ));
        }
    }
    Ok(())
}

/// Every case with its count.
fn counted() -> Result<Vec<(Case, Count)>, String> {
    let program = std::env::current_exe().map_err(|e| format!("no path to myself: {e}"))?;
    let (counts, _) = callgrind::count(&program, "count", cases::MEASURED)?;
    let cases: Vec<Case> = Case::all().collect();
    if counts.len() != cases.len() {
        return Err(format!(
            "valgrind counted {} ticks of {}",
            counts.len(),
            cases.len()
        ));
    }
    Ok(cases.into_iter().zip(counts).collect())
}

/// The counts with their names in the table.
fn named(counts: &[(Case, Count)]) -> Vec<(String, Count)> {
    counts
        .iter()
        .map(|(case, count)| (case.name(), *count))
        .collect()
}

fn refresh() -> Result<(), String> {
    let counts = counted()?;
    print_table(&counts);
    TABLE.refresh(&named(&counts))?;
    ratios(&counts)
}

fn compare() -> Result<(), String> {
    if !callgrind::available() {
        println!(
            "!! SKIPPED: instruction counts: valgrind is not installed (apt-get install valgrind)"
        );
        return Ok(());
    }
    let counts = counted()?;
    print_table(&counts);
    ratios(&counts)?;
    TABLE.judge(&named(&counts))
}

/// Prints counts and times, one line for each scheme and number of handles.
fn print_table(counts: &[(Case, Count)]) {
    println!("One tick: instructions (+ copies of memory), then ns (median of {TIMED}, warm).\n");
    let names = Situation::ALL.map(|situation| format!(" {} |", situation.name()));
    println!("| scheme | handles |{}", names.concat());
    println!("|---|---|{}", "---|".repeat(names.len()));
    for row in counts.chunks(Situation::ALL.len()) {
        let Some((first, _)) = row.first() else {
            continue;
        };
        let cells = row.iter().map(|(case, count)| {
            format!(
                " {} (+{}), {} |",
                count.instructions,
                count.copies,
                nanoseconds(*case)
            )
        });
        println!(
            "| {} | {} |{}",
            first.scheme,
            first.handles,
            cells.collect::<String>()
        );
    }
    println!();
}

/// Time of the tick (ns), including the clock's own.
fn nanoseconds(case: Case) -> u128 {
    let prepared = case.prepare();
    let mut times: Vec<u128> = (0..TIMED)
        .map(|_| {
            let mut tick = prepared.clone();
            let start = Instant::now();
            tick.run();
            start.elapsed().as_nanos()
        })
        .collect();
    times.sort_unstable();
    times.get(TIMED / 2).copied().unwrap_or_default()
}

/// Prints the ratio of the most expensive tick to the cheapest.
fn ratios(counts: &[(Case, Count)]) -> Result<(), String> {
    for (scheme, handles) in SCHEMES
        .into_iter()
        .flat_map(|scheme| HANDLES.map(|handles| (scheme, handles)))
    {
        let all = counts
            .iter()
            .filter(|(case, _)| case.scheme == scheme && case.handles == handles);
        let instructions = all.map(|(_, count)| count.instructions);
        let best = instructions.clone().min().unwrap_or_default();
        let worst = instructions.max().unwrap_or_default();
        let ratio = worst as f64 / best as f64;
        println!("{scheme}, {handles}: worst {worst}, best {best}, ratio {ratio:.1}");
        if best == 0 || ratio > MOST_RATIO {
            return Err(format!("the ratio is above {MOST_RATIO}"));
        }
    }
    Ok(())
}
