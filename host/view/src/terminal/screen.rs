//! The terminal itself: raw mode and the alternate screen, which end on every way out.

use super::TerminalError;
use ratatui::Terminal;
use ratatui::backend::{Backend, ClearType, CrosstermBackend, WindowSize};
use ratatui::buffer::Cell;
use ratatui::crossterm::cursor::Show;
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{
    EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use ratatui::layout::{Position, Size};
use rustix::termios::{LocalModes, OptionalActions, SpecialCodeIndex, tcgetattr, tcsetattr};
use std::io::{self, Stdout};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Once, PoisonError, RwLock};
use std::thread::{self, ThreadId};

/// Whether the screen is in use.
static IN_USE: AtomicBool = AtomicBool::new(false);
/// The thread that draws.
static THREAD: RwLock<Option<ThreadId>> = RwLock::new(None);

/// The screen, in use until it is dropped.
pub(super) struct Screen {
    pub(super) terminal: Terminal<Output>,
}

impl Screen {
    /// Begins to use the terminal. `attached`: Ctrl-C is a signal for all processes of the terminal.
    pub(super) fn begin(attached: bool) -> Result<Self, TerminalError> {
        restore_before_panics();
        *THREAD.write().unwrap_or_else(PoisonError::into_inner) = Some(thread::current().id());
        IN_USE.store(true, Ordering::SeqCst);
        let begun = Self::try_begin(attached);
        if begun.is_err() {
            restore();
        }
        Ok(begun?)
    }

    fn try_begin(attached: bool) -> io::Result<Self> {
        enable_raw_mode()?;
        if attached {
            let input = io::stdin();
            let mut modes = tcgetattr(&input)?;
            modes.local_modes |= LocalModes::ISIG;
            // Ctrl-Z and Ctrl-\ would leave the terminal as it is now.
            for key in [SpecialCodeIndex::VSUSP, SpecialCodeIndex::VQUIT] {
                // `_POSIX_VDISABLE` of Linux.
                modes.special_codes[key] = 0;
            }
            tcsetattr(&input, OptionalActions::Now, &modes)?;
        }
        execute!(io::stdout(), EnterAlternateScreen)?;
        let mut terminal = Terminal::new(Output(CrosstermBackend::new(io::stdout())))?;
        terminal.clear()?;
        Ok(Self { terminal })
    }
}

/// The output to the terminal, which may be closed at any time.
///
/// `crossterm` 0.29 asks the terminal where the cursor is and waits for the answer, on a closed terminal without end. The
/// display has no use for a place of the cursor, so nobody asks. `ratatui` prints an error of its last call, which shows
/// the cursor, to the closed terminal, and panics; [`restore`] shows the cursor.
pub(super) struct Output(CrosstermBackend<Stdout>);

impl Backend for Output {
    type Error = io::Error;

    fn draw<'a, I>(&mut self, content: I) -> io::Result<()>
    where
        I: Iterator<Item = (u16, u16, &'a Cell)>,
    {
        self.0.draw(content)
    }

    fn hide_cursor(&mut self) -> io::Result<()> {
        self.0.hide_cursor()
    }

    fn show_cursor(&mut self) -> io::Result<()> {
        Ok(())
    }

    fn get_cursor_position(&mut self) -> io::Result<Position> {
        Ok(Position::ORIGIN)
    }

    fn set_cursor_position<P: Into<Position>>(&mut self, position: P) -> io::Result<()> {
        self.0.set_cursor_position(position)
    }

    fn clear(&mut self) -> io::Result<()> {
        self.0.clear()
    }

    fn clear_region(&mut self, part: ClearType) -> io::Result<()> {
        self.0.clear_region(part)
    }

    fn size(&self) -> io::Result<Size> {
        self.0.size()
    }

    fn window_size(&mut self) -> io::Result<WindowSize> {
        self.0.window_size()
    }

    fn flush(&mut self) -> io::Result<()> {
        Backend::flush(&mut self.0)
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        restore();
    }
}

/// Gives the terminal back, once. An error has no remedy here.
fn restore() {
    if IN_USE.swap(false, Ordering::SeqCst) {
        let _ = disable_raw_mode();
        let _ = execute!(io::stdout(), LeaveAlternateScreen, Show);
    }
}

/// Gives the terminal back before the message of a panic of the drawing thread is printed.
fn restore_before_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            let drawing = THREAD.read().unwrap_or_else(PoisonError::into_inner);
            if *drawing == Some(thread::current().id()) {
                restore();
            }
            drop(drawing);
            before(info);
        }));
    });
}
