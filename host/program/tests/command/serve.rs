//! `palpate serve` and `palpate status` from outside: what the service manager hears, signals, absent devices, kills.

use super::bugreport;
use serde_json::Value;
use std::error::Error;
use std::fs;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

type Outcome = Result<(), Box<dyn Error>>;

/// The longest time that a test waits for another process: far more than it takes.
const PATIENCE: Duration = Duration::from_secs(60);

fn palpate(folder: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command.args(line.split_whitespace()).current_dir(folder);
    command
}

/// Waits until `found` has a result.
fn until<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> Result<T, Box<dyn Error>> {
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        if let Some(found) = found() {
            return Ok(found);
        }
        sleep(Duration::from_millis(50));
    }
    Err(format!("waited in vain for: {what}").into())
}

/// A program that serves in a folder. It is killed when this value is dropped.
struct Served {
    child: Child,
    folder: PathBuf,
}

impl Served {
    /// Starts the program with `more` lines of settings.
    fn begin(folder: &Path, more: &str) -> Result<Self, Box<dyn Error>> {
        Self::begin_as(folder, more, |command| command)
    }

    /// The same, by a command that `change` changes.
    fn begin_as(
        folder: &Path,
        more: &str,
        change: impl FnOnce(Command) -> Command,
    ) -> Result<Self, Box<dyn Error>> {
        settings(folder, more)?;
        let mut command = change(palpate(folder, "serve --settings palpate.toml"));
        command
            .env("NOTIFY_SOCKET", folder.join("notify"))
            .env("WATCHDOG_USEC", "600000");
        let said = |name: &str| {
            fs::File::options()
                .append(true)
                .create(true)
                .open(folder.join(name))
        };
        let child = command.stdout(said("out")?).stderr(said("err")?).spawn()?;
        Ok(Self {
            child,
            folder: folder.to_owned(),
        })
    }

    fn signal(&self, name: &str) -> Outcome {
        let sent = Command::new("kill")
            .args(["-s", name, &self.child.id().to_string()])
            .status()?;
        if sent.success() {
            Ok(())
        } else {
            Err("no such process".into())
        }
    }

    /// What `palpate status` says, and its exit code.
    fn status(&self) -> Option<(Value, i32)> {
        let file = self.folder.join("status.json");
        let _ = fs::remove_file(&file);
        let asked = palpate(
            &self.folder,
            "status --settings palpate.toml --json status.json",
        )
        .output()
        .ok()?;
        let json = serde_json::from_slice(&fs::read(file).ok()?).ok()?;
        Some((json, asked.status.code()?))
    }

    /// Waits for a state and a number of ticks.
    fn wait_for(&self, state: &str, ticks: u64) -> Result<Value, Box<dyn Error>> {
        until(state, || {
            let (status, code) = self.status()?;
            let found = status["state"] == state && status["ticks"].as_u64()? >= ticks;
            found.then(|| {
                assert_eq!(code, i32::from(state != "running"));
                status
            })
        })
    }

    /// Sets the largest size of a file that the program may write (bytes), its messages included.
    fn room(&self, bytes: &str) -> Outcome {
        let set = Command::new("prlimit")
            .arg(format!("--fsize={bytes}:unlimited"))
            .args(["--pid", &self.child.id().to_string()])
            .status()?;
        set.success().then_some(()).ok_or("no limit was set".into())
    }

    fn said(&self) -> String {
        fs::read_to_string(self.folder.join("err")).unwrap_or_default()
    }

    fn end(mut self) -> Result<Option<i32>, Box<dyn Error>> {
        self.signal("TERM")?;
        Ok(until("the end", || self.child.try_wait().ok()?)?.code())
    }
}

/// An emulated device, which is unplugged when this value is dropped.
struct Emulator(Child);

