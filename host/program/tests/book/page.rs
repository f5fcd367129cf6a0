//! Checks the blocks of one page, in a folder that is the page's own.

use super::markdown::{Kind, Page};
use super::root;
use super::ways::{WAYS, Way};
use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::symlink;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use toml::{Table, Value};

/// Words after which a line is not the program's arguments any more.
const ENDS: [char; 6] = ['\'', '|', '&', '#', '>', ';'];

/// The run that viewers of the book watch.
const WATCHED: &str = "run --view --duration 1.5";

/// Checks all blocks of a page, and returns what is wrong. Files that the page writes are in `folder`.
pub(super) fn check(page: &Page, folder: &Path) -> Vec<String> {
    for shared in ["host", "docs", "rt_core"] {
        symlink(root().join(shared), folder.join(shared)).unwrap();
    }
    let mut state = State {
        folder: folder.to_owned(),
        printed: String::new(),
        emulated: Vec::new(),
    };
    let mut comment = "";
    let mut faults = Vec::new();
    for part in &page.parts {
        let result = match &part.kind {
            Kind::Comment(text) => {
                comment = text;
                state.given(text)
            }
            Kind::Block(language, text) => {
                state.block(std::mem::take(&mut comment), language, text)
            }
        };
        if let Err(fault) = result {
            faults.push(format!("{}:{}: {fault}", page.name, part.line));
        }
    }
    faults
}

/// The state of a page while its blocks are checked in turn.
struct State {
    /// The folder in which the next line runs: `cd` changes it.
    folder: PathBuf,
    /// The output of the last command.
    printed: String,
    /// The emulated devices: the port in the book, the own port, and the process of each.
    emulated: Vec<(String, String, Started)>,
}

/// A command in the background, which ends with its owner.
struct Started {
    process: Child,
    /// The first line that it printed.
    says: String,
}

