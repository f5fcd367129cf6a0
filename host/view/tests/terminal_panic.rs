//! The display gives the terminal back also when a part of it panics.

use host::live::Message;
use std::process::Command;
use std::time::Duration;
use view::feed::{self, Feed, FeedError};
use view::terminal::{Options, show};

/// A feed with a fault.
struct Panics;

impl Feed for Panics {
    fn next(&mut self, _wait: Duration) -> Result<Option<Message>, FeedError> {
        panic!("a planted fault");
    }

    fn command(&mut self, _command: &feed::Command) {}

    fn present(&self) -> Vec<Message> {
        Vec::new()
    }
}

/// Runs in a terminal of the test below.
#[test]
#[ignore = "needs a terminal: the other test starts it"]
fn a_display_that_panics() {
    let _ = show(Box::new(Panics), &mut Options::default());
}

/// A server of tmux, until it is dropped.
struct Server(String);

impl Server {
    fn tmux(&self, arguments: &[&str]) -> String {
        let mut tmux = Command::new("tmux");
        let tmux = tmux.env_remove("TMUX").args(["-u", "-L", &self.0]);
        let output = tmux.args(arguments).output().unwrap();
        String::from_utf8_lossy(&output.stdout).into_owned()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.tmux(&["kill-server"]);
    }
}

#[test]
fn a_panic_gives_the_terminal_back_before_its_message() {
    if Command::new("tmux").arg("-V").output().is_err() {
        eprintln!("SKIPPED: no tmux on this machine: a panic of the display is not tested");
        return;
    }
    let server = Server(format!("palpate-panic-{}", std::process::id()));
    let folder = tempfile::tempdir().unwrap();
    let script = format!(
        "cd '{}'; stty -a > before; '{}' --ignored --exact a_display_that_panics --nocapture; \
         stty -a > after; tmux wait-for -S end; exec sleep 1000",
        folder.path().display(),
        std::env::current_exe().unwrap().display()
    );
    let start = [
        "-f",
        "/dev/null",
        "new-session",
        "-d",
        "-x",
        "100",
        "-y",
        "40",
        &script,
    ];
    server.tmux(&start);
    server.tmux(&["wait-for", "end"]);
    let screen = server.tmux(&["capture-pane", "-p"]);
    assert!(
        screen.contains("a planted fault"),
        "the message stays on the screen:\n{screen}"
    );
    let read = |file| std::fs::read_to_string(folder.path().join(file)).unwrap();
    assert!(read("before").contains("icanon"));
    assert_eq!(read("before"), read("after"));
}
