//! Experiments whose figures the report quotes. `palpate bench`, `palpate stress` or `palpate compare` repeats each of them.
#![forbid(unsafe_code)]

/// Appends a line to a text.
macro_rules! put {
    ($text:expr) => { $text.push('\n') };
    ($text:expr, $($line:tt)*) => {{
        use std::fmt::Write as _;
        // A text takes every line.
        let _ = writeln!($text, $($line)*);
    }};
}

/// Appends to the last line of a text.
macro_rules! put_part {
    ($text:expr, $($part:tt)*) => {{
        use std::fmt::Write as _;
        // A text takes every part.
        let _ = write!($text, $($part)*);
    }};
}

pub mod accuracy;
pub mod adversary;
mod chance;
pub mod compare;
pub mod contact;
pub mod elsewhere;
mod error;
pub mod extrapolation;
mod hands;
pub mod latency;
mod level;
pub mod probe;
mod results;
mod slow_host;
pub mod speed;
pub mod stability;
pub mod stress;
pub mod sweep;
pub mod tearing;
mod thin;
pub mod velocity;
mod workers;

pub use error::StudyError;
pub use level::Level;
pub use results::Results;
