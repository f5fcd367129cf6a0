//! Faults that must never happen inside a tick. Each is injected to show that its check can fail.
//!
//! The module is compiled under the feature `mutations` only. `PALPATE_MUTATION` names the fault, which strikes from
//! tick [`FIRST`] on. `tests/mutate` runs each fault against the check that should find it.

use crate::clock::now_ns;
use std::hint::black_box;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

/// The first tick that the fault strikes.
const FIRST: u64 = 100;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mutation {
    None,
    /// Allocates and frees.
    Box,
    /// Takes a lock that another thread holds most of the time.
    Lock,
    /// Panics, once.
    Panic,
    /// Makes a system call without the C library.
    Syscall,
    /// Works for 50 us more.
    Spin,
}

static CHOSEN: OnceLock<Mutation> = OnceLock::new();
static LOCK: Mutex<()> = Mutex::new(());

/// Reads the chosen fault, before the first tick.
///
/// # Panics
/// On an unknown name: a check that tests nothing must not pass.
pub(crate) fn arm() {
    CHOSEN.get_or_init(|| {
        let name = std::env::var("PALPATE_MUTATION").unwrap_or_default();
        match name.as_str() {
            "" => Mutation::None,
            "box" => Mutation::Box,
            "lock" => {
                // The thread ends with the process.
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

/// Injects the chosen fault in tick number `tick`.
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
