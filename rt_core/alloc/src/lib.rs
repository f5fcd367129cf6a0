//! Allocators that count: [`calls`] counts the calls of one thread, [`peak`] the bytes of the whole process. Both pass
//! every call to the system's allocator unchanged. The program counts the calls of the tick's thread in every run. The
//! tests bound the memory that a part allocates.
//!
//! A program registers one of the two allocators itself:
//!
//! ```
//! #[global_allocator]
//! static ALLOCATOR: alloc_count::calls::Counting = alloc_count::calls::Counting;
//!
//! assert_eq!(alloc_count::calls::count(|| ()), 0);
//! assert_eq!(alloc_count::calls::count(|| drop(std::hint::black_box(Box::new(7)))), 2);
//! ```
//!
//! Without that registration, every count is zero. A test that demands a count of zero therefore also shows that the
//! count of an allocation is not zero. A program asks [`calls::are_counted`].

pub mod calls;
pub mod peak;
