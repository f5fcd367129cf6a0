//! `palpate run --view`: the socket, the line that names it, and a run that does not depend on its viewers.
#![cfg(feature = "view")]

use std::error::Error;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

/// How the line begins that says how to watch a run.
const LINE: &str = "palpate: watch this run with:";

type Outcome = Result<(), Box<dyn Error>>;

/// `palpate run` with these arguments. Its folder of sockets is in `runtime`.
fn palpate(runtime: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command.arg("run").args(arguments);
    command.env("XDG_RUNTIME_DIR", runtime).stdin(Stdio::null());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Starts a run that lasts long, and waits until it says how to watch it.
fn begin(runtime: &Path, view: &str) -> Result<(Killed, String), Box<dyn Error>> {
    let mut child = palpate(runtime, &[view, "--pace", "0.01", "--duration", "10"]).spawn()?;
    let errors = child.stderr.take().ok_or("a pipe")?;
    let child = Killed(child);
    for line in BufReader::new(errors).lines() {
        let line = line?;
        if line.starts_with(LINE) {
            return Ok((child, line));
        }
    }
    Err("the run does not say how to watch it".into())
}

/// A run that is killed at the end of a test.
struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_watched_run_has_the_log_of_an_unwatched_one_and_removes_its_socket() -> Outcome {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (plain, watched) = (at("plain.mcap"), at("watched.mcap"));
    let view = format!("--view={}", at("run.sock"));
    for (log, arguments) in [
        (&plain, vec!["--duration", "0.2"]),
        (&watched, vec!["--duration", "0.2", &view, "--pace", "0"]),
    ] {
        let output = palpate(folder.path(), &arguments)
            .args(["--log", log])
            .output()?;
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        let line = format!("{LINE} palpate view --socket {}", at("run.sock"));
        assert_eq!(
            said(&output).lines().any(|said| said == line),
            log == &watched
        );
    }
    assert!(fs::read(&plain)? == fs::read(&watched)?);
    assert!(!Path::new(&at("run.sock")).exists());
    Ok(())
}

#[test]
fn the_default_socket_is_the_users_own_and_the_one_of_a_killed_run_is_replaced() -> Outcome {
    let runtime = tempfile::tempdir()?;
    let (run, line) = begin(runtime.path(), "--view")?;
    assert_eq!(line, format!("{LINE} palpate view"));
    let folder = runtime.path().join("palpate");
    let socket = folder.join(format!("{}.sock", run.0.id()));
    assert_eq!(folder.metadata()?.permissions().mode() & 0o777, 0o750);
    assert_eq!(socket.metadata()?.permissions().mode() & 0o777, 0o660);
    let mut viewer = UnixStream::connect(&socket)?;
    let mut length = [0; 4];
    viewer.read_exact(&mut length)?;

    // Another run cannot have this socket.
    let view = format!("--view={}", socket.display());
    let second = palpate(runtime.path(), &[&view, "--duration", "0.05"]).output()?;
    assert_eq!(second.status.code(), Some(1));
    assert!(
        said(&second).contains("belongs to another run"),
        "{}",
        said(&second)
    );
    drop(run);

    assert!(socket.exists(), "a killed run leaves its socket");
    let third = palpate(runtime.path(), &[&view, "--duration", "0.05"]).output()?;
    assert_eq!(third.status.code(), Some(0), "{}", said(&third));
    assert!(!socket.exists());
    Ok(())
}

#[test]
fn a_pace_is_for_virtual_time_and_within_bounds() -> Outcome {
    let runtime = tempfile::tempdir()?;
    for (arguments, expected) in [
        (
            &["--view", "--pace", "1", "--clock", "real"][..],
            "--pace applies to virtual time only",
        ),
        (&["--pace", "1"], "--view"),
        (
            &["--view", "--pace", "-1"],
            "allowed: 0, or a number from 0.001 to 1000",
        ),
        (
            &["--view", "--pace", "nan"],
            "allowed: 0, or a number from 0.001 to 1000",
        ),
    ] {
        let output = palpate(runtime.path(), arguments).output()?;
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(said(&output).contains(expected), "{}", said(&output));
    }
    Ok(())
}
