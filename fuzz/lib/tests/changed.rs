//! Sound logs and messages, changed at random, break no rule. The long form is the example `changed`.

use fuzz_rules::changed::Mutator;
use fuzz_rules::log::{message, play};
use fuzz_rules::sound::{messages, scene_of, small_log};

#[test]
fn changed_logs_do_not_panic() {
    let seed = small_log().expect("a log");
    let keep = scene_of(&seed);
    assert!(play(&seed) == 1 && !keep.is_empty());
    let mut mutator = Mutator::new(2);
    let mut accepted = 0;
    for _ in 0..2000 {
        let mut bytes = seed.clone();
        mutator.change(&mut bytes, &keep);
        accepted += play(&bytes);
    }
    // The changes reach the reader behind the checks of the file.
    assert!((100..2000).contains(&accepted), "{accepted}");
}

#[test]
fn changed_messages_do_not_panic() {
    let seeds = messages();
    assert!(seeds.iter().all(|bytes| message(bytes) == 1));
    let mut kinds: Vec<_> = seeds.iter().map(|bytes| bytes[0]).collect();
    kinds.sort_unstable();
    kinds.dedup();
    assert_eq!(kinds, [1, 2, 3, 4, 5, 6, 7]);
    let mut mutator = Mutator::new(3);
    let mut accepted = 0;
    for _ in 0..20_000 {
        let mut bytes = seeds[mutator.below(seeds.len())].clone();
        mutator.change(&mut bytes, &(0..0));
        accepted += message(&bytes);
    }
    assert!((500..20_000).contains(&accepted), "{accepted}");
}
