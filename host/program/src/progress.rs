//! The progress of long work, on the standard error: a bar on a terminal, and otherwise lines, the first after two seconds
//! and the later ones more and more rarely.
//!
//! A thread of its own draws, so that a person sees that the program works even while a factor takes minutes. Before the
//! work has a fraction, the progress names what is prepared.

use host::preparation::Preparation;
use indicatif::{ProgressBar as Bar, ProgressStyle};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Parts of the whole work.
const PARTS: u64 = 1000;
/// Period of drawing.
const PERIOD: Duration = Duration::from_millis(250);
/// Time of the first line, and the longest time between two lines (s).
const FIRST: f64 = 2.0;
const LONGEST: f64 = 60.0;
/// The position of work that has no fraction yet.
const NONE: u64 = u64::MAX;

/// The progress of one piece of work, in a thousand parts.
pub(super) struct ProgressBar {
    shared: Arc<Shared>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

struct Shared {
    bar: Bar,
    /// Whether the standard error is a terminal.
    draws: bool,
    /// Whether lines are written if there is no terminal.
    lines: bool,
    start: Instant,
    position: AtomicU64,
    preparation: Mutex<Preparation>,
    /// Time of the next line (s).
    next: Mutex<f64>,
    over: Mutex<bool>,
    changed: Condvar,
}

impl ProgressBar {
    /// Begins to show the progress. Without a terminal, lines are written only if `lines`.
    pub(super) fn begin(lines: bool) -> Self {
        let bar = Bar::new(PARTS);
        let shared = Arc::new(Shared {
            draws: !bar.is_hidden(),
            bar,
            lines,
            start: Instant::now(),
            position: AtomicU64::new(NONE),
            preparation: Mutex::new(Preparation::Reading),
            next: Mutex::new(FIRST),
            over: Mutex::new(false),
            changed: Condvar::new(),
        });
        let theirs = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .stack_size(runner::STACK)
            .name("palpate-progress".into());
        // Without a thread, only `draw_here` draws.
        let thread = thread.spawn(move || theirs.keep_drawing()).ok();
        Self {
            shared,
            thread: Mutex::new(thread),
        }
    }

    /// Says what is prepared now.
    pub(super) fn preparing(&self, preparation: Preparation) {
        *lock(&self.shared.preparation) = preparation;
    }

    /// Sets the position, in parts of a thousand.
    pub(super) fn set_position(&self, position: u64) {
        self.shared
            .position
            .store(position.min(PARTS), Ordering::Relaxed);
    }

    /// As [`Self::set_position`] and draws at once. The thread that draws ends: a run under the real clock wants no
    /// threads beside its own.
    pub(super) fn draw_here(&self, position: u64) {
        self.set_position(position);
        self.end_thread();
        self.shared.draw();
    }

    /// Clears the bar and draws no more until [`Self::show`]. The thread that draws ends.
    #[cfg(feature = "view")]
    pub(super) fn hide(&self) {
        self.finish_and_clear();
    }

    /// Draws again. There is no thread that draws any more.
    #[cfg(feature = "view")]
    pub(super) fn show(&self) {
        self.shared.bar.reset();
    }

    /// Writes a line of the program to the standard error, above the bar.
    pub(super) fn say(&self, text: &str) {
        self.above(|| errln!("{text}"));
    }

    /// Prints above the bar.
    pub(super) fn above(&self, print: impl FnOnce()) {
        self.shared.bar.suspend(print);
    }

    /// Ends the work and clears the bar.
    pub(super) fn finish_and_clear(&self) {
        self.end_thread();
        self.shared.bar.finish_and_clear();
    }

    fn end_thread(&self) {
        let Some(thread) = lock(&self.thread).take() else {
            return;
        };
        *lock(&self.shared.over) = true;
        self.shared.changed.notify_all();
        // The panic hook has reported a panic of that thread, which has no other consequence.
        let _ = thread.join();
    }
}

impl Drop for ProgressBar {
    /// Work that ended by an error clears its bar, too.
    fn drop(&mut self) {
        self.finish_and_clear();
    }
}

impl Shared {
    fn keep_drawing(&self) {
        let mut over = lock(&self.over);
        while !*over {
            let waited = self.changed.wait_timeout(over, PERIOD);
            over = waited.unwrap_or_else(PoisonError::into_inner).0;
            if !*over {
                self.draw();
            }
        }
    }

    fn draw(&self) {
        let seconds = self.start.elapsed().as_secs_f64();
        let position = self.position.load(Ordering::Relaxed);
        if self.draws {
            let template = match position {
                NONE => "{spinner} {msg} {elapsed}",
                // Nothing tells yet how long the rest takes.
                0 => "{bar:40} {percent:>3} %  {elapsed} so far",
                _ => "{bar:40} {percent:>3} %  {elapsed} so far, {eta} left",
            };
            if let Ok(style) = ProgressStyle::with_template(template) {
                self.bar.set_style(style);
            }
            if position == NONE {
                self.bar.set_message(lock(&self.preparation).name());
                self.bar.tick();
            } else {
                self.bar.set_position(position);
            }
        } else if self.lines {
            let mut next = lock(&self.next);
            if seconds >= *next {
                *next = after(seconds);
                errln!("{}", line(seconds, position, *lock(&self.preparation)));
            }
        }
    }
}

/// The time of the line after a line at `seconds`: twice as late, but at most a minute later.
fn after(seconds: f64) -> f64 {
    (2.0 * seconds).min(seconds + LONGEST)
}

/// A line of progress after `seconds` of work.
fn line(seconds: f64, position: u64, preparation: Preparation) -> String {
    if position == NONE {
        return format!("{seconds:.0} s: {}", preparation.name());
    }
    let fraction = position as f64 / PARTS as f64;
    let percent = 100.0 * fraction;
    if fraction > 0.0 {
        let left = seconds * (1.0 - fraction) / fraction;
        format!("{seconds:.0} s: {percent:.1} % done, about {left:.0} s left")
    } else {
        format!("{seconds:.0} s: {percent:.1} % done")
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_from_the_second_second_on_and_then_ever_more_rarely() {
        let mut times = vec![FIRST];
        while times.len() < 9 {
            times.extend(times.last().map(|last| after(*last)));
        }
        assert_eq!(
            times,
            [2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 124.0, 184.0, 244.0]
        );
    }

    #[test]
    fn a_line_names_what_is_prepared_and_then_the_fraction() {
        assert_eq!(
            line(2.0, NONE, Preparation::Factorizing),
            "2 s: factorizing"
        );
        assert_eq!(line(4.0, 0, Preparation::Factorizing), "4 s: 0.0 % done");
        assert_eq!(
            line(8.0, 250, Preparation::Factorizing),
            "8 s: 25.0 % done, about 24 s left"
        );
    }
}
