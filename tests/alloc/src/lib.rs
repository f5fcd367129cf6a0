//! Allocators that count, for the tests that bound what a part allocates: [`calls`] counts the calls of one thread,
//! [`peak`] the bytes of the whole process. Each hands every call on to the system's allocator unchanged.
//!
//! A test binary registers one of the two allocators itself:
//!
//! ```
//! #[global_allocator]
//! static ALLOCATOR: alloc_count::calls::Counting = alloc_count::calls::Counting;
//!
//! assert_eq!(alloc_count::calls::count(|| ()), 0);
//! assert_eq!(alloc_count::calls::count(|| drop(std::hint::black_box(Box::new(7)))), 2);
//! ```
//!
//! Without that registration every count is zero. A test that claims a count of zero therefore also shows that the
//! count of an allocation is not zero.

pub mod calls;
pub mod peak;
