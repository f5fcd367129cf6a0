//! A snapshot for viewers allocates nothing on the host's thread.

#[global_allocator]
static ALLOCATOR: alloc_count::calls::Counting = alloc_count::calls::Counting;

use host::snapshot::{Subscriber, Watchers};
use palpate_tests::default_session;
use std::time::{Duration, Instant};

#[test]
fn a_copy_of_the_positions_allocates_nothing() {
    let setup = default_session(1.0);
    let watchers = Watchers::default();
    watchers.set(1);
    let (mut subscriber, mut reader) = Subscriber::watched(&setup.engine, watchers);
    let mut now = Instant::now();
    let mut copies = 0;
    for step in 0..100 {
        // Long enough for the next copy, and now and then for the next median.
        now += Duration::from_millis(20);
        let calls = alloc_count::calls::count(|| {
            subscriber.after_step(now, step * 4_000_000, 0, &setup.engine);
        });
        assert_eq!(calls, 0, "step {step}");
        if let Some(snapshot) = reader.newest() {
            copies += 1;
            reader.give_back(snapshot);
        }
    }
    assert_eq!(copies, 100);
    // The count can fail: a subscriber itself takes memory.
    let new = || drop(Subscriber::watched(&setup.engine, Watchers::default()));
    assert!(alloc_count::calls::count(new) > 0);
}
