//! The loop of the tick takes no lock, not even a free one. The assembly of all code that the loop can reach contains
//! no locked instruction and no name of a lock.
//!
//! A free lock is a single instruction. No trap of system calls, no `strace` and no sanitizer detects it; they detect
//! only the wait for a lock that is not free. This test therefore reads the code. It compiles the loop with all
//! functions that the loop calls, including those of the standard library, into one assembly file. It starts at
//! `runner::thread::body::run` and at the functions of the device, which the loop calls through a table, and follows
//! every name that a function or a table mentions.
//!
//! The search excludes:
//! - the code after a panic: the run has ended by then, and every device is commanded zero force;
//! - the code with which `rustix` finds the clock at the first reading, before the first tick (`setup`);
//! - drivers: the device is opaque here.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

/// Part of the mangled name of the loop.
const LOOP: &str = "6runner6thread4body3run";
/// Part of the mangled names of the device's functions, which the loop calls through a table that only their box names.
const DEVICE: &str = "loop_that_ticks..Port$u20$as$u20$rt_core..device..Device";
/// Parts of names at which the search ends: those of panics, and of the search for the clock.
const ENDS: [&str; 7] = [
    "panic",
    "_fail",
    "unwrap_failed",
    "expect_failed",
    "handle_error",
    "capacity_overflow",
    "13vdso_wrappers18init_clock_gettime",
];
/// Parts of the names of locks and of functions that wait for locks.
const LOCKS: [&str; 6] = ["mutex", "rwlock", "futex", "condvar", "pthread_", "parking"];

/// A function or a table of the assembly file.
#[derive(Default)]
struct Block {
    /// Names in the block.
    mentions: BTreeSet<String>,
    /// Instructions that lock the bus: every atomic read-modify-write of this processor.
    locked: Vec<String>,
}

/// Functions and tables by name. Labels inside a function (`.LBB`, `.Ltmp`, jump tables) are part of it.
fn blocks(assembly: &str) -> BTreeMap<String, Block> {
    let mut blocks: BTreeMap<String, Block> = BTreeMap::new();
    let mut name = None;
    for line in assembly.lines() {
        let line = line.split('#').next().unwrap_or_default();
        if let Some(label) = line.strip_suffix(':') {
            let inner = [
                ".LBB",
                ".Ltmp",
                ".LJTI",
                ".Lfunc",
                ".Lexception",
                ".Lttbase",
            ];
            if !inner.iter().any(|prefix| label.starts_with(prefix)) {
                name = Some(label.trim_matches('"').to_owned());
                blocks
                    .entry(label.trim_matches('"').to_owned())
                    .or_default();
            }
            continue;
        }
        let text = line.trim();
        let block = name.as_ref().and_then(|name| blocks.get_mut(name));
        // Of the directives, only those that emit an address count.
        if let Some(block) = block
            && (!text.starts_with('.') || text.starts_with(".quad"))
        {
            let operation = text.split_whitespace().next().unwrap_or_default();
            // An exchange with memory locks without the prefix.
            if operation == "lock" || (operation.starts_with("xchg") && text.contains('(')) {
                block.locked.push(text.to_owned());
            }
            let symbol = |c: char| c.is_ascii_alphanumeric() || "_.$".contains(c);
            let names = text.split(|c| !symbol(c)).filter(|name| !name.is_empty());
            block.mentions.extend(names.map(str::to_owned));
        }
    }
    blocks
}

/// The results of the search.
#[derive(Debug, Default)]
struct Found {
    reached: BTreeSet<String>,
    /// Locked instructions, with their functions.
    locked: Vec<String>,
    /// Names of locks.
    locks: BTreeSet<String>,
}

impl Found {
    fn reaches(&self, part: &str) -> bool {
        self.reached.iter().any(|name| name.contains(part))
    }
}

