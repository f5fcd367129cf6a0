//! The slot through which viewers see the bodies allocates nothing on the host's thread after its first moments.

#[global_allocator]
static ALLOCATOR: alloc_count::calls::Counting = alloc_count::calls::Counting;

use host::live::slot::{Watchers, slot};
use palpate_tests::default_session;
use std::time::{Duration, Instant};

#[test]
fn a_copy_of_the_positions_allocates_nothing() {
    let setup = default_session(1.0);
    let watchers = Watchers::default();
    watchers.set(1);
    let (mut writer, mut reader) = slot(&setup.engine, watchers);
    let mut now = Instant::now();
    let mut copies = 0;
    for step in 0..100 {
        // Long enough for the next copy, and now and then for the next median.
        now += Duration::from_millis(20);
        let calls = alloc_count::calls::count(|| {
            writer.after_step_at(now, step * 4_000_000, 0, &setup.engine);
        });
        assert_eq!(calls, 0, "step {step}");
        if let Some(moment) = reader.newest() {
            copies += 1;
            reader.give_back(moment);
        }
    }
    assert_eq!(copies, 100);
    // The count can fail: a slot itself takes memory.
    assert!(alloc_count::calls::count(|| drop(slot(&setup.engine, Watchers::default()))) > 0);
}
