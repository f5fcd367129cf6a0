//! The response to a forbidden system call of the tick's thread.
//!
//! The kernel skips the call and sends the thread SIGSYS instead (`seccomp.rs`). The handler notes the call in
//! the thread's own memory and answers EPERM. For the few calls in `MADE_ALL_THE_SAME`, the handler makes the call with
//! a mark that the filter knows. The handler does nothing else, because a handler must not allocate or lock either.
//!
//! The module is unsafe, because it reads and answers the call in the registers that the kernel saved.

use std::fmt;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};

/// A system call that the tick's thread made without permission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForbiddenCall {
    /// The first forbidden call, by the kernel's number on this architecture.
    pub number: i64,
    /// Number of forbidden calls until the loop ended.
    pub count: u64,
}

impl fmt::Display for ForbiddenCall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match name(self.number) {
            Some(name) => write!(f, "{name} (number {})", self.number)?,
            None => write!(f, "number {}", self.number)?,
        }
        if self.count > 1 {
            write!(f, ", the first of {}", self.count)?;
        }
        Ok(())
    }
}

/// The reason why the kernel does not watch the thread's system calls.
#[derive(Debug, thiserror::Error)]
pub enum FilterError {
    /// There is no trap for this processor or C library.
    #[error(
        "system calls can be watched on x86-64 and 64-bit Arm Linux with the GNU C library only"
    )]
    Platform,
    /// The signal that reports a forbidden call is not available.
    #[error("the system did not give the signal SIGSYS: {0}")]
    Signal(std::io::Error),
    /// The system refused the filter.
    #[error(
        "the system refused the filter of system calls ({0}); the kernel needs CONFIG_SECCOMP_FILTER"
    )]
    Refused(String),
}

/// Calls that are noted and then made: memory for the heap, and text on the standard error.
pub(crate) const MADE_ALL_THE_SAME: [i64; 5] = [
    libc::SYS_brk,
    libc::SYS_mmap,
    libc::SYS_mprotect,
    libc::SYS_mremap,
    libc::SYS_write,
];

/// The last argument of such a call when the trap makes it. None of the calls reads it: five have fewer arguments, and
/// memory without a file has no offset. The mark is still a multiple of any page size.
pub(crate) const MARK: u64 = 0x7061_6c70_0000;

/// Position of the mark among the arguments, from zero.
pub(crate) const MARK_ARGUMENT: u8 = 5;

thread_local! {
    /// The first forbidden call of this thread. The cell has no destructor and is constructed in place, so that a
    /// signal handler may touch it.
    static FIRST: AtomicI64 = const { AtomicI64::new(0) };
    static COUNT: AtomicU64 = const { AtomicU64::new(0) };
}

/// Whether this thread made a forbidden call since [`clear`]. For the hot path: one load.
pub(crate) fn noted() -> bool {
    COUNT.with(|count| count.load(Ordering::Relaxed)) > 0
}

/// The first forbidden call since [`clear`], and the number of calls.
pub(crate) fn first() -> Option<ForbiddenCall> {
    noted().then(|| ForbiddenCall {
        number: FIRST.with(|first| first.load(Ordering::Relaxed)),
        count: COUNT.with(|count| count.load(Ordering::Relaxed)),
    })
}

/// Forgets the forbidden calls of this thread so far.
pub(crate) fn clear() {
    COUNT.with(|count| count.store(0, Ordering::Relaxed));
}

fn note(number: i64) {
    COUNT.with(|count| {
        if count.fetch_add(1, Ordering::Relaxed) == 0 {
            FIRST.with(|first| first.store(number, Ordering::Relaxed));
        }
    });
}

