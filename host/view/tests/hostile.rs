//! Any bytes may be read as a log, a message, a request or a command of a page, without fuzzing tools. The long form is the example `hostile`.

use view::hostile::{Mutator, log, message, messages, scene_of, small_log};
use view::web::hostile::{command, commands, request, requests};

#[test]
fn the_inputs_of_the_fuzzers_do_not_panic() -> std::io::Result<()> {
    for input in corpus::inputs("log_player")? {
        log(&input.bytes);
    }
    for input in corpus::inputs("log")? {
        log(&input.bytes);
    }
    for input in corpus::inputs("view_message")? {
        message(&input.bytes);
    }
    Ok(())
}

#[test]
fn changed_logs_do_not_panic() {
    let seed = small_log().expect("a log");
    let keep = scene_of(&seed);
    assert!(log(&seed) && !keep.is_empty());
    let mut mutator = Mutator::new(2);
    let mut accepted = 0;
    for _ in 0..2000 {
        let mut bytes = seed.clone();
        mutator.change(&mut bytes, &keep);
        accepted += u32::from(log(&bytes));
    }
    // The changes reach the reader behind the checks of the file.
    assert!((100..2000).contains(&accepted), "{accepted}");
}

#[test]
fn changed_messages_do_not_panic() {
    let seeds = messages();
    assert!(seeds.iter().all(|bytes| message(bytes)));
    let mut kinds: Vec<_> = seeds.iter().map(|bytes| bytes[0]).collect();
    kinds.sort_unstable();
    kinds.dedup();
    assert_eq!(kinds, [1, 2, 3, 4, 5, 6, 7]);
    let mut mutator = Mutator::new(3);
    let mut accepted = 0;
    for _ in 0..20_000 {
        let mut bytes = seeds[mutator.below(seeds.len())].clone();
        mutator.change(&mut bytes, &(0..0));
        accepted += u32::from(message(&bytes));
    }
    assert!((500..20_000).contains(&accepted), "{accepted}");
}

#[test]
fn changed_requests_and_commands_do_not_panic() {
    type Reader = fn(&[u8]) -> bool;
    let kinds: [(Vec<Vec<u8>>, Reader); 2] = [(requests(), request), (commands(), command)];
    for (seeds, read) in kinds {
        assert!(seeds.iter().all(|bytes| read(bytes)));
        let mut mutator = Mutator::new(4);
        let mut accepted = 0;
        for _ in 0..20_000 {
            let mut bytes = seeds[mutator.below(seeds.len())].clone();
            mutator.change(&mut bytes, &(0..0));
            accepted += u32::from(read(&bytes));
        }
        // Some changes leave the meaning, and most do not.
        assert!((20..15_000).contains(&accepted), "{accepted}");
    }
}
