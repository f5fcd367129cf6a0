//! A terminal that is closed while a display uses it: a pty whose other end is this process.

use super::source::Source;
use super::{ENDLESS, LONGEST, PROGRAM};
use rustix::fs::{Mode, OFlags, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use std::fs::File;
use std::io::Read;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// Starts a display in a terminal that never answers. `hangup`: what the display does with the signal of a lost terminal,
/// an option of `env`.
fn start(hangup: &str, source: &Source) -> (File, Child) {
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let master = openpt(flags).expect("a pty");
    grantpt(&master).expect("a pty");
    unlockpt(&master).expect("a pty");
    let path = ptsname(&master, Vec::new()).expect("a name");
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    let slave = File::from(open(path.as_c_str(), flags, Mode::empty()).expect("a terminal"));
    let size = Winsize {
        ws_row: 40,
        ws_col: 120,
        ws_xpixel: 0,
        ws_ypixel: 0,
    };
    tcsetwinsize(&slave, size).expect("a size");
    let child = Command::new("env")
        .args([hangup, "setsid", "--ctty", PROGRAM, "view", "--socket"])
        .arg(source.socket())
        .env("TERM", "xterm-256color")
        .stdin(slave.try_clone().expect("the terminal"))
        .stdout(slave.try_clone().expect("the terminal"))
        .stderr(slave)
        .spawn()
        .expect("env of coreutils and setsid of util-linux");
    (File::from(master), child)
}

/// A display ends when its terminal is closed: before the display has drawn, and afterwards; with the signal of a lost
/// terminal, and without.
#[test]
fn a_display_ends_with_its_terminal_and_does_not_panic() {
    for hangup in ["--default-signal=HUP", "--ignore-signal=HUP"] {
        // The alternate screen comes first, and the picture has the word.
        for last in ["\x1b[?1049h", "lateness"] {
            let source = Source::start(ENDLESS);
            let (mut master, mut child) = start(hangup, &source);
            let mut screen = Vec::new();
            while !String::from_utf8_lossy(&screen).contains(last) {
                let mut bytes = [0; 4096];
                let count = master.read(&mut bytes).expect("the display goes on");
                screen.extend_from_slice(&bytes[..count]);
            }
            drop(master);
            let closed = Instant::now();
            let ended = loop {
                if let Some(ended) = child.try_wait().expect("the system tells") {
                    break Some(ended);
                }
                if closed.elapsed() > LONGEST {
                    child.kill().expect("killed");
                    child.wait().expect("waited for");
                    break None;
                }
                std::thread::sleep(Duration::from_millis(10));
            };
            let ended = ended.unwrap_or_else(|| panic!("{hangup}, {last:?}: it goes on"));
            assert_ne!(ended.code(), Some(101), "{hangup}, {last:?}: it panicked");
            assert!(
                !ended.success(),
                "{hangup}, {last:?}: a lost terminal is an error"
            );
        }
    }
}