/// Names of the calls that most easily get into a tick by mistake. Other calls are reported by number.
fn name(number: i64) -> Option<&'static str> {
    let names = [
        (libc::SYS_brk, "brk"),
        (libc::SYS_clock_nanosleep, "clock_nanosleep"),
        (libc::SYS_close, "close"),
        (libc::SYS_fdatasync, "fdatasync"),
        (libc::SYS_fsync, "fsync"),
        (libc::SYS_futex, "futex"),
        (libc::SYS_getpid, "getpid"),
        (libc::SYS_getppid, "getppid"),
        (libc::SYS_getrandom, "getrandom"),
        (libc::SYS_gettid, "gettid"),
        (libc::SYS_ioctl, "ioctl"),
        (libc::SYS_lseek, "lseek"),
        (libc::SYS_mmap, "mmap"),
        (libc::SYS_mprotect, "mprotect"),
        (libc::SYS_mremap, "mremap"),
        (libc::SYS_nanosleep, "nanosleep"),
        (libc::SYS_openat, "openat"),
        (libc::SYS_ppoll, "ppoll"),
        (libc::SYS_read, "read"),
        (libc::SYS_recvfrom, "recvfrom"),
        (libc::SYS_sched_yield, "sched_yield"),
        (libc::SYS_sendto, "sendto"),
        (libc::SYS_write, "write"),
        (libc::SYS_writev, "writev"),
    ];
    let found = names.iter().find(|(known, _)| *known == number);
    found.map(|(_, name)| *name)
}

#[cfg(all(
    target_env = "gnu",
    any(target_arch = "x86_64", target_arch = "aarch64")
))]
pub(crate) use handler::install;

/// On other platforms there is no trap.
#[cfg(not(all(
    target_env = "gnu",
    any(target_arch = "x86_64", target_arch = "aarch64")
)))]
pub(crate) fn install() -> Result<(), FilterError> {
    Err(FilterError::Platform)
}

#[cfg(all(
    target_env = "gnu",
    any(target_arch = "x86_64", target_arch = "aarch64")
))]
#[allow(unsafe_code)]
mod handler {
    use super::{FilterError, MADE_ALL_THE_SAME, MARK, note};
    use libc::{c_int, c_long, c_void, siginfo_t, ucontext_t};
    use std::mem::MaybeUninit;
    use std::ptr::null_mut;

    /// Installs the handler for SIGSYS in the process, if nothing else uses that signal. May be repeated.
    pub(crate) fn install() -> Result<(), FilterError> {
        // SAFETY: zero is a valid value of every field: no flags, an empty mask.
        let mut action = unsafe { MaybeUninit::<libc::sigaction>::zeroed().assume_init() };
        action.sa_flags = libc::SA_SIGINFO;
        action.sa_sigaction = on_trap as extern "C" fn(_, _, _) as usize;
        // SAFETY: the action lives through the call, and its handler for ever. The handler is safe to run at any
        // moment: it touches only the thread's own atomics, errno, and the arguments from the kernel.
        let result = unsafe { libc::sigaction(libc::SIGSYS, &raw const action, null_mut()) };
        if result == 0 {
            Ok(())
        } else {
            Err(FilterError::Signal(std::io::Error::last_os_error()))
        }
    }

    extern "C" fn on_trap(_signal: c_int, _info: *mut siginfo_t, context: *mut c_void) {
        // SAFETY: with SA_SIGINFO the kernel hands the handler its own, exclusive ucontext.
        let context = unsafe { &mut *context.cast::<ucontext_t>() };
        let (number, arguments) = asked(context);
        note(number);
        answer(context, result(number, arguments));
    }

    /// The kernel's answer to the call: minus an error number if the call failed.
    fn result(number: i64, arguments: [i64; 6]) -> i64 {
        const REFUSED: i64 = -(libc::EPERM as i64);
        let [a, b, c, d, e, _] = arguments;
        let passes = match number {
            // With a file, the mark would be an offset into it.
            libc::SYS_mmap => d & i64::from(libc::MAP_ANONYMOUS) != 0,
            libc::SYS_write => a == i64::from(libc::STDERR_FILENO),
            _ => MADE_ALL_THE_SAME.contains(&number),
        };
        if !passes {
            return REFUSED;
        }
        // SAFETY: this thread asked for this very call and waits for its answer. Only an argument that the call does
        // not read differs. errno belongs to this thread and always exists. It is restored, because the interrupted
        // code does not expect a change.
        unsafe {
            let errno = libc::__errno_location();
            let before = *errno;
            let result: c_long = libc::syscall(number, a, b, c, d, e, MARK);
            let failed = -c_long::from(*errno);
            *errno = before;
            if result == -1 { failed } else { result }
        }
    }

