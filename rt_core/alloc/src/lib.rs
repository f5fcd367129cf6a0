//! Allocators that count: [`calls`] counts the calls of one thread, [`peak`] the bytes of the whole process. Each hands
//! every call on to the system's allocator unchanged. The program counts the calls of the tick's thread in every run; the
//! tests bound what a part allocates.
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
//! Without that registration every count is zero. A test that claims a count of zero therefore also shows that the
//! count of an allocation is not zero, and a program asks [`calls::are_counted`].

pub mod calls;
pub mod peak;
