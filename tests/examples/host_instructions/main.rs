//! The cost of the host's fast step in instructions: counts show a regression that noisy times would hide.
//!
//! ```sh
//! cargo run --release -p palpate-tests --example host_instructions              # compare fourteen counts
//! cargo run --release -p palpate-tests --example host_instructions -- --all     # count every case
//! cargo run --release -p palpate-tests --example host_instructions -- --refresh # write the table anew
//! ```
//!
//! Valgrind's callgrind counts the optimized code that users run, with one exception: valgrind does not know AVX-512,
//! so functions that are compiled for several instruction sets run as their AVX2 clones. The counts are those of the
//! AVX2 code, the same on every x86-64 machine that supports it. On machines with AVX-512, users run other code. (The
//! library for factorizations blocks large matrices by the machine's caches. The factors here are too small for a
//! difference.) The program fails if a count is more than 5 % above `tests/instructions/host.toml`, which has
//! fourteen counts, one for each mechanism.
//!
//! With the argument `count` or `count-all`, the program runs these cases once for valgrind, and prints the number of
//! elements and iterations.

#[path = "../instructions/callgrind.rs"]
mod callgrind;
mod cases;
#[path = "../instructions/expected.rs"]
mod expected;

use callgrind::Count;
use cases::Prepare;
use expected::Table;
use std::error::Error;
use std::process::ExitCode;

const TABLE: Table = Table {
    file: "host.toml",
    head: "\
# What the host's fast step takes: [instructions, calls of the C library's memory copies and fills], by
# compiler and by case. AVX2 code, which is what valgrind runs. The instructions inside those copies are
# left out: they depend on the processor. Made by
#
#     cargo run --release -p palpate-tests --example host_instructions -- --refresh
#
# and compared by the same command without `--refresh`.
",
    // There are tens to thousands of copies, so one more is not significant.
    more_copies: 0.05,
};

/// The largest ratio of a step under a law of large strains to the corotational step on the same mesh. Computed point by
/// point, the singular values alone exceeded this ratio.
const MOST_OF_A_LAW: f64 = 2.0;

/// The largest ratio of a host step with an obstacle far away to the same step without it.
const MOST_OF_NOTHING_NEAR: f64 = 1.01;

/// A counted case.
struct Row {
    name: String,
    elements: usize,
    iterations: usize,
    count: Count,
}

fn main() -> ExitCode {
    let argument = std::env::args().nth(1);
    let done = match argument.as_deref() {
        None => counted("count", |counts| TABLE.judge(counts)),
        Some("--all") => counted("count-all", |_| Ok(())),
        Some("--refresh") => counted("count", |counts| TABLE.refresh(counts)),
        Some("count") => run_each(&cases::GATE).map_err(|error| error.to_string()),
        Some("count-all") => run_each(&cases::all()).map_err(|error| error.to_string()),
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

/// Runs each case once and prints, by tabs, its name, elements and iterations.
fn run_each(cases: &[(&str, Prepare)]) -> Result<(), Box<dyn Error>> {
    for (name, prepare) in cases {
        let mut case = prepare()?;
        let iterations = case.run()?;
        println!("{name}\t{}\t{iterations}", case.elements);
    }
    Ok(())
}

/// Counts the cases that this program runs with an argument, prints the counts, and passes them to `then`.
fn counted(
    argument: &str,
    then: impl FnOnce(&[(String, Count)]) -> Result<(), String>,
) -> Result<(), String> {
    if !callgrind::available() {
        println!(
            "!! SKIPPED: instruction counts: valgrind is not installed (apt-get install valgrind)"
        );
        return Ok(());
    }
    if !has_avx2() {
        println!(
            "!! SKIPPED: instruction counts: the table is of AVX2 code, this machine has none"
        );
        return Ok(());
    }
    let program = std::env::current_exe().map_err(|e| format!("no path to myself: {e}"))?;
    let (counts, said) = callgrind::count(&program, argument, cases::MEASURED)?;
    let cases = said.lines().count();
    if counts.len() != cases {
        return Err(format!(
            "valgrind counted {} calls of {cases}",
            counts.len()
        ));
    }
    let rows = said.lines().zip(counts).map(row);
    let rows = rows.collect::<Result<Vec<Row>, String>>()?;
    print_table(&rows);
    let compared = compare(&rows);
    let named: Vec<_> = rows.into_iter().map(|row| (row.name, row.count)).collect();
    then(&named)?;
    compared
}

/// Compares the steps under laws of large strains with corotational steps, and a host step with an obstacle far away with
/// the step without it.
fn compare(rows: &[Row]) -> Result<(), String> {
    let count = |name: &str| {
        let row = rows.iter().find(|row| row.name == name);
        let row = row.ok_or_else(|| format!("{name}: not counted"))?;
        Ok::<_, String>(row.count.instructions as f64)
    };
    let laws = cases::LAWS.map(|(law, corotational)| (law, corotational, MOST_OF_A_LAW));
    let [far, alone] = cases::NOTHING_NEAR;
    let mut worse = Vec::new();
    for (case, other, most) in laws.into_iter().chain([(far, alone, MOST_OF_NOTHING_NEAR)]) {
        let ratio = count(case)? / count(other)?;
        let text = format!("{case}: {ratio:.4} times \"{other}\"");
        println!("{text}");
        if ratio > most {
            worse.push(format!("{text}, at most {most} times is allowed"));
        }
    }
    println!();
    if worse.is_empty() {
        Ok(())
    } else {
        Err(worse.join("\n"))
    }
}

/// A line of [`run_each`] with its count.
fn row((line, count): (&str, Count)) -> Result<Row, String> {
    let fields: Vec<&str> = line.split('\t').collect();
    let number = |text: &str| text.parse().map_err(|e| format!("{line}: {e}"));
    let [name, elements, iterations] = fields[..] else {
        return Err(format!("{line}: not a case"));
    };
    Ok(Row {
        name: name.to_owned(),
        elements: number(elements)?,
        iterations: number(iterations)?,
        count,
    })
}

fn print_table(rows: &[Row]) {
    println!(
        "Instructions (+ copies and fills of memory) of one call, in AVX2 code: valgrind knows no AVX-512.\n"
    );
    println!("| case | instructions | per element | iterations |");
    println!("|---|---|---|---|");
    for row in rows {
        println!(
            "| {} | {} (+{}) | {:.0} | {} |",
            row.name,
            row.count.instructions,
            row.count.copies,
            row.count.instructions as f64 / row.elements as f64,
            row.iterations
        );
    }
    println!();
}

#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
}

/// On other processors no instruction set is selected at run time.
#[cfg(not(target_arch = "x86_64"))]
fn has_avx2() -> bool {
    true
}
