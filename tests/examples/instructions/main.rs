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
//! With the argument `count`, the program runs every case once for valgrind; with `count-rings`, every passage of a
//! model through the rings ([`rings`]).

mod callgrind;
mod cases;
mod expected;
mod rings;

use callgrind::Count;
use cases::{Case, Situation};
use expected::Table;
use palpate_tests::law::{HANDLES, SCHEMES};
use rings::Passage;
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
        Some("count-rings") => pass_each(),
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

/// Runs every passage once.
fn pass_each() -> Result<(), String> {
    for passage in Passage::all() {
        if !passage.prepare().run() {
            return Err(format!("{}: the model was refused", passage.name()));
        }
    }
    Ok(())
}

/// The counts of all calls of `function`, which this program with `argument` makes once for each of `all`.
fn counted<T>(
    argument: &str,
    function: &str,
    all: impl Iterator<Item = T>,
) -> Result<Vec<(T, Count)>, String> {
    let program = std::env::current_exe().map_err(|e| format!("no path to myself: {e}"))?;
    let (counts, _) = callgrind::count(&program, argument, function)?;
    let all: Vec<T> = all.collect();
    if counts.len() != all.len() {
        return Err(format!(
            "valgrind counted {} calls of {}",
            counts.len(),
            all.len()
        ));
    }
    Ok(all.into_iter().zip(counts).collect())
}

/// Every case with its count.
fn ticks() -> Result<Vec<(Case, Count)>, String> {
    counted("count", cases::MEASURED, Case::all())
}

/// Every passage with its count.
fn passages() -> Result<Vec<(Passage, Count)>, String> {
    counted("count-rings", rings::MEASURED, Passage::all())
}

/// The counts with their names in the table.
fn named(ticks: &[(Case, Count)], passages: &[(Passage, Count)]) -> Vec<(String, Count)> {
    let ticks = ticks.iter().map(|(case, count)| (case.name(), *count));
    let passages = passages.iter().map(|(case, count)| (case.name(), *count));
    ticks.chain(passages).collect()
}

fn refresh() -> Result<(), String> {
    let (ticks, passages) = (ticks()?, passages()?);
    print_table(&ticks);
    print_passages(&passages);
    TABLE.refresh(&named(&ticks, &passages))?;
    ratios(&ticks)
}

fn compare() -> Result<(), String> {
    if !callgrind::available() {
        println!(
            "!! SKIPPED: instruction counts: valgrind is not installed (apt-get install valgrind)"
        );
        return Ok(());
    }
    let (ticks, passages) = (ticks()?, passages()?);
    print_table(&ticks);
    print_passages(&passages);
    ratios(&ticks)?;
    TABLE.judge(&named(&ticks, &passages))
}

/// Prints counts and times, one line for each scheme and number of handles.
fn print_table(counts: &[(Case, Count)]) {
    println!("One tick: instructions (+ copies of memory), then ns (median of {TIMED}, warm).\n");
    let names = Situation::ALL.map(|situation| format!(" {} |", situation.name()));
    println!("| scheme | handles |{}", names.concat());
    println!("|---|---|{}", "---|".repeat(names.len()));
    let same = |(a, _): &(Case, Count), (b, _): &(Case, Count)| {
        (a.scheme, a.handles) == (b.scheme, b.handles)
    };
    for row in counts.chunk_by(same) {
        let Some((first, _)) = row.first() else {
            continue;
        };
        let cells = Situation::ALL.map(|situation| {
            let mut each = row.iter();
            let found = each.find(|(case, _)| case.situation == situation);
            found.map_or(" |".to_owned(), |(case, count)| {
                format!(
                    " {} (+{}), {} |",
                    count.instructions,
                    count.copies,
                    nanoseconds(*case)
                )
            })
        });
        println!("| {} | {} |{}", first.scheme, first.handles, cells.concat());
    }
    println!();
}

/// Prints counts and times of the passages, one row each.
fn print_passages(counts: &[(Passage, Count)]) {
    println!("A model through the rings, by number of handles: the same.\n");
    println!("| passage | instructions (+ copies), ns |");
    println!("|---|---|");
    for (passage, count) in counts {
        println!(
            "| {} | {} (+{}), {} |",
            passage.name(),
            count.instructions,
            count.copies,
            passage_nanoseconds(*passage)
        );
    }
    println!();
}

/// Time of the passage (ns), including the clock's own.
fn passage_nanoseconds(passage: Passage) -> u128 {
    let mut ready = passage.prepare();
    // The first passages touch the pages of the log's ring, which are not mapped in advance.
    for _ in 0..20 * TIMED {
        ready.again();
        ready.run();
    }
    median(|| {
        ready.again();
        let start = Instant::now();
        ready.run();
        start.elapsed().as_nanos()
    })
}

/// The median of [`TIMED`] times.
fn median(mut time: impl FnMut() -> u128) -> u128 {
    let mut times: Vec<u128> = (0..TIMED).map(|_| time()).collect();
    times.sort_unstable();
    times.get(TIMED / 2).copied().unwrap_or_default()
}

/// Time of the tick (ns), including the clock's own.
fn nanoseconds(case: Case) -> u128 {
    let prepared = case.prepare();
    median(|| {
        let mut tick = prepared.clone();
        let start = Instant::now();
        tick.run();
        start.elapsed().as_nanos()
    })
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
