//! Memory that the tick may touch without waiting for it.
//!
//! A page that was never touched, or that was swapped out, costs a tick between a microsecond and many
//! milliseconds. So before the first tick the loop's own memory is touched and, where the system allows,
//! locked: the thread's stack, the loop's state (controller and devices) and the rings. Code and the
//! shared allocator's pages are not locked; the loop does not allocate.
//!
//! Nothing here belongs on the hot path. Unsafe code is here and in the trap of forbidden system calls
//! (`trap`), nowhere else.

use rustix::process::{Resource, getrlimit};
use std::ffi::c_void;
use std::hint::black_box;

/// How much of the tick thread's stack is touched and locked ahead. A tick needs some tens of KB (a local
/// model alone takes ten, and a change of model holds several).
pub const STACK_AHEAD: usize = 256 * 1024;

/// A stretch of memory, by address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryRange {
    address: usize,
    bytes: usize,
}

impl MemoryRange {
    /// The memory of a value (not what it points to).
    pub fn of<T: ?Sized>(value: &T) -> Self {
        Self {
            address: std::ptr::from_ref(value).addr(),
            bytes: size_of_val(value),
        }
    }

    /// Its length in bytes.
    pub fn bytes(&self) -> usize {
        self.bytes
    }
}

/// Why memory could not be locked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LockError {
    /// More than an unprivileged process may lock.
    #[error(
        "{wanted} bytes more are needed, and the limit is {limit} bytes in all (RLIMIT_MEMLOCK)"
    )]
    Limit {
        /// Bytes asked for.
        wanted: usize,
        /// What the process may lock in all (bytes).
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

/// Memory held in place; let go when dropped.
#[derive(Debug, Default)]
pub struct LockedMemory {
    ranges: Vec<MemoryRange>,
}

impl LockedMemory {
    /// Nothing locked yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Locks `range` in addition, whole pages around it. The memory must stay where it is for as long as
    /// it is to be held; freeing it earlier is harmless.
    ///
    /// # Errors
    /// [`LockError`] where the system refuses; what was locked before stays locked.
    #[allow(unsafe_code)]
    pub fn lock(&mut self, range: MemoryRange) -> Result<(), LockError> {
        if range.bytes == 0 {
            return Ok(());
        }
        let address = std::ptr::without_provenance_mut::<c_void>(range.address);
        // SAFETY: locking changes neither content nor access of the pages, whosever they are, and the
        // kernel refuses addresses that are not mapped. Nothing is read or written through the pointer.
        let locked = unsafe { rustix::mm::mlock(address, range.bytes) };
        match locked {
            Ok(()) => {
                self.ranges.push(range);
                Ok(())
            }
            Err(errno) => Err(reason(range.bytes, errno)),
        }
    }

    /// Touches [`STACK_AHEAD`] bytes of the calling thread's stack below the caller, then locks them. They
    /// stay touched even where the lock is refused. Call it from the thread that will tick, from near the
    /// frame that will run the loop.
    ///
    /// # Errors
    /// [`LockError`] where the system refuses.
    pub fn lock_stack(&mut self) -> Result<(), LockError> {
        with_stack_ahead(|stack| self.lock(stack))
    }

    /// Bytes held in place, as asked for (the system rounds each range to whole pages).
    pub fn bytes(&self) -> usize {
        self.ranges.iter().map(MemoryRange::bytes).sum()
    }
}

impl Drop for LockedMemory {
    #[allow(unsafe_code)]
    fn drop(&mut self) {
        for range in &self.ranges {
            let address = std::ptr::without_provenance_mut::<c_void>(range.address);
            // SAFETY: as for locking. Where the memory has been freed meanwhile the call fails or unlocks
            // pages that someone else uses, who at worst may wait for them again.
            let _ = unsafe { rustix::mm::munlock(address, range.bytes) };
        }
    }
}

/// Touches the calling thread's stack ahead without locking it.
pub fn touch_stack() {
    with_stack_ahead(|_| ());
}

/// Writes [`STACK_AHEAD`] bytes of stack, so that its pages are mapped, and shows them to `see`. The frame
/// is gone when the loop runs; the pages below the caller's are what is meant.
#[inline(never)]
#[allow(
    clippy::large_stack_arrays,
    reason = "a large piece of stack is the whole point"
)]
fn with_stack_ahead<R>(see: impl FnOnce(MemoryRange) -> R) -> R {
    let mut stack = [0_u8; STACK_AHEAD];
    // Nothing may be left out because nobody reads it.
    black_box(&mut stack);
    see(MemoryRange::of(&stack))
}

fn reason(wanted: usize, errno: rustix::io::Errno) -> LockError {
    let limit = getrlimit(Resource::Memlock).current;
    match (errno, limit) {
        // Out of allowance, or not allowed to lock at all.
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

    #[test]
    fn what_is_locked_is_counted_and_what_is_refused_says_why() {
        let data = vec![7_u8; 10_000];
        let mut locked = LockedMemory::new();
        match locked.lock(MemoryRange::of(data.as_slice())) {
            Ok(()) => assert_eq!(locked.bytes(), 10_000),
            Err(error) => {
                assert_eq!(locked.bytes(), 0);
                assert!(error.to_string().contains("10000 bytes"), "{error}");
            }
        }
        // Nothing to lock is no error.
        assert_eq!(locked.lock(MemoryRange::of(&[0_u8; 0])), Ok(()));
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
        let mut locked = LockedMemory::new();
        if locked.lock_stack().is_ok() {
            assert_eq!(locked.bytes(), STACK_AHEAD);
        }
        touch_stack();
    }
}
