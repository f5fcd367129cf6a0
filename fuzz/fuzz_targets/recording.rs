//! A recorded motion: what is accepted has ascending times and finite numbers.
#![no_main]

use host::scene::recording;

libfuzzer_sys::fuzz_target!(|text: &str| {
    match recording::parse(text, "hand.csv") {
        Ok(rows) => {
            assert!(rows.windows(2).all(|pair| pair[0].0 < pair[1].0));
            assert!(rows.iter().all(|(_, place)| place.iter().all(|x| x.is_finite())));
        }
        Err(error) => assert!(!error.to_string().contains('\n'), "an error is one line"),
    }
});