impl Emulator {
    fn begin(folder: &Path, port: u16) -> Result<Self, Box<dyn Error>> {
        let line = format!("device emulate omega3 --on tcp:{port} --tremor 0.0005");
        let mut command = palpate(folder, &line);
        Ok(Self(
            command
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()?,
        ))
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // A process that has ended is not there.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // A process that has ended is not there.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn settings(folder: &Path, more: &str) -> Outcome {
    let socket = folder.join("status.sock");
    let text = format!(
        "serve.socket = \"{}\"\nserve.retry = 0.1\n{more}\n",
        socket.display()
    );
    Ok(fs::write(folder.join("palpate.toml"), text)?)
}

/// What the service manager has heard since the last call.
fn heard(manager: &UnixDatagram) -> Vec<String> {
    let mut messages = Vec::new();
    let mut buffer = [0; 4096];
    while let Ok(length) = manager.recv(&mut buffer) {
        messages.push(String::from_utf8_lossy(&buffer[..length]).into_owned());
    }
    messages
}

fn manager(folder: &Path) -> Result<UnixDatagram, Box<dyn Error>> {
    let manager = UnixDatagram::bind(folder.join("notify"))?;
    manager.set_nonblocking(true)?;
    Ok(manager)
}

fn logs(folder: &Path) -> Result<Vec<String>, Box<dyn Error>> {
    let names = fs::read_dir(folder)?.flatten();
    let names = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let mut logs: Vec<_> = names.filter(|name| name.starts_with("palpate-")).collect();
    logs.sort();
    Ok(logs)
}

fn replays(folder: &Path, log: &str) -> Outcome {
    let output = palpate(folder, &format!("run --replay {log}")).output()?;
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(
        output.status.code(),
        Some(0),
        "{log}: {printed}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(printed.contains("reproduced exactly"), "{log}: {printed}");
    Ok(())
}

#[test]
fn a_service_is_ready_once_ticks_advance_and_a_wrong_configuration_changes_nothing() -> Outcome {
    let folder = tempfile::tempdir()?;
    let manager = manager(folder.path())?;
    let served = Served::begin(folder.path(), "")?;
    let status = served.wait_for("running", 500)?;
    assert_eq!(status["devices"].as_array().map(Vec::len), Some(2));
    let messages = heard(&manager);
    assert!(messages[0].starts_with("READY=1"), "{messages:?}");
    assert!(
        messages[1..].iter().all(|message| message == "WATCHDOG=1") && messages.len() > 2,
        "{messages:?}"
    );

    // A second program on the same socket.
    let second = palpate(folder.path(), "serve --settings palpate.toml").output()?;
    let said = String::from_utf8_lossy(&second.stderr).into_owned();
    assert!(
        second.status.code() == Some(1) && said.contains("another palpate serve answers there"),
        "{said}"
    );

    // A wrong configuration is refused, and the run goes on.
    settings(folder.path(), "tick.priority = 1000")?;
    served.signal("HUP")?;
    until("the refusal", || {
        served
            .said()
            .contains("tick.priority: found 1000")
            .then_some(())
    })?;
    settings(folder.path(), "")?;
    let before = status["ticks"].as_u64().unwrap_or(0);
    let status = served.wait_for("running", before + 500)?;
    assert!(
        status["last_failure"]
            .as_str()
            .is_some_and(|failure| failure.contains("found 1000"))
    );
    assert!(
        heard(&manager)
            .iter()
            .all(|message| message == "WATCHDOG=1")
    );

    // A report while it serves has its answer, and the ticks so far.
    let packed = bugreport::palpate(
        folder.path(),
        "bugreport packed.tar --settings palpate.toml",
    );
    assert_eq!(packed.status.code(), Some(0));
    let files = bugreport::files(&folder.path().join("packed.tar"));
    let answer: Value = serde_json::from_slice(&files["status.json"])?;
    assert_eq!(answer["state"], "running");
    fs::write(folder.path().join("packed.mcap"), &files["log.mcap"])?;
    replays(folder.path(), "packed.mcap")?;

    // A right one begins another run, with logs of its own.
    served.signal("HUP")?;
    let mut messages = Vec::new();
    until("the next run", || {
        messages.extend(heard(&manager));
        messages
            .iter()
            .any(|message| message.starts_with("READY=1"))
            .then_some(())
    })?;
    let order: Vec<_> = messages
        .iter()
        .filter(|message| *message != "WATCHDOG=1")
        .collect();
    assert!(
        order[0] == "RELOADING=1" && order[1].starts_with("READY=1"),
        "{order:?}"
    );
    served.wait_for("running", 200)?;
    assert_eq!(served.end()?, Some(0));
    assert!(
        heard(&manager)
            .iter()
            .any(|message| message == "STOPPING=1")
    );
    let logs = logs(folder.path())?;
    assert_eq!(
        logs,
        ["palpate-000001-0001.mcap", "palpate-000002-0001.mcap"]
    );
    for log in &logs {
        replays(folder.path(), log)?;
    }
    assert!(!folder.path().join("status.sock").exists());
    let asked = palpate(folder.path(), "status --settings palpate.toml").output()?;
    assert_eq!(asked.status.code(), Some(1), "nobody answers");
    Ok(())
}

#[test]
fn a_service_waits_for_its_device_and_says_so_once() -> Outcome {
    let folder = tempfile::tempdir()?;
    let manager = manager(folder.path())?;
    // A port that is free now.
    let port = std::net::TcpListener::bind("localhost:0")?
        .local_addr()?
        .port();
    let scene =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/press.toml"))?;
    let device = "serve.scene = \"scene.toml\"\nserve.log = false";
    let connected = scene.replacen(
        "[[device]]\n",
        &format!("[[device]]\nconnect = \"tcp:localhost:{port}\"\n"),
        1,
    );
    // A real device has no hand of the scene.
    let without_hand: String = connected
        .split("[device.hand]")
        .next()
        .unwrap_or_default()
        .to_owned();
    fs::write(folder.path().join("scene.toml"), without_hand)?;
    let served = Served::begin(folder.path(), device)?;
    let status = served.wait_for("waiting", 0)?;
    assert!(
        status["last_failure"]
            .as_str()
            .is_some_and(|failure| failure.contains("Connection refused")),
        "{status}"
    );
    sleep(Duration::from_secs(1));
    let messages = heard(&manager);
    assert!(
        messages
            .iter()
            .all(|message| message.starts_with("EXTEND_TIMEOUT_USEC=")),
        "{messages:?}"
    );
    assert_eq!(
        served.said().matches("tries again").count(),
        1,
        "{}",
        served.said()
    );
    // The device comes, is unplugged, and comes again, while the same run goes on.
    let mut ticks = 300;
    for round in 0..3 {
        let emulator = Emulator::begin(folder.path(), port)?;
        let fresh = |wanted: bool, least: u64| {
            until("the device's state", || {
                let (status, _) = served.status()?;
                let ticks = status["ticks"].as_u64()?;
                let found = status["state"] == "running" && ticks >= least;
                (found && status["devices"][0]["fresh"] == wanted).then_some(ticks)
            })
        };
        ticks = fresh(true, ticks).map_err(|error| format!("round {round}: {error}"))?;
        drop(emulator);
        ticks = fresh(false, ticks)?;
    }
    assert_eq!(served.end()?, Some(0));
    assert!(logs(folder.path())?.is_empty());
    Ok(())
}

#[test]
fn a_service_that_is_killed_loses_no_log() -> Outcome {
    let folder = tempfile::tempdir()?;
    for (round, ticks) in [700, 1100, 900].into_iter().enumerate() {
        let mut served = Served::begin(folder.path(), "serve.file_minutes = 1")?;
        served.wait_for("running", ticks)?;
        served.signal("KILL")?;
        served.child.wait()?;
        let logs = logs(folder.path())?;
        assert_eq!(logs.len(), round + 1);
        for log in &logs {
            replays(folder.path(), log)?;
        }
    }
    Ok(())
}

/// A limit on the size of files takes the place of a full disk: the write that crosses the limit fails.
#[test]
fn a_service_waits_for_room_and_goes_on_without_a_log_when_there_is_none_left() -> Outcome {
    let folder = tempfile::tempdir()?;
    let limited = |command: Command| {
        let mut shell = Command::new("sh");
        shell
            .args(["-c", r#"ulimit -S -f 8; exec "$0" "$@""#])
            .arg(command.get_program())
            .args(command.get_args())
            .current_dir(folder.path());
        shell
    };
    let served = Served::begin_as(folder.path(), "", limited)?;
    let status = served.wait_for("waiting", 0)?;
    let failure = status["last_failure"].as_str().unwrap_or_default();
    assert!(failure.contains("palpate-000001-0001.mcap"), "{status}");
    // An attempt under way has a file; earlier attempts have left none, or the numbers would go up.
    sleep(Duration::from_secs(1));
    let left = logs(folder.path())?;
    assert!(
        left.iter().all(|log| log == "palpate-000001-0001.mcap"),
        "{left:?}"
    );
    served.room("unlimited")?;
    served.wait_for("running", 1500)?;

    served.room("4096")?;
    until("the message", || {
        let (status, _) = served.status()?;
        let failure = status["last_failure"].as_str()?;
        (status["state"] == "running" && failure.contains("not in the log")).then_some(())
    })?;
    served.room("unlimited")?;
    until("the second message", || {
        served.said().contains("caught up").then_some(())
    })?;
    assert_eq!(served.said().matches("not in the log").count(), 1);
    assert_eq!(served.end()?, Some(0));
    let logs = logs(folder.path())?;
    assert_eq!(logs.len(), 2, "{logs:?}");
    for log in &logs {
        let log = host::log::Log::parse(&fs::read(folder.path().join(log))?)?;
        assert!(log.rows.len() > 100);
    }
    Ok(())
}

#[test]
fn wrong_settings_end_the_program_before_it_serves() -> Outcome {
    let folder = tempfile::tempdir()?;
    for (more, says) in [
        ("serve.scene = \"none.toml\"", "none.toml"),
        ("serve.file_mib = 0", "serve.file_mib"),
        ("tick.core = 4000", "tick.core: found 4000"),
    ] {
        settings(folder.path(), more)?;
        let output = palpate(folder.path(), "serve --settings palpate.toml").output()?;
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            output.status.code() == Some(2) && said.contains(says),
            "{more}: {said}"
        );
    }
    settings(folder.path(), "log.folder = \"/nowhere/at/all\"")?;
    let mut command = palpate(folder.path(), "serve --settings palpate.toml");
    command
        .env("NOTIFY_SOCKET", "/nowhere")
        .stdout(Stdio::null());
    let mut child = command.stderr(Stdio::piped()).spawn()?;
    sleep(Duration::from_secs(2));
    let _ = child.kill();
    let said = String::from_utf8_lossy(&child.wait_with_output()?.stderr).into_owned();
    assert!(said.contains("log.folder"), "{said}");
    Ok(())
}