/// Follows every name from the loop on.
fn search(blocks: &BTreeMap<String, Block>) -> Found {
    let mut found = Found::default();
    let start = blocks.keys().filter(|name| name.contains(LOOP));
    let mut waiting: Vec<&String> = start.collect();
    assert_eq!(waiting.len(), 1, "one loop, for devices of every kind");
    let called = blocks.keys().filter(|name| name.contains(DEVICE));
    waiting.extend(called);
    while let Some(name) = waiting.pop() {
        // A name from another object ends its path. Registers are names, too.
        if ENDS.iter().any(|part| name.contains(part)) || !found.reached.insert(name.clone()) {
            continue;
        }
        if LOCKS.iter().any(|part| name.contains(part)) {
            found.locks.insert(name.clone());
        }
        if let Some(block) = blocks.get(name) {
            let locked = block.locked.iter().map(|text| format!("{name}: {text}"));
            found.locked.extend(locked);
            waiting.extend(&block.mentions);
        }
    }
    found
}

/// Compiles the loop with the versions of the workspace, and searches its assembly.
fn compiled(features: &[&str]) -> Found {
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("no_lock");
    std::fs::copy(fixture.join("../../Cargo.lock"), fixture.join("Cargo.lock"))
        .expect("the workspace's versions can be taken over");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("no_lock");
    let output = Command::new(env!("CARGO"))
        .args(["rustc", "--lib", "--release", "--offline"])
        .args(features)
        .arg("--manifest-path")
        .arg(fixture.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(&target)
        .args(["--", "--emit=asm", "-Cllvm-args=-x86-asm-syntax=att"])
        // Flags for the whole workspace (coverage, for example) would add code of their own.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .env_remove("CARGO_BUILD_TARGET")
        .output()
        .expect("cargo runs");
    assert!(
        output.status.success(),
        "the loop does not compile:\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let assembly = std::fs::read_to_string(target.join("release/deps/loop_that_ticks.s"))
        .expect("the assembly was written");
    search(&blocks(&assembly))
}

/// One test, so that the builds do not wait for each other's folder.
#[test]
fn the_loop_takes_no_lock_and_a_planted_one_is_found() {
    let found = compiled(&[]);
    // The search must reach the law, the device and the histograms.
    for part in [
        "device_read",
        "device_write",
        "7rt_core10controller10Controller7tick_at",
        "12hdrhistogram18Histogram",
        "13vdso_wrappers13CLOCK_GETTIME",
    ] {
        assert!(found.reaches(part), "{part} was not reached");
    }
    assert_eq!(found.locked, Vec::<String>::new(), "locked instructions");
    assert_eq!(found.locks, BTreeSet::new(), "names of locks");

    // A lock of the standard library, in the tick.
    let planted = compiled(&["--features", "planted_lock"]);
    assert!(!planted.locked.is_empty(), "no locked instruction");
    assert!(
        planted.locks.iter().any(|name| name.contains("mutex")),
        "{:?}",
        planted.locks
    );
    // A lock made by hand, in the device: an exchange without a lock prefix and without a name.
    let planted = compiled(&["--features", "planted_spin"]);
    assert!(
        planted.locked.iter().any(|text| text.contains("xchg")),
        "{:?}",
        planted.locked
    );
    assert_eq!(planted.locks, BTreeSet::new());
}

#[test]
fn the_assembly_is_read_as_it_is_written() {
    let text = "\
\t.section\t.text.first,\"ax\",@progbits
first:
.LBB0_1:
\tcallq\t*second@GOTPCREL(%rip)  # not third
\txchgq\t%rax, %rbx
.Lfunc_end0:
\t.size\tfirst, .Lfunc_end0-third
second:
\tlock\t\tcmpxchgq\t%rcx, held(%rip)
\txchgb\t%al, (%rdi)
.Ltable.1:
\t.quad\tfirst
";
    let blocks = blocks(text);
    assert_eq!(
        blocks.keys().collect::<Vec<_>>(),
        [".Ltable.1", "first", "second"]
    );
    assert!(blocks["first"].mentions.contains("second"));
    assert!(!blocks["first"].mentions.contains("third"));
    assert_eq!(blocks["first"].locked, Vec::<String>::new());
    assert_eq!(blocks["second"].locked.len(), 2);
    assert!(blocks[".Ltable.1"].mentions.contains("first"));
}
