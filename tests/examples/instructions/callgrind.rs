//! Counts by valgrind's callgrind: one dump for each call of the counted function.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The count of one call.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Count {
    /// Instructions in the program's own code.
    pub(crate) instructions: u64,
    /// Calls out of the program. The law calls only the memory copies of the C library (`tests/no_panic.rs` proves
    /// this); the host's step calls these and its fills. The C library selects the fastest version for the processor,
    /// so their instructions are not counted.
    pub(crate) copies: u64,
}

/// Whether valgrind is installed.
pub(crate) fn available() -> bool {
    Command::new("valgrind")
        .arg("--version")
        .stdout(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Runs `program argument` and counts each call of `function`, in the order of the calls. Also returns the output of
/// the program.
///
/// # Errors
/// A message that states the failure.
pub(crate) fn count(
    program: &Path,
    argument: &str,
    function: &str,
) -> Result<(Vec<Count>, String), String> {
    let folder = tempfile::tempdir().map_err(|e| format!("no folder for valgrind: {e}"))?;
    let out = folder.path().join("call");
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--dump-instr=yes"])
        .args(["--compress-pos=no", "--compress-strings=no"])
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(format!("--toggle-collect={function}"))
        .arg(format!("--dump-after={function}"))
        .arg(program)
        .arg(argument)
        // The dynamic linker resolves every function before the first call, not during a call.
        .env("LD_BIND_NOW", "1")
        .output()
        .map_err(|e| format!("valgrind does not run: {e}"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(format!("valgrind failed:\n{said}"));
    }
    let counts = (1..)
        .map(|part| PathBuf::from(format!("{}.{part}", out.display())))
        .take_while(|dump| dump.exists())
        .map(|dump| {
            let text = fs::read_to_string(&dump).map_err(|e| format!("{}: {e}", dump.display()))?;
            parse(&text, program).ok_or_else(|| format!("{}: not a dump", dump.display()))
        })
        .collect::<Result<_, String>>()?;
    Ok((counts, String::from_utf8_lossy(&output.stdout).into_owned()))
}

/// Reads a dump: the instructions of the functions in `program`, and the number of calls out of it.
///
/// `ob=` names the file of the functions after it. `cob=` names the file of the function to which the next `calls=`
/// refers (the same file if there is no `cob=`). Each line of costs is an address, a line number and the number of
/// executions of the instruction at the address. The line after `calls=` has the address of the call and the cost
/// inside the call, which is counted in the called function. The number of executions of a call is taken from its
/// address, because the number after `calls=` includes calls outside the collected part.
pub(crate) fn parse(text: &str, program: &Path) -> Option<Count> {
    let program = program.to_str()?;
    let mut executed = BTreeMap::<&str, u64>::new();
    let mut calls_out = BTreeSet::new();
    let (mut inside, mut called, mut after_calls) = (false, None, false);
    for line in text.lines() {
        if let Some(path) = line.strip_prefix("ob=") {
            inside = path == program;
        } else if let Some(path) = line.strip_prefix("cob=") {
            called = Some(path == program);
        } else if line.starts_with("calls=") {
            after_calls = true;
        } else if line.starts_with("0x") {
            let mut fields = line.split(' ');
            let (address, cost) = (fields.next()?, fields.nth(1)?.parse::<u64>().ok()?);
            if after_calls {
                if inside && called == Some(false) {
                    calls_out.insert(address);
                }
                (called, after_calls) = (None, false);
            } else if inside {
                *executed.entry(address).or_default() += cost;
            }
        }
    }
    let count = Count {
        instructions: executed.values().sum(),
        copies: calls_out.iter().filter_map(|at| executed.get(at)).sum(),
    };
    (count.instructions > 0).then_some(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn own_instructions_and_calls_out_are_counted_and_nothing_else() {
        let dump = "positions: instr line\nevents: Ir\n\
            ob=/bin/law\nfn=tick\n0x10 10 5\n0x13 11 4\n\
            cfn=inner\ncalls=1 0x40 20\n0x13 11 30\n\
            0x18 12 3\ncob=/lib/libc.so\ncfn=memcpy\ncalls=900 0x70 0\n0x18 12 400\n\n\
            fn=inner\n0x40 20 30\n\n\
            ob=/lib/libc.so\nfn=memcpy\n0x70 0 400\n\n\
            totals: 442\n";
        let found = parse(dump, Path::new("/bin/law"));
        let expected = Count {
            instructions: 5 + 4 + 3 + 30,
            copies: 3,
        };
        assert_eq!(found, Some(expected));
    }

    #[test]
    fn an_empty_dump_is_no_count() {
        assert_eq!(parse("events: Ir\n", Path::new("/bin/law")), None);
    }
}