    #[cfg(target_arch = "x86_64")]
    fn asked(context: &ucontext_t) -> (i64, [i64; 6]) {
        use libc::{REG_R8, REG_R9, REG_R10, REG_RAX, REG_RDI, REG_RDX, REG_RSI};
        let at = |register: c_int| context.uc_mcontext.gregs[register as usize];
        let arguments = [REG_RDI, REG_RSI, REG_RDX, REG_R10, REG_R8, REG_R9];
        (at(REG_RAX), arguments.map(at))
    }

    #[cfg(target_arch = "x86_64")]
    fn answer(context: &mut ucontext_t, result: i64) {
        context.uc_mcontext.gregs[libc::REG_RAX as usize] = result;
    }

    #[cfg(target_arch = "aarch64")]
    fn asked(context: &ucontext_t) -> (i64, [i64; 6]) {
        let at = |register: usize| context.uc_mcontext.regs[register] as i64;
        (at(8), [0, 1, 2, 3, 4, 5].map(at))
    }

    #[cfg(target_arch = "aarch64")]
    fn answer(context: &mut ucontext_t, result: i64) {
        context.uc_mcontext.regs[0] = result as u64;
    }

    #[cfg(test)]
    mod tests {
        use super::*;
        use std::os::fd::AsRawFd as _;

        #[test]
        fn only_memory_and_text_on_the_standard_error_are_given() {
            let refused = -i64::from(libc::EPERM);
            let null = std::fs::File::open("/dev/zero").expect("a file");
            let file = i64::from(null.as_raw_fd());
            let page = 4096;
            let (read, private) = (i64::from(libc::PROT_READ), i64::from(libc::MAP_PRIVATE));
            let anonymous = private | i64::from(libc::MAP_ANONYMOUS);
            let map = |flags, file| result(libc::SYS_mmap, [0, page, read, flags, file, 0]);
            assert_eq!(map(private, file), refused);
            let address = map(anonymous, -1);
            assert!(address > 0 && address % page == 0, "{address}");
            assert!(result(libc::SYS_brk, [0; 6]) > 0);
            let write = |file| result(libc::SYS_write, [file, 0, 0, 0, 0, 0]);
            assert_eq!(write(i64::from(libc::STDERR_FILENO)), 0);
            assert_eq!(write(i64::from(libc::STDOUT_FILENO)), refused);
            assert_eq!(write(file), refused);
            assert_eq!(result(libc::SYS_getppid, [0; 6]), refused);
        }

        #[test]
        fn the_answer_to_a_call_that_fails_is_its_error_number_and_errno_stays() {
            // An access to a missing file sets this thread's errno.
            assert!(std::fs::File::open("/no such file").is_err());
            let before = std::io::Error::last_os_error().raw_os_error();
            // The address is not that of a page.
            let failed = result(libc::SYS_mprotect, [1, 4096, 0, 0, 0, 0]);
            assert_eq!(failed, -i64::from(libc::EINVAL));
            assert_eq!(before, Some(libc::ENOENT));
            assert_eq!(std::io::Error::last_os_error().raw_os_error(), before);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_is_named_with_its_number() {
        let one = ForbiddenCall {
            number: libc::SYS_openat,
            count: 1,
        };
        let number = libc::SYS_openat;
        assert_eq!(one.to_string(), format!("openat (number {number})"));
        let unknown = ForbiddenCall {
            number: 99_999,
            count: 3,
        };
        assert_eq!(unknown.to_string(), "number 99999, the first of 3");
    }

    #[test]
    fn the_first_call_since_the_last_clear_is_noted_with_the_number_of_calls() {
        assert!(!noted());
        assert_eq!(first(), None);
        for (number, count) in [(7, 1), (9, 2)] {
            for _ in 0..count {
                note(number);
                note(number + 1);
            }
            assert!(noted());
            let expected = ForbiddenCall {
                number,
                count: 2 * count,
            };
            assert_eq!(first(), Some(expected));
            clear();
            assert!(!noted() && first().is_none());
        }
        // Another thread has notes of its own.
        note(3);
        assert!(std::thread::spawn(|| !noted()).join().expect("no panic"));
    }
}