impl Started {
    /// Starts the program in a folder, and waits for its first line.
    fn new(folder: &Path, arguments: &str) -> Result<Self, String> {
        let mut process = program(folder)
            .args(arguments.split_whitespace())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| error.to_string())?;
        let mut says = String::new();
        if let Some(output) = process.stdout.take() {
            let read = BufReader::new(output).read_line(&mut says);
            read.map_err(|error| error.to_string())?;
        }
        Ok(Self { process, says })
    }

    /// The connection that an emulator prints.
    fn connection(&self) -> Result<&str, String> {
        let connection = self.says.trim().strip_prefix("connect = \"");
        let connection = connection.and_then(|text| text.strip_suffix('"'));
        connection.ok_or_else(|| format!("an emulator printed {:?}", self.says))
    }

    /// Ends the command by Ctrl-C. A viewer, which holds no device, may end at once.
    fn interrupt(mut self) -> Result<(), String> {
        let pid = self.process.id().to_string();
        let sent = Command::new("kill").args(["-INT", &pid]).status();
        sent.map_err(|error| error.to_string())?;
        let status = self.process.wait().map_err(|error| error.to_string())?;
        match (status.code(), status.signal()) {
            (Some(0 | 130), _) | (_, Some(2)) => Ok(()),
            _ => Err(format!("it ended with {status} after Ctrl-C")),
        }
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl State {
    /// Copies a file that the page assumes.
    fn given(&self, comment: &str) -> Result<(), String> {
        let Some((name, source)) = comment
            .strip_prefix("given: ")
            .and_then(|rest| rest.split_once(" = "))
        else {
            return Ok(());
        };
        let (source, change) = source.split_once(", ").unwrap_or((source, ""));
        let text = fs::read_to_string(root().join(source));
        let mut text = text.map_err(|error| format!("{source}: {error}"))?;
        if let Some((old, new)) = change.split_once(" -> ") {
            if !text.contains(old) {
                return Err(format!("{source} has no {old}"));
            }
            text = text.replacen(old, new, 1);
        }
        fs::write(self.folder.join(name), text).map_err(|error| format!("{name}: {error}"))
    }

    fn block(&mut self, comment: &str, language: &str, text: &str) -> Result<(), String> {
        if let Some(name) = comment.strip_prefix("file: ") {
            let path = self.folder.join(name);
            return fs::write(&path, text).map_err(|error| format!("{name}: {error}"));
        }
        if let Some(scene) = comment.strip_prefix("merged into ") {
            return self.merged(scene, text);
        }
        if comment == "prints" {
            return prints(&self.printed, text);
        }
        match language {
            "toml" => Err("a block of TOML needs a comment that says what it is".to_owned()),
            "sh" => self.lines(comment, &text.replace("\\\n", " ")),
            _ if text.starts_with("$ ") => self.session(text),
            _ => Ok(()),
        }
    }

    /// Merges fields into a scene of the sources or of the page, and loads the scene.
    fn merged(&self, target: &str, text: &str) -> Result<(), String> {
        let (name, path) = target.split_once(" at ").unwrap_or((target, ""));
        let scene = [self.folder.join(name), root().join(name)]
            .into_iter()
            .find(|path| path.exists())
            .ok_or_else(|| format!("{name} does not exist"))?;
        let base = fs::read_to_string(&scene).map_err(|error| error.to_string())?;
        let mut base: Value = Value::Table(parsed(&base)?);
        let mut place = &mut base;
        for step in path.split('.').filter(|step| !step.is_empty()) {
            place = match step.parse::<usize>() {
                Ok(index) => place.get_mut(index),
                Err(_) => place.get_mut(step),
            }
            .ok_or_else(|| format!("{name} has no {path}"))?;
        }
        merge(place, Value::Table(parsed(text)?));
        // Beside the original, so that the files it names are found.
        let folder = tempfile::tempdir().unwrap();
        for entry in fs::read_dir(scene.parent().unwrap()).unwrap().flatten() {
            symlink(entry.path(), folder.path().join(entry.file_name())).unwrap();
        }
        let merged = folder.path().join("merged.toml");
        fs::write(&merged, toml::to_string(&base).unwrap()).unwrap();
        let has_devices = base.get("device").is_some();
        let command = if has_devices { "plan" } else { "solve" };
        ends_well(&run(
            folder.path(),
            &format!("palpate {command} merged.toml"),
        ))
        .map(|_| ())
    }

    /// The lines of a shell.
    fn lines(&mut self, comment: &str, text: &str) -> Result<(), String> {
        let code = comment
            .strip_prefix("ends with ")
            .map_or(0, |code| code.parse().unwrap());
        let count = text.lines().count();
        for (index, line) in (1..).zip(text.lines()) {
            let code = if index == count { code } else { 0 };
            self.line(line.trim(), code)
                .map_err(|fault| format!("{line}: {fault}"))?;
        }
        Ok(())
    }

    /// One line of a shell, which must end with an exit code.
    fn line(&mut self, line: &str, code: i32) -> Result<(), String> {
        let line = line.trim_start_matches("PALPATE_RENEW=1 ");
        let line = without_comment(line);
        let first = line.split_whitespace().next().unwrap_or("#");
        if first.starts_with('#') || first == "alias" {
            return Ok(());
        }
        if let Some((_, way)) = WAYS.iter().find(|(listed, _)| *listed == line) {
            return self.in_its_way(line, *way);
        }
        let own = line.strip_prefix("cargo run --release");
        if let Some(arguments) = own.filter(|rest| rest.is_empty() || rest.starts_with(" -- ")) {
            let call = format!("palpate {}", arguments.trim_start_matches(" -- "));
            return self.line(&call, code);
        }
        if first == "cargo" {
            return cargo(line);
        }
        if let Some(folder) = line.strip_prefix("cd ") {
            self.folder.push(folder);
            return Ok(());
        }
        if root().join(first).is_file() {
            return Ok(());
        }
        match first {
            "palpate" | "mkdir" | "cat" | "cp" | "sed" | "awk" => {
                self.printed = ends_with(code, &run(&self.folder, &self.reached(line)))?;
                Ok(())
            }
            _ => Err("neither run nor listed in tests/book/ways.rs".to_owned()),
        }
    }

    /// The line, with the ports of the emulated devices.
    fn reached(&self, line: &str) -> String {
        let devices = self.emulated.iter();
        devices.fold(line.to_owned(), |line, (port, own, _)| {
            line.replace(&format!("localhost:{port}"), own)
        })
    }

    /// A line of the list.
    fn in_its_way(&mut self, line: &str, way: Way) -> Result<(), String> {
        let arguments = line.strip_prefix("palpate ").unwrap_or_default();
        match way {
            Way::Arguments(_) => self.arguments(line),
            Way::With(more) => self.well(&format!("{line} {more}")),
            Way::Changed(pairs) => {
                let change = |line: String, (old, new): &(&str, &str)| line.replace(old, new);
                self.well(&pairs.iter().fold(line.to_owned(), change))
            }
            Way::Served => Started::new(&self.folder, arguments)?.interrupt(),
            Way::Serving => {
                let watched = self.watched()?;
                Started::new(&self.folder, arguments)?.interrupt()?;
                watched.interrupt()
            }
            Way::Watching => {
                let watched = self.watched()?;
                self.well(line)?;
                watched.interrupt()
            }
            Way::Emulated(port) => {
                let free = arguments.replace(&format!("tcp:{port}"), "tcp");
                let started = Started::new(&self.folder, &free)?;
                let own = started.connection()?.rsplit_once("tcp:");
                let own = own.map_or("", |(_, address)| address).to_owned();
                self.emulated.push((port.to_owned(), own, started));
                Ok(())
            }
            Way::Against(place, emulator) => {
                let started = Started::new(&self.folder, &format!("device emulate {emulator}"))?;
                self.well(&line.replace(place, started.connection()?))
            }
        }
    }

    /// A run that viewers can find.
    fn watched(&self) -> Result<Started, String> {
        let mut run = program(&self.folder);
        let run = run.args(WATCHED.split(' ')).stdout(Stdio::null());
        let process = run.spawn().map_err(|error| error.to_string())?;
        // Its socket appears when the scene is built.
        let sockets = self.folder.join("palpate");
        while fs::read_dir(&sockets).map_or(0, Iterator::count) == 0 {
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        Ok(Started {
            process,
            says: String::new(),
        })
    }

    /// Runs a line that must end well.
    fn well(&mut self, line: &str) -> Result<(), String> {
        self.printed = ends_well(&run(&self.folder, &self.reached(line)))?;
        Ok(())
    }

    /// Checks the arguments of each call of the program in a line. The program checks them before `--help` has effect.
    fn arguments(&self, line: &str) -> Result<(), String> {
        for call in line.split("palpate ").skip(1) {
            let call = call.split(" :::").next().unwrap_or_default();
            let call = call.split(ENDS).next().unwrap_or_default();
            let call = call
                .replace("$SLURM_ARRAY_TASK_ID", "1")
                .replace("{}", "1")
                .replace("$seed", "1");
            ends_well(&run(&self.folder, &format!("palpate {call} --help")))?;
        }
        Ok(())
    }

    /// A line after `$ ` and all that it prints. `...` stands for any lines.
    fn session(&self, text: &str) -> Result<(), String> {
        let (line, expected) = text.split_once('\n').unwrap_or((text, ""));
        let output = run(&self.folder, line.trim_start_matches("$ "));
        let both = [output.stdout, output.stderr].concat();
        prints(&String::from_utf8_lossy(&both), expected)
    }
}

fn parsed(text: &str) -> Result<Table, String> {
    text.parse::<Table>().map_err(|error| error.to_string())
}

/// Puts the fields of `new` into `base`. Tables are merged; lists of tables are merged in their order.
fn merge(base: &mut Value, new: Value) {
    match (base, new) {
        (Value::Table(base), Value::Table(new)) => {
            for (key, value) in new {
                match base.get_mut(&key) {
                    Some(old) => merge(old, value),
                    None => {
                        base.insert(key, value);
                    }
                }
            }
        }
        (Value::Array(base), Value::Array(new)) if new.iter().all(Value::is_table) => {
            for (index, value) in new.into_iter().enumerate() {
                match base.get_mut(index) {
                    Some(old) => merge(old, value),
                    None => base.push(value),
                }
            }
        }
        // A fragment may name one of a list as its table: `[device.mounting]` is that of the first device.
        (Value::Array(base), new @ Value::Table(_)) if !base.is_empty() => merge(&mut base[0], new),
        (base, new) => *base = new,
    }
}

/// The line without the comment at its end.
fn without_comment(line: &str) -> &str {
    line.split(" #").next().unwrap_or_default().trim()
}

/// The program in a folder, in which its sockets are, too.
fn program(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command.env("XDG_RUNTIME_DIR", folder).current_dir(folder);
    command
}

/// Runs a line in a shell that finds the program under its name.
fn run(folder: &Path, line: &str) -> Output {
    let program = Path::new(env!("CARGO_BIN_EXE_palpate")).parent().unwrap();
    let path = std::env::var("PATH").unwrap_or_default();
    Command::new("sh")
        .args(["-c", line])
        .env("PATH", format!("{}:{path}", program.display()))
        .env("XDG_RUNTIME_DIR", folder)
        .current_dir(folder)
        .output()
        .unwrap()
}

/// What a command printed, if it ended well.
fn ends_well(output: &Output) -> Result<String, String> {
    ends_with(0, output)
}

/// What a command printed, if it ended with this exit code. A probe of a device may end with either verdict: a busy machine
/// misses states.
fn ends_with(code: i32, output: &Output) -> Result<String, String> {
    let says = String::from_utf8_lossy(&output.stderr);
    let judged = says.contains("the device is not ready for a run; the verdict above says why");
    if output.status.code() == Some(if judged { 1 } else { code }) {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        Err(format!("{}: {}", output.status, says.trim()))
    }
}

/// Checks that a line of `cargo` names targets that exist.
fn cargo(line: &str) -> Result<(), String> {
    let words: Vec<&str> = line
        .split('#')
        .next()
        .unwrap_or_default()
        .split_whitespace()
        .collect();
    let folders = [
        "host/program",
        "host",
        "host/physics",
        "host/study",
        "rt_core",
        "rt_core/runner",
        "sim",
        "tests/qemu_board",
        "tests",
    ];
    for pair in words.windows(2) {
        let kind = match pair[0] {
            "--example" => "examples",
            "--bench" => "benches",
            "--test" => "tests",
            _ => continue,
        };
        let exists = |folder: &&str| {
            let of = root().join(folder).join(kind).join(pair[1]);
            of.with_extension("rs").is_file() || of.join("main.rs").is_file()
        };
        if !folders.iter().any(exists) {
            return Err(format!("{line}: there is no {} {}", &pair[0][2..], pair[1]));
        }
    }
    Ok(())
}

/// Checks that a text contains the expected lines one after the other; `...` stands for any lines, and at the
/// end of a line for any text.
fn prints(text: &str, expected: &str) -> Result<(), String> {
    let lines: Vec<String> = text.lines().map(without_times).collect();
    let mut at = 0;
    let mut anywhere = true;
    for line in expected.lines() {
        let wanted = without_times(line);
        if wanted.trim() == "..." {
            anywhere = true;
            continue;
        }
        let rest = lines.get(at..).unwrap_or_default();
        let is_wanted = |line: &String| match wanted.strip_suffix("...") {
            Some(start) => line.starts_with(start),
            None => *line == wanted,
        };
        let found = if anywhere {
            rest.iter().position(is_wanted)
        } else {
            rest.first().filter(|line| is_wanted(line)).map(|_| 0)
        };
        let Some(found) = found else {
            return Err(format!("expected the line\n{line}\nin\n{text}"));
        };
        at += found + 1;
        anywhere = false;
    }
    Ok(())
}

/// A line without measured times and without trailing blanks: `73.9 us` and `0.12 s` become `#`.
fn without_times(line: &str) -> String {
    let mut words: Vec<&str> = Vec::new();
    for word in line.trim_end().split(' ') {
        let unit = word.trim_end_matches([',', ')', ';']);
        let last = words.last().copied().unwrap_or_default();
        let number = last.trim_start_matches('(').parse::<f64>().is_ok();
        if ["ns", "us", "ms"].contains(&unit) && number {
            words.pop();
            words.push("#");
        } else {
            words.push(word);
        }
    }
    words.join(" ")
}
