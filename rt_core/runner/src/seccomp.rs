//! The system calls of the tick's thread: those named here, and no others.
//!
//! [`confine`] asks the kernel (seccomp) to trap every other call of the calling thread. The trap (`trap.rs`) notes the
//! call and refuses it. The loop sees the note at the end of the tick, commands no force and ends. The permitted calls
//! are:
//!
//! - **inside a tick**: the clock, the sleep until an absolute deadline, one wake-up of a sleeping writer thread, and
//!   under [`CallPolicy::Hid`] the calls that read a device. Writes are not permitted: each device has its own thread
//!   that writes (`devices::hid`);
//! - **at the end**: the return from a signal, and the calls of the C library when a thread ends. These calls are few
//!   and harmless, and cannot be distinguished from the same calls inside a tick;
//! - **noted, then made all the same**: memory for the heap, and text on the standard error. A refusal of memory would
//!   end the whole process with the force still on. The text tells the cause of the failure.
//!
//! The filter guards against mistakes, not against malice: it does not confine an attacker.

use crate::trap::{self, FilterError};
use libc::c_long;
use seccompiler::{
    BpfProgram, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition, SeccompFilter,
    SeccompRule, apply_filter,
};
use std::collections::BTreeMap;

/// The kind of devices that the tick calls, which determines the system calls that it needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CallPolicy {
    /// Simulated devices: the clock and the sleep suffice.
    Simulated,
    /// HID devices: `poll` and `read` as well.
    Hid,
}

/// Traps every system call of the calling thread except those of `policy`, until the thread ends. The filter cannot be
/// removed. Threads that the calling thread starts later inherit the filter.
///
/// # Errors
/// [`FilterError`] if the kernel does not take the filter. No call is then trapped.
pub fn confine(policy: CallPolicy) -> Result<(), FilterError> {
    let program = program(policy)?;
    trap::install()?;
    apply_filter(&program).map_err(|error| FilterError::Refused(error.to_string()))
}

/// The filter, compiled for this processor.
fn program(policy: CallPolicy) -> Result<BpfProgram, FilterError> {
    let refused = |error: seccompiler::BackendError| FilterError::Refused(error.to_string());
    let arch = std::env::consts::ARCH
        .try_into()
        .map_err(|_| FilterError::Platform)?;
    SeccompFilter::new(
        rules(policy).map_err(refused)?,
        SeccompAction::Trap,
        SeccompAction::Allow,
        arch,
    )
    .and_then(TryInto::try_into)
    .map_err(refused)
}

type Rules = BTreeMap<i64, Vec<SeccompRule>>;

fn rules(policy: CallPolicy) -> Result<Rules, seccompiler::BackendError> {
    let mut rules = Rules::new();
    let any = |calls: &[c_long]| {
        let each = calls.iter().map(|call| (*call, Vec::new()));
        each.collect::<Rules>()
    };
    // Inside a tick. The clock is a system call only if it cannot be read without the kernel.
    rules.extend(any(&[libc::SYS_clock_gettime]));
    if policy == CallPolicy::Hid {
        rules.extend(any(&[libc::SYS_read, libc::SYS_ppoll]));
        #[cfg(target_arch = "x86_64")]
        rules.extend(any(&[libc::SYS_poll]));
    }
    let sleep = vec![is(0, libc::CLOCK_MONOTONIC)?, is(1, libc::TIMER_ABSTIME)?];
    rules.insert(libc::SYS_clock_nanosleep, vec![SeccompRule::new(sleep)?]);
    let wake = vec![is(1, libc::FUTEX_WAKE | libc::FUTEX_PRIVATE_FLAG)?];
    rules.insert(libc::SYS_futex, vec![SeccompRule::new(wake)?]);
    // At the end of the thread.
    rules.extend(any(&[
        libc::SYS_rt_sigreturn,
        libc::SYS_rt_sigprocmask,
        libc::SYS_sigaltstack,
        libc::SYS_munmap,
        libc::SYS_madvise,
        libc::SYS_exit,
    ]));
    // The trap makes these calls, after it has noted them.
    for call in trap::MADE_ALL_THE_SAME {
        let from_the_trap = SeccompCondition::new(
            trap::MARK_ARGUMENT,
            SeccompCmpArgLen::Qword,
            SeccompCmpOp::Eq,
            trap::MARK,
        )?;
        rules.insert(call, vec![SeccompRule::new(vec![from_the_trap])?]);
    }
    Ok(rules)
}

/// The condition that an argument, an `int`, equals `value`.
fn is(argument: u8, value: libc::c_int) -> Result<SeccompCondition, seccompiler::BackendError> {
    SeccompCondition::new(
        argument,
        SeccompCmpArgLen::Dword,
        SeccompCmpOp::Eq,
        u64::from(value.unsigned_abs()),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_policy_compiles_and_a_simulated_device_may_do_less() {
        if cfg!(any(target_arch = "x86_64", target_arch = "aarch64")) {
            let simulated = rules(CallPolicy::Simulated).expect("the rules are sound");
            let hid = rules(CallPolicy::Hid).expect("the rules are sound");
            assert!(simulated.keys().all(|call| hid.contains_key(call)));
            assert!(hid.contains_key(&libc::SYS_read));
            assert!(!simulated.contains_key(&libc::SYS_read));
            for policy in [CallPolicy::Simulated, CallPolicy::Hid] {
                assert!(program(policy).is_ok_and(|program| !program.is_empty()));
            }
        }
    }
}
