//! The text of a panic: its message, and its place in the sources.
//!
//! The value of a panic has the message alone. Only a panic hook is given the place, and a hook belongs to the program:
//! the hook of the program calls [`note`]. Without such a hook, the text has no place.

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::sync::{Mutex, PoisonError};

/// A panic as the hook was told of it.
struct Noted {
    message: String,
    place: String,
}

/// The latest panic.
static LATEST: Mutex<Option<Noted>> = Mutex::new(None);

thread_local! {
    /// Whether this thread is within [`caught`].
    static CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// Keeps message and place of a panic. Returns whether [`caught`] catches the panic on this thread: the caller of
/// [`caught`] then reports the panic.
pub fn note(info: &PanicHookInfo<'_>) -> bool {
    if let Some(place) = info.location() {
        let noted = Noted {
            message: message(info.payload()).to_owned(),
            place: place.to_string(),
        };
        *LATEST.lock().unwrap_or_else(PoisonError::into_inner) = Some(noted);
    }
    CAUGHT.get()
}

/// Does `work`, whose caller reports a panic.
///
/// # Errors
/// The text of the panic, if `work` panics.
pub fn caught<R>(work: impl FnOnce() -> R) -> Result<R, String> {
    let outer = CAUGHT.replace(true);
    let ended = catch_unwind(AssertUnwindSafe(work));
    CAUGHT.set(outer);
    ended.map_err(|panic| text(&*panic))
}

/// The message of a panic, with its place if a hook has noted it.
pub fn text(panic: &(dyn Any + Send)) -> String {
    let message = message(panic);
    let latest = LATEST.lock().unwrap_or_else(PoisonError::into_inner);
    // A panic passes from thread to thread with its message, so the message tells which panic it is.
    match latest.as_ref().filter(|noted| noted.message == message) {
        Some(noted) => format!("{message} ({})", noted.place),
        None => message.to_owned(),
    }
}

fn message(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_has_its_message_and_work_without_a_panic_its_result() {
        assert_eq!(caught(|| 7), Ok(7));
        let number = 3;
        // No hook of this process notes places.
        let text = |work: fn(i32)| caught(|| work(number)).unwrap_err();
        assert_eq!(text(|_| panic!("a literal")), "a literal");
        assert_eq!(text(|n| panic!("number {n}")), "number 3");
        assert_eq!(text(|_| std::panic::panic_any(1.5)), "no message");
        assert!(!CAUGHT.get());
    }
}
