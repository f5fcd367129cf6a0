//! The count of calls: every kind of call, by this thread alone.

use alloc_count::calls::{Counting, count};
use std::hint::black_box;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn each_kind_of_call_is_counted_once() {
    assert_eq!(count(|| ()), 0);
    let mut list = Vec::new();
    assert_eq!(count(|| list = black_box(Vec::<u8>::with_capacity(8))), 1);
    assert_eq!(count(|| list.reserve_exact(black_box(4096))), 1);
    assert_eq!(count(|| list.push(1)), 0);
    assert_eq!(count(|| drop(list)), 1);
}

#[test]
fn calls_of_another_thread_are_not_counted() {
    let barrier = std::sync::Barrier::new(2);
    let wait = || {
        barrier.wait();
    };
    std::thread::scope(|scope| {
        let other = scope.spawn(|| {
            wait();
            let calls = count(|| drop(black_box(vec![0_u8; 1000])));
            wait();
            calls
        });
        // The other thread allocates between the two calls.
        let own = count(|| {
            wait();
            wait();
        });
        assert_eq!(own, 0);
        assert_eq!(other.join().expect("the thread ends"), 2);
    });
}
