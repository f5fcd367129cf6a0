//! The study of holds: its cells repeat, its limits let the body itself pass, and it finds a scheme that is not the body.

use host::scene::spec::SchemeName;
use host::study::stress::hold::draw::Kind;
use host::study::stress::hold::verdict::{Failure, failures};
use host::study::stress::hold::{CASES, CellResult, SCHEMES, Study};
use host::study::stress::scene::measure::Outcome;
use std::path::Path;

const SEED: u64 = 1;
/// The first cell that is drawn.
const FIRST: u64 = CASES.len() as u64;

fn run(cell: u64, scheme: SchemeName, name: &str) -> (CellResult, Outcome) {
    let found = Study::new(SEED).cell(cell, &[(scheme, name)]);
    assert_eq!(found.failed, None, "cell {cell}");
    let outcome = found.schemes[name];
    (found, outcome)
}

#[test]
fn a_cell_is_a_function_of_its_number() {
    let run = || {
        let found = Study::new(SEED).cell(FIRST + 1, &SCHEMES);
        serde_json::to_string(&found).expect("it is finite")
    };
    assert_eq!(run(), run());
}

#[test]
fn a_linear_hold_is_the_bodys_own_for_every_specimen() {
    for cell in FIRST..FIRST + Kind::ALL.len() as u64 {
        let (found, outcome) = run(cell, SchemeName::Linear, "linear");
        println!("{cell} {:?} {outcome:?}", found.draw);
        // The model is the body linearized where the hand rests: what is left is how the copy takes over the encoder's
        // offset, and what the smoothed path of a trembling hand is behind.
        assert!(outcome.felt.hold_error < 0.002, "cell {cell}: {outcome:?}");
        assert!(outcome.capped == 0.0, "cell {cell}");
    }
}

#[test]
fn a_scheme_that_is_not_the_body_is_found() {
    let corotational = FIRST + 1;
    // Felt through a spring: too soft.
    let (found, outcome) = run(corotational, SchemeName::Proxy, "proxy");
    assert!(failures(&found, "proxy").contains(&Failure::Hold));
    assert!(outcome.felt.hold_error > 0.05, "{outcome:?}");
    // The force of the last step, held until the next: the run is off, and on a stiff body it throws the hand about.
    let stiff = (FIRST..FIRST + 100)
        .filter(|cell| {
            let draw = Study::new(SEED).draw(*cell).expect("it is drawn");
            draw.kind == Kind::Corotational && draw.rate < 100.0
        })
        .max_by_key(|cell| {
            Study::new(SEED)
                .draw(*cell)
                .map(|draw| draw.stiffness as u64)
        });
    let (found, _) = run(stiff.expect("there is one"), SchemeName::Hold, "hold");
    let failures = failures(&found, "hold");
    assert!(failures.contains(&Failure::Run), "{failures:?}");
}

/// The quick part: the cases, and each specimen on each device. A strip that swings faster than its host publishes is
/// beyond every scheme: there `linear` is beyond the same limits, and is no measure for what is within them.
#[test]
fn capped_is_the_body_for_every_specimen_on_every_device() {
    let failing: Vec<_> = (FIRST..FIRST + 54)
        .map(|cell| (cell, Study::new(SEED).cell(cell, &SCHEMES)))
        .filter_map(|(cell, found)| {
            let without = failures(&found, "linear");
            let mut beyond = failures(&found, "capped");
            beyond.retain(|failure| {
                let unmeasured = *failure == Failure::Worse && !without.is_empty();
                !without.contains(failure) && !unmeasured
            });
            (!beyond.is_empty()).then_some((cell, found.draw.map(|draw| draw.kind), beyond))
        })
        .collect();
    assert!(failing.is_empty(), "{failing:?}");
}

#[test]
fn the_program_resumes_and_shows_one_cell_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let palpate = |arguments: &[&str], files: &[(&str, &Path)]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_palpate"));
        command.args(arguments);
        for (name, file) in files {
            command.arg(name).arg(file);
        }
        let output = command.output().expect("the program starts");
        let text = String::from_utf8(output.stdout).expect("it prints UTF-8");
        (output.status.code(), text)
    };
    // A block that passes: its cell alone, of the seventh and eighth.
    let json = path("cells.jsonl");
    let one = ["stress", "hold", "--runs", "8", "--shard", "8/8"];
    let (code, first) = palpate(&one, &[("--json", &json)]);
    assert_eq!(code, Some(0), "{first}");
    assert!(
        first.contains("| corotational block | capped | 1 | 1 |"),
        "{first}"
    );
    let written = std::fs::read(&json).expect("it was written");
    assert_eq!(palpate(&one, &[("--json", &json)]), (code, first));
    assert_eq!(written, std::fs::read(&json).expect("it is there"));

    let [plot, log, scene] = ["cell.svg", "cell.csv", "cell.toml"].map(path);
    let (code, shown) = palpate(
        &["stress", "hold", "--cell", "7", "--scheme", "linear"],
        &[("--plot", &plot), ("--log", &log), ("--scene", &scene)],
    );
    assert_eq!(code, Some(0));
    assert!(shown.contains("linear: Outcome"), "{shown}");
    let svg = std::fs::read_to_string(&plot).expect("it was drawn");
    assert!(svg.contains("own along this run"));
    // A line for each tick, and the head.
    let lines = std::fs::read_to_string(&log).expect("it was logged");
    assert_eq!(lines.lines().count(), 4001);
    // What was drawn is a scene like any other, and is judged like one.
    let (code, judged) = palpate(&["stress", "hold", scene.to_str().expect("a path")], &[]);
    assert_eq!(code, Some(0), "{judged}");
    let (code, _) = palpate(&["plan", scene.to_str().expect("a path")], &[]);
    assert_eq!(code, Some(0));
}
