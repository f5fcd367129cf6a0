//! The cost of one tick of the control law, in instructions and in time, at best and at worst:
//!
//! ```sh
//! cargo run --release -p palpate-tests --example instructions              # compare the counts of the table
//! cargo run --release -p palpate-tests --example instructions -- --all     # count every case
//! cargo run --release -p palpate-tests --example instructions -- --refresh # write the table anew
//! ```
//!
//! Valgrind's callgrind counts the optimized code that users run. The program fails if a count is more than 5 % above
//! `tests/instructions/expected.toml`, or if the most expensive tick of a scheme takes more than [`MOST_RATIO`] times the
//! instructions of the cheapest. The table has one count for each mechanism ([`cases::GATE`], [`rings::GATE`], [`touches::GATE`]):
//! the other cases run the same loops over other numbers of handles. Times are printed beside the counts, without a
//! limit.
//!
//! With the argument `count` or `count-all`, the program runs these ticks once for valgrind; with `count-rings` or
//! `count-all-rings`, these passages of a model through the rings ([`rings`]); with `count-touches`, these ticks of a tool
//! ([`touches`]).

mod callgrind;
mod cases;
mod expected;
mod rings;
mod touches;

use callgrind::Count;
use cases::{Case, Situation};
use expected::Table;
use rings::Passage;
use std::fmt::Write;
use std::process::ExitCode;
use std::time::Instant;
use touches::Touch;

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
        None => counted(false, |counts| TABLE.judge(counts)),
        Some("--all") => counted(true, |_| Ok(())),
        Some("--refresh") => counted(false, |counts| TABLE.refresh(counts)),
        Some("count") => run_each(Case::chosen(false)),
        Some("count-all") => run_each(Case::chosen(true)),
        Some("count-rings") => pass_each(Passage::chosen(false)),
        Some("count-all-rings") => pass_each(Passage::chosen(true)),
        Some("count-touches") => touch_each(),
        Some(other) => Err(format!("found {other}, allowed: --all, --refresh")),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

/// Runs each case once.
fn run_each(cases: Vec<Case>) -> Result<(), String> {
    for case in cases {
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

/// Runs each passage once.
fn pass_each(passages: Vec<Passage>) -> Result<(), String> {
    for passage in passages {
        if !passage.prepare().run() {
            return Err(format!("{}: the model was refused", passage.name()));
        }
    }
    Ok(())
}

/// Runs each tick of a tool once.
fn touch_each() -> Result<(), String> {
    let mut others = String::new();
    for touch in touches::GATE {
        let mut touching = touch.prepare();
        if !touching.run() {
            let _ = writeln!(
                others,
                "{}: found {} contacts",
                touch.name(),
                touching.contacts()
            );
        }
    }
    if others.is_empty() {
        Ok(())
    } else {
        Err(others)
    }
}

/// The counts of all calls of `function`, which this program with `argument` makes once for each of `all`.
fn calls<T>(argument: &str, function: &str, all: Vec<T>) -> Result<Vec<(T, Count)>, String> {
    let program = std::env::current_exe().map_err(|e| format!("no path to myself: {e}"))?;
    let (counts, _) = callgrind::count(&program, argument, function)?;
    if counts.len() != all.len() {
        return Err(format!(
            "valgrind counted {} calls of {}",
            counts.len(),
            all.len()
        ));
    }
    Ok(all.into_iter().zip(counts).collect())
}

/// Counts the chosen cases or all, prints the counts, and passes them with their names to `then`.
fn counted(
    all: bool,
    then: impl FnOnce(&[(String, Count)]) -> Result<(), String>,
) -> Result<(), String> {
    if !callgrind::available() {
        println!(
            "!! SKIPPED: instruction counts: valgrind is not installed (apt-get install valgrind)"
        );
        return Ok(());
    }
    let [count, count_rings] = if all {
        ["count-all", "count-all-rings"]
    } else {
        ["count", "count-rings"]
    };
    let ticks = calls(count, cases::MEASURED, Case::chosen(all))?;
    let passages = calls(count_rings, rings::MEASURED, Passage::chosen(all))?;
    let touches = calls("count-touches", touches::MEASURED, touches::GATE.into())?;
    print_table(&ticks);
    print_passages(&passages);
    print_touches(&touches);
    ratios(&ticks)?;
    let ticks = ticks.iter().map(|(case, count)| (case.name(), *count));
    let passages = passages.iter().map(|(case, count)| (case.name(), *count));
    let touches = touches.iter().map(|(case, count)| (case.name(), *count));
    let named: Vec<_> = ticks.chain(passages).chain(touches).collect();
    then(&named)
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

/// Prints counts and times of the ticks of a tool, one row each.
fn print_touches(counts: &[(Touch, Count)]) {
    println!("A tick of a tool, by number of contacts: the same.\n");
    println!("| tick | instructions (+ copies), ns |");
    println!("|---|---|");
    for (touch, count) in counts {
        println!(
            "| {} | {} (+{}), {} |",
            touch.name(),
            count.instructions,
            count.copies,
            touch_nanoseconds(*touch)
        );
    }
    println!();
}

/// Time of the tick of a tool (ns), including the clock's own.
fn touch_nanoseconds(touch: Touch) -> u128 {
    let touching = touch.prepare();
    median(|| {
        let mut tick = touching.clone();
        let start = Instant::now();
        tick.run();
        start.elapsed().as_nanos()
    })
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

/// Prints the ratio of the most expensive tick to the cheapest, for each scheme and number of handles with several ticks.
fn ratios(counts: &[(Case, Count)]) -> Result<(), String> {
    let same = |(a, _): &(Case, Count), (b, _): &(Case, Count)| {
        (a.scheme, a.handles) == (b.scheme, b.handles)
    };
    for row in counts.chunk_by(same).filter(|row| row.len() > 1) {
        let Some((
            Case {
                scheme, handles, ..
            },
            _,
        )) = row.first()
        else {
            continue;
        };
        let instructions = row.iter().map(|(_, count)| count.instructions);
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
