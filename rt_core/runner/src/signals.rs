//! The signals for which a process has no handler: the signals that end the process, and those that it ignores.
//!
//! The module is unsafe, because only the C library sets the disposition of a signal.

use libc::c_int;
use std::io;

/// The signals that by default end a process, although the process could continue: requests of a person, of another
/// program or of the kernel, and the timers. The list contains neither the signals of faults (SIGSEGV, SIGABRT and
/// others), nor SIGKILL, nor SIGUSR1 and SIGUSR2, to which programs give meanings of their own.
pub fn ending() -> Vec<c_int> {
    let mut signals = vec![
        libc::SIGHUP,
        libc::SIGINT,
        libc::SIGQUIT,
        libc::SIGTERM,
        libc::SIGALRM,
        libc::SIGVTALRM,
        libc::SIGPROF,
        libc::SIGXCPU,
    ];
    #[cfg(target_os = "linux")]
    {
        signals.extend([libc::SIGIO, libc::SIGPWR, libc::SIGSTKFLT]);
        signals.extend(libc::SIGRTMIN()..=libc::SIGRTMAX());
    }
    signals
}

/// Lets the process ignore `signal`. Programs that the process starts ignore it, too.
///
/// # Errors
/// The error of the system for a number that is no signal, or that cannot be ignored.
#[allow(unsafe_code)]
pub fn ignore(signal: c_int) -> io::Result<()> {
    // SAFETY: to ignore a signal runs no code of this process.
    let before = unsafe { libc::signal(signal, libc::SIG_IGN) };
    if before == libc::SIG_ERR {
        return Err(io::Error::last_os_error());
    }
    Ok(())
}

/// Whether the process ignores `signal`; `nohup` starts a program so that it ignores SIGHUP.
#[allow(unsafe_code)]
pub fn is_ignored(signal: c_int) -> bool {
    let mut action = std::mem::MaybeUninit::<libc::sigaction>::zeroed();
    // SAFETY: without a new action the call only writes the present one, for which there is room. Zero is a valid value of
    // every field, so the action is valid even if the call fails.
    let action = unsafe {
        libc::sigaction(signal, std::ptr::null(), action.as_mut_ptr());
        action.assume_init()
    };
    action.sa_sigaction == libc::SIG_IGN
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_is_ignored_from_the_call_on_and_a_wrong_one_is_an_error() {
        // No other test of this process uses this signal.
        assert!(!is_ignored(libc::SIGURG));
        ignore(libc::SIGURG).expect("a signal that can be ignored");
        assert!(is_ignored(libc::SIGURG));
        assert!(ignore(libc::SIGKILL).is_err());
        assert!(ignore(-1).is_err());
        assert!(!is_ignored(-1));
    }

    #[test]
    fn no_fault_and_no_order_is_among_the_signals_that_end_a_process() {
        let signals = ending();
        for signal in [
            libc::SIGSEGV,
            libc::SIGABRT,
            libc::SIGKILL,
            libc::SIGSYS,
            libc::SIGUSR1,
            libc::SIGCHLD,
            libc::SIGCONT,
        ] {
            assert!(!signals.contains(&signal), "{signal}");
        }
    }

    #[test]
    fn requests_timers_and_realtime_signals_end_a_process() {
        let mut signals = ending();
        for signal in [
            libc::SIGHUP,
            libc::SIGINT,
            libc::SIGQUIT,
            libc::SIGTERM,
            libc::SIGALRM,
            libc::SIGVTALRM,
            libc::SIGPROF,
            libc::SIGXCPU,
        ] {
            assert!(signals.contains(&signal), "{signal}");
        }
        #[cfg(target_os = "linux")]
        assert!((libc::SIGRTMIN()..=libc::SIGRTMAX()).all(|signal| signals.contains(&signal)));
        let count = signals.len();
        signals.sort_unstable();
        signals.dedup();
        assert_eq!(signals.len(), count, "each once");
    }
}
