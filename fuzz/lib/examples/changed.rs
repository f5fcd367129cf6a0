//! Changes logs and messages at random and reads them: no panic, and bounded memory.
//!
//! `cargo run --release -p palpate-fuzz-rules --example changed -- run 1000000` reads a million inputs of each kind. The
//! counts that are printed are the same on every machine. `-- seeds` writes the seeds of the fuzzers.

use fuzz_rules::changed::Mutator;
use fuzz_rules::log::{message, play};
use fuzz_rules::sound::{messages, scene_of, small_log};
use std::error::Error;
use std::fs;
use std::path::Path;

/// Inputs from one report to the next.
const REPORT: u64 = 100_000;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["seeds"] => write_seeds()?,
        ["run", count] => run(count.parse()?, "all")?,
        ["run", count, which] => run(count.parse()?, which)?,
        _ => return Err("expected: run COUNT [log|message], or seeds".into()),
    }
    Ok(())
}

fn run(count: u64, which: &str) -> Result<(), Box<dyn Error>> {
    if !["all", "log", "message"].contains(&which) {
        return Err(format!("no kind of input has the name {which}").into());
    }
    let asked = |kind| which == kind || which == "all";
    let mut mutator = Mutator::new(1);
    if asked("log") {
        let seed = small_log()?;
        let keep = scene_of(&seed);
        report("log", count, || {
            let mut bytes = seed.clone();
            mutator.change(&mut bytes, &keep);
            play(&bytes)
        });
    }
    if asked("message") {
        let seeds = messages();
        report("message", count, || {
            let mut bytes = seeds[mutator.below(seeds.len())].clone();
            mutator.change(&mut bytes, &(0..0));
            message(&bytes)
        });
    }
    Ok(())
}

fn report(kind: &str, count: u64, mut read: impl FnMut() -> usize) {
    let mut accepted = 0;
    for done in 1..=count {
        accepted += read() as u64;
        if done % REPORT == 0 || done == count {
            let memory = most_memory().unwrap_or_else(|| "not known".into());
            println!("{kind}: {done} inputs, {accepted} accepted, most memory {memory}");
        }
    }
}

/// Most memory of this process so far.
fn most_memory() -> Option<String> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().to_owned())
}

fn write_seeds() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../seeds");
    let write = |target: &str, name: &str, bytes: &[u8]| {
        let folder = folder.join(target);
        fs::create_dir_all(&folder)?;
        fs::write(folder.join(name), bytes)
    };
    write("log_player", "small_log", &small_log()?)?;
    for bytes in messages() {
        write("view_message", &format!("kind_{}", bytes[0]), &bytes)?;
    }
    Ok(())
}
