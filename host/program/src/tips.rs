//! Messages with the command line that the writer probably meant, for a line that the program would read in another sense, or
//! refuse without the remedy.

use clap::builder::PossibleValue;
use clap::{Arg, Command};
use std::path::Path;

/// Tells in a message what the arguments `given` after the name of the program probably mean; `None` if the line is
/// as it should be, or wrong in a way for which clap has the right words.
pub(super) fn tip(program: &Command, given: &[String]) -> Option<String> {
    no_command(program, given).or_else(|| {
        let command = command_of(program, given);
        let pairs = given
            .iter()
            .zip(given.iter().skip(1).map(Some).chain([None]));
        { pairs }.find_map(|(word, next)| {
            one_dash(command, word)
                .or_else(|| socket_or_port(word, next))
                .or_else(|| attached(command, word, next?))
                .or_else(|| listed(command, word, given))
        })
    })
}

/// The command that the words name, or the command of a command.
fn command_of<'a>(program: &'a Command, given: &[String]) -> &'a Command {
    given.iter().fold(program, |command, word| {
        command.find_subcommand(word).unwrap_or(command)
    })
}

/// A file without a command, or a name of a command that others have.
fn no_command(program: &Command, given: &[String]) -> Option<String> {
    let first = given.first()?;
    if first.starts_with('-') || program.find_subcommand(first).is_some() {
        return None;
    }
    let file = given.get(1).map_or("FILE", String::as_str);
    if first == "replay" {
        return Some(format!(
            "found the command replay, allowed: `palpate run --replay {file}` runs the ticks of a log again, and `palpate \
             view {file}` plays a log back"
        ));
    }
    let ending = Path::new(first).extension()?;
    if ending == "toml" {
        return Some(format!(
            "found the scene {first} without a command, allowed: a command first, such as `palpate run {first}`"
        ));
    }
    (ending == "mcap").then(|| {
        format!(
            "found the log {first} without a command, allowed: a command first, such as `palpate view {first}` or `palpate \
             run --replay {first}`"
        )
    })
}

/// The option of a command by the word of a command line, such as `--plot` or `--plot=FILE`.
fn option<'a>(command: &'a Command, word: &str) -> Option<&'a Arg> {
    let name = word.strip_prefix("--")?.split('=').next()?;
    command
        .get_arguments()
        .find(|argument| argument.get_long() == Some(name))
}

/// An option with one dash.
fn one_dash(command: &Command, word: &str) -> Option<String> {
    let long = format!("-{word}");
    let argument = word.starts_with('-').then(|| option(command, &long))??;
    let name = argument.get_long()?;
    (word.len() > 2).then(|| format!("found -{name}, allowed: --{name}, with two dashes"))
}

/// The port of a page in the place of the socket of a run.
fn socket_or_port(word: &str, next: Option<&String>) -> Option<String> {
    let port = match (word, next) {
        ("--view", Some(next)) => next,
        _ => word.strip_prefix("--view=")?,
    };
    port.parse::<u16>().ok().map(|port| {
        format!(
            "found the port {port} of --view, allowed: --view alone or with the path of a socket; then `palpate view \
             --web={port}` shows the run on a page at this port"
        )
    })
}

/// An option whose optional value must follow the equals sign, and a value after a blank.
fn attached(command: &Command, word: &str, next: &str) -> Option<String> {
    let argument = option(command, word).filter(|argument| argument.is_require_equals_set())?;
    let is_value = next.parse::<u16>().is_ok() || is_named(argument, next);
    let apart = is_value && !word.contains('=');
    apart.then(|| format!("found {word} {next}, allowed: {word}={next}"))
}

fn is_named(argument: &Arg, word: &str) -> bool {
    let names: Vec<PossibleValue> = argument.get_possible_values();
    names.iter().any(|name| name.matches(word, false))
}

/// Values of a list with blanks between them.
fn listed(command: &Command, word: &str, given: &[String]) -> Option<String> {
    let argument = option(command, word)
        .filter(|argument| argument.get_value_delimiter() == Some(',') && !word.contains('='))?;
    let at = given.iter().position(|other| other == word)?;
    let words = given[at + 1..]
        .iter()
        .take_while(|word| !word.starts_with('-'));
    // A scene may follow: its name is a path.
    let words: Vec<&str> = words
        .map(|word| word.trim_matches(','))
        .take_while(|word| {
            let is_path = word.contains(['/', '.']) || Path::new(word).exists();
            !is_path || word.parse::<f64>().is_ok()
        })
        .collect();
    let name = argument.get_long()?;
    (words.len() > 1).then(|| {
        format!(
            "found --{name} {}, allowed: values with commas and without blanks, --{name} {}",
            words.join(" "),
            words.join(",")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn told(line: &str) -> Option<String> {
        let given: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        tip(&crate::Arguments::command(), &given)
    }

    #[test]
    fn what_was_meant_is_told() {
        for (line, meant) in [
            ("replay a.mcap", "`palpate run --replay a.mcap`"),
            ("a.toml", "`palpate run a.toml`"),
            ("a.mcap", "`palpate view a.mcap`"),
            ("run a.toml -plot b.svg", "--plot, with two dashes"),
            ("run a.toml --strict syscalls", "--strict=syscalls"),
            ("compare --schemes hold thesis", "--schemes hold,thesis"),
            (
                "compare a.toml --schemes hold, thesis --json c.json",
                "--schemes hold,thesis",
            ),
            ("stress scene a.toml --rate 60 90", "--rate 60,90"),
        ] {
            let told = told(line).unwrap_or_else(|| panic!("{line}: nothing is told"));
            assert!(told.contains(meant), "{line}: {told}");
        }
    }

    #[test]
    fn nothing_is_told_of_a_line_that_is_right() {
        for line in [
            "",
            "run",
            "run a.toml --plot b.svg --seed 7",
            "run --strict a.toml",
            "run --rate 1000 a.toml",
            "compare --schemes hold,thesis a.toml",
            "compare --schemes hold dir/a",
            "stress scene a.toml --rate 60,90 --trouble nothing",
            "device list",
            "-h",
            "--version",
        ] {
            assert_eq!(told(line), None, "{line}");
        }
    }

    #[cfg(feature = "view")]
    #[test]
    fn a_port_is_told_from_a_socket() {
        for (line, meant) in [
            ("view --web 8400", "--web=8400"),
            ("run --view=8400", "`palpate view --web=8400`"),
            ("run --view 8400", "`palpate view --web=8400`"),
        ] {
            assert!(
                told(line).is_some_and(|told| told.contains(meant)),
                "{line}"
            );
        }
        for line in [
            "view --web",
            "view a.mcap --web=8400",
            "run --view",
            "run --view=a.sock",
        ] {
            assert_eq!(told(line), None, "{line}");
        }
    }
}
