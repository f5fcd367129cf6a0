//! The peak of bytes: blocks that exist at the same time, and both blocks of a reallocation. One test, because the
//! count covers the process.

use alloc_count::peak::{Peak, peak};
use std::hint::black_box;

#[global_allocator]
static ALLOCATOR: Peak = Peak;

#[test]
fn the_peak_is_what_exists_at_once() {
    // Far above the memory that the harness allocates meanwhile.
    const BLOCK: usize = 1 << 24;
    let block = || black_box(vec![1_u8; BLOCK]);
    let near = |found: usize, blocks: usize| {
        assert!(
            (blocks * BLOCK..blocks * BLOCK + BLOCK / 2).contains(&found),
            "{found} bytes for {blocks} blocks"
        );
    };
    near(peak(|| ()).0, 0);
    near(peak(|| drop((block(), block()))).0, 2);
    // One after another.
    near(
        peak(|| {
            drop(block());
            drop(block());
        })
        .0,
        1,
    );
    let (most, mut held) = peak(block);
    near(most, 1);
    // Memory that was held before does not count. A reallocation counts both blocks.
    near(peak(|| ()).0, 0);
    near(peak(|| held.reserve_exact(BLOCK)).0, 2);
    assert_eq!(held.len(), BLOCK);
}
