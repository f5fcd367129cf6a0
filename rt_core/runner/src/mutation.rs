//! What must never happen inside a tick, made to happen: to show that each check can fail.
//!
//! Compiled under the feature `mutations` only. `PALPATE_MUTATION` names the one that strikes, from tick
//! [`FIRST`] on; `tests/mutate` runs each against the check meant for it.

use crate::clock::now_ns;
use std::hint::black_box;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

/// The first tick that is struck.
const FIRST: u64 = 100;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mutation {
    None,
    /// Allocates and frees.
    Box,
    /// Takes a lock that somebody else holds most of the time.
    Lock,
    /// Panics, once.
    Panic,
    /// Makes a system call that the C library knows nothing of.
    Syscall,
    /// Works for 50 us more.
    Spin,
}

static CHOSEN: OnceLock<Mutation> = OnceLock::new();
static LOCK: Mutex<()> = Mutex::new(());

/// Reads the choice, before the first tick.
///
/// # Panics
/// On a name that is none of ours: a check that tests nothing must not pass.
pub(crate) fn arm() {
    CHOSEN.get_or_init(|| {
        let name = std::env::var("PALPATE_MUTATION").unwrap_or_default();
        match name.as_str() {
            "" => Mutation::None,
            "box" => Mutation::Box,
            "lock" => {
                // Ends with the process.
                std::thread::spawn(hold_the_lock);
                Mutation::Lock
            }
            "panic" => Mutation::Panic,
            "syscall" => Mutation::Syscall,
            "spin" => Mutation::Spin,
            other => panic!(
                "PALPATE_MUTATION: found {other:?}, allowed: box, lock, panic, syscall, spin"
            ),
        }
    });
}

fn hold_the_lock() {
    loop {
        let held = LOCK.lock().unwrap_or_else(PoisonError::into_inner);
        std::thread::sleep(Duration::from_millis(3));
        drop(held);
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Does it, in tick number `tick`.
pub(crate) fn strike(tick: u64) {
    if tick < FIRST {
        return;
    }
    match CHOSEN.get() {
        None | Some(Mutation::None) => {}
        Some(Mutation::Box) => drop(black_box(Box::new(tick))),
        Some(Mutation::Lock) => drop(LOCK.lock().unwrap_or_else(PoisonError::into_inner)),
        Some(Mutation::Panic) => assert_ne!(tick, FIRST, "a mutation"),
        Some(Mutation::Syscall) => {
            black_box(rustix::process::getppid());
        }
        Some(Mutation::Spin) => {
            let end = now_ns() + 50_000;
            while now_ns() < end {
                std::hint::spin_loop();
            }
        }
    }
}
