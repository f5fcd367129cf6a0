//! What a run that was killed leaves in the folder of its frames, and what the next run makes of it.

use std::collections::BTreeSet;
use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

const PALPATE: &str = env!("CARGO_BIN_EXE_palpate");

/// Frames that are there before the kill.
const FRAMES: usize = 40;

/// The names in a folder that end so.
fn names(folder: &Path, end: &str) -> Result<BTreeSet<String>, Box<dyn Error>> {
    let entries = fs::read_dir(folder)?;
    let names = entries.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
    let names: Vec<String> = names.collect::<Result<_, std::io::Error>>()?;
    Ok(names
        .into_iter()
        .filter(|name| name.ends_with(end))
        .collect())
}

/// The frames that a list names.
fn listed(folder: &Path) -> Result<BTreeSet<String>, Box<dyn Error>> {
    let list = fs::read_to_string(folder.join("frames.pvd"))?;
    assert!(list.ends_with("</Collection>\n</VTKFile>\n"), "{list}");
    let files = list.split("file=\"").skip(1);
    let names = files.filter_map(|file| Some(file.split_once('"')?.0.to_owned()));
    Ok(names.collect())
}

#[test]
fn a_killed_run_has_listed_its_frames_and_the_next_run_clears_up() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let out = folder.path().join("out");
    let run = |duration: &str| {
        let mut command = Command::new(PALPATE);
        command
            .args([
                "run",
                "--duration",
                duration,
                "--vtu",
                "out",
                "--json",
                "run.json",
            ])
            .current_dir(folder.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        command
    };
    let mut child = run("80000").spawn()?;
    while !out.is_dir() || names(&out, ".vtu")?.len() < FRAMES {
        assert!(child.try_wait()?.is_none(), "the run ended");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    child.kill()?;
    child.wait()?;
    let (there, listed_then) = (names(&out, ".vtu")?, listed(&out)?);
    assert!(listed_then.is_subset(&there), "{listed_then:?} {there:?}");
    // The kill may come between a frame and its line.
    assert!(
        listed_then.len() + 1 >= there.len(),
        "{listed_then:?} {there:?}"
    );
    // The kill may come between the beginning and the end of a frame.
    fs::write(out.join(".palpate-x1y2.tmp"), "half a frame")?;
    assert!(run("0.1").status()?.success());
    for place in [folder.path(), &out] {
        let hidden = fs::read_dir(place)?
            .flatten()
            .map(|entry| entry.file_name());
        let hidden: Vec<_> = hidden
            .filter(|name| name.to_string_lossy().starts_with('.'))
            .collect();
        assert!(hidden.is_empty(), "{hidden:?}");
    }
    // The list is that of the new run: 25 frames a second, and the frame at the start.
    assert_eq!(listed(&out)?.len(), 3);
    Ok(())
}
