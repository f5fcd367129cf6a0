//! Memory that the tick can access without a wait.
//!
//! A page that was never touched, or that was swapped out, costs a tick between a microsecond and many milliseconds.
//! Before the first tick, the loop's own memory is therefore touched and, if the system allows, locked: the thread's
//! stack, the loop's state (controller and devices) and the rings. The code and the pages of the shared allocator are
//! not locked: the loop does not allocate.
//!
//! Nothing here belongs on the hot path. Unsafe code is in this module and in the trap of forbidden system calls
//! (`trap`), nowhere else.

use rustix::process::{Resource, getrlimit};
use std::ffi::c_void;
use std::hint::black_box;

/// Bytes of the tick thread's stack that are touched and locked ahead. A tick needs some tens of KB (a local model
/// alone takes ten, and a change of model holds several).
pub const STACK_AHEAD: usize = 256 * 1024;

/// A stretch of memory, by address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryRange {
    address: usize,
    bytes: usize,
}

impl MemoryRange {
    /// The memory of a value, without the memory that the value points to.
    pub fn of<T: ?Sized>(value: &T) -> Self {
        Self {
            address: std::ptr::from_ref(value).addr(),
            bytes: size_of_val(value),
        }
    }

    /// Length of the range in bytes.
    pub fn bytes(&self) -> usize {
        self.bytes
    }
}

/// The reason why memory could not be locked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LockError {
    /// The request exceeds the limit of an unprivileged process.
    #[error(
        "{wanted} bytes more are needed, and the limit is {limit} bytes in all (RLIMIT_MEMLOCK)"
    )]
    Limit {
        /// Bytes asked for.
        wanted: usize,
        /// Largest amount that the process may lock in all (bytes).
        limit: u64,
    },
    /// The system refused for another reason.
    #[error("the system refused to lock {wanted} bytes (error {errno})")]
    Refused {
        /// Bytes asked for.
        wanted: usize,
        /// The system's error number.
        errno: i32,
    },
}

/// Locked memory, which is unlocked when this value is dropped.
#[derive(Debug, Default)]
pub struct LockedMemory {
    ranges: Vec<MemoryRange>,
}

impl LockedMemory {
    /// Nothing locked yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Locks `range` in addition, rounded to whole pages. The memory must stay in place for as long as it is to be
    /// locked; freeing it earlier is harmless.
    ///
    /// # Errors
    /// [`LockError`] if the system refuses. Ranges that were locked before stay locked.
    #[allow(unsafe_code)]
    pub fn lock(&mut self, range: MemoryRange) -> Result<(), LockError> {
        if range.bytes == 0 {
            return Ok(());
        }
        let address = std::ptr::without_provenance_mut::<c_void>(range.address);
        // SAFETY: locking changes neither the content nor the access of the pages, whoever owns them. The kernel
        // refuses addresses that are not mapped. Nothing is read or written through the pointer.
        let locked = unsafe { rustix::mm::mlock(address, range.bytes) };
        match locked {
            Ok(()) => {
                self.ranges.push(range);
                Ok(())
            }
            Err(errno) => {
                let limit = getrlimit(Resource::Memlock).current;
                Err(reason(range.bytes, errno, limit))
            }
        }
    }

    /// Touches [`STACK_AHEAD`] bytes of the calling thread's stack below the caller, then locks them. The bytes stay
    /// touched even if the system refuses the lock. Call this function from the thread that will tick, near the frame
    /// that will run the loop.
    ///
    /// # Errors
    /// [`LockError`] if the system refuses.
    pub(crate) fn lock_stack(&mut self) -> Result<(), LockError> {
        with_stack_ahead(|stack| self.lock(stack))
    }

    /// Bytes locked, as asked for (the system rounds each range to whole pages).
    pub fn bytes(&self) -> usize {
        self.ranges.iter().map(MemoryRange::bytes).sum()
    }
}

impl Drop for LockedMemory {
    #[allow(unsafe_code)]
    fn drop(&mut self) {
        for range in &self.ranges {
            let address = std::ptr::without_provenance_mut::<c_void>(range.address);
            // SAFETY: as for locking. If the memory has been freed meanwhile, the call fails or unlocks pages of
            // another owner, who at worst waits for these pages again.
            let _ = unsafe { rustix::mm::munlock(address, range.bytes) };
        }
    }
}

/// Touches the calling thread's stack ahead without locking it.
pub(crate) fn touch_stack() {
    with_stack_ahead(|_| ());
}

/// Writes [`STACK_AHEAD`] bytes of stack, so that the pages are mapped, and passes their range to `see`. The frame is
/// gone when the loop runs; the pages below the caller's frame remain mapped.
#[inline(never)]
#[allow(
    clippy::large_stack_arrays,
    reason = "a large piece of stack is the whole point"
)]
fn with_stack_ahead<R>(see: impl FnOnce(MemoryRange) -> R) -> R {
    let mut stack = [0_u8; STACK_AHEAD];
    // No code reads the array, and the compiler must not remove it for that reason.
    black_box(&mut stack);
    see(MemoryRange::of(&stack))
}

