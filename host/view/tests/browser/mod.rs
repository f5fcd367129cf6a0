//! What the tests of the page need: a server of the page, and the programs that look at the page.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::channel;
use std::thread::JoinHandle;
use view::feed::Feed;
use view::web::{Draw, Options, serve};

/// Whether the program can be run. A line says so if it cannot.
pub(crate) fn exists(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output();
    let found = found.is_ok_and(|output| output.status.success());
    if !found {
        eprintln!("SKIPPED: the program {program} is missing");
    }
    found
}

/// The folder of the scripts.
pub(crate) fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/web_page")
}

/// A command that runs a script in node with playwright-core; `None`, with a line, if a tool is missing.
pub(crate) fn script(name: &str) -> Option<Command> {
    let Some(packages) = std::env::var_os("PALPATE_NODE_MODULES") else {
        eprintln!("SKIPPED: PALPATE_NODE_MODULES names no folder with playwright-core");
        return None;
    };
    if !exists("node") || !exists("chromium") {
        return None;
    }
    let mut command = Command::new("node");
    command.arg(scripts().join(name)).env("NODE_PATH", packages);
    Some(command)
}

/// Runs a script, and gives the lines that it prints.
pub(crate) fn lines(mut script: Command) -> String {
    let output = script.output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}\n{errors}");
    text
}

/// A server until `stop`, and its address.
pub(crate) fn server(
    feed: Box<dyn Feed>,
    draw: Arc<Draw>,
    stop: &Arc<AtomicBool>,
) -> (JoinHandle<()>, String) {
    let (sender, receiver) = channel();
    let options = Options {
        port: 0,
        say: Arc::new(move |line| {
            // The first line is the address.
            let _ = sender.send(line.to_owned());
        }),
        draw,
        stop: Arc::clone(stop),
    };
    let thread = std::thread::spawn(move || serve(feed, &options).unwrap());
    let address = receiver.recv().unwrap();
    (thread, address)
}