/// The reason why the system refused `wanted` bytes. A process may lock `limit` bytes in all, or any number (`None`).
fn reason(wanted: usize, errno: rustix::io::Errno, limit: Option<u64>) -> LockError {
    match (errno, limit) {
        // The limit is exhausted, or the process may not lock at all.
        (rustix::io::Errno::NOMEM | rustix::io::Errno::PERM, Some(limit)) => {
            LockError::Limit { wanted, limit }
        }
        _ => LockError::Refused {
            wanted,
            errno: errno.raw_os_error(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::io::Errno;

    #[test]
    fn locked_bytes_are_counted_and_a_refusal_gives_its_reason() {
        let data = vec![7_u8; 10_000];
        let mut locked = LockedMemory::new();
        match locked.lock(MemoryRange::of(data.as_slice())) {
            Ok(()) => assert_eq!(locked.bytes(), 10_000),
            Err(error) => {
                assert_eq!(locked.bytes(), 0);
                assert!(error.to_string().contains("10000 bytes"), "{error}");
            }
        }
        // An empty range is no error.
        assert_eq!(locked.lock(MemoryRange::of(&[0_u8; 0])), Ok(()));
    }

    #[test]
    fn a_refusal_names_the_limit_where_the_process_has_one() {
        let limited = LockError::Limit {
            wanted: 9,
            limit: 5,
        };
        let refused = |errno: Errno| LockError::Refused {
            wanted: 9,
            errno: errno.raw_os_error(),
        };
        assert_eq!(reason(9, Errno::NOMEM, Some(5)), limited);
        assert_eq!(reason(9, Errno::PERM, Some(5)), limited);
        assert_eq!(reason(9, Errno::AGAIN, Some(5)), refused(Errno::AGAIN));
        // A process without a limit was refused because nothing is mapped there.
        assert_eq!(reason(9, Errno::NOMEM, None), refused(Errno::NOMEM));
    }

    /// The mapping that contains `address`, as Linux describes it: its size in memory (bytes), and whether it is
    /// locked.
    fn mapping(address: usize) -> Option<(usize, bool)> {
        let maps = std::fs::read_to_string("/proc/self/smaps").ok()?;
        let mut resident = None;
        for line in maps.lines() {
            let mut words = line.split_whitespace();
            let first = words.next()?;
            if let Some((begin, end)) = first.split_once('-') {
                let hexadecimal = |text| usize::from_str_radix(text, 16);
                let (begin, end) = (hexadecimal(begin).ok()?, hexadecimal(end).ok()?);
                resident = (begin..end).contains(&address).then_some(0);
            } else if let Some(bytes) = &mut resident {
                match first {
                    "Rss:" => *bytes = 1024 * words.next()?.parse::<usize>().ok()?,
                    "VmFlags:" => return Some((*bytes, words.any(|flag| flag == "lo"))),
                    _ => {}
                }
            }
        }
        None
    }

    #[test]
    fn memory_is_locked_until_the_lock_is_dropped() {
        // A vector of this size has a mapping of its own.
        let data = black_box(vec![7_u8; 8 << 20]);
        let address = data.as_ptr().addr() + (4 << 20);
        let is_locked = || mapping(address).map(|(_, locked)| locked);
        let mut locked = LockedMemory::new();
        assert_ne!(is_locked(), Some(true));
        let middle = MemoryRange {
            address,
            bytes: 4096,
        };
        if locked.lock(middle).is_ok() && is_locked().is_some() {
            assert_eq!(is_locked(), Some(true));
            drop(locked);
            assert_eq!(is_locked(), Some(false));
        }
    }

    #[test]
    fn memory_that_is_not_mapped_is_refused_with_a_reason() {
        let mut locked = LockedMemory::new();
        let error = locked.lock(MemoryRange {
            address: 4096,
            bytes: 4096,
        });
        assert!(error.is_err());
        assert_eq!(locked.bytes(), 0);
    }

    #[test]
    fn the_stack_ahead_is_touched_and_locked_where_allowed() {
        // A tick holds several models on the stack while one changes to the next.
        const { assert!(STACK_AHEAD >= 4 * size_of::<rt_core::LocalModel>()) }
        let mut locked = LockedMemory::new();
        if locked.lock_stack().is_ok() {
            assert_eq!(locked.bytes(), STACK_AHEAD);
        }
        // The stack of a new thread has no page in memory that the thread has not touched.
        let resident = || {
            let here = 0_u8;
            mapping(std::ptr::from_ref(&here).addr()).map(|(bytes, _)| bytes)
        };
        let touched = std::thread::spawn(move || {
            touch_stack();
            resident()
        });
        if let Some(bytes) = touched.join().expect("does not panic") {
            assert!(bytes >= STACK_AHEAD, "{bytes}");
        }
    }
}
