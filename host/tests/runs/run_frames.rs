//! Frames of a run: the deformed bodies at exact times, without an effect on the run.

use host::engine::faults::{FaultKind, HostFault};
use host::run::frames::FrameOptions;
use host::run::{Clock, RunOptions, run};
use host::scene::Scene;
use host::world::World;
use meshio::read_mesh;
use physics::mesh::Mesh;
use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::path::Path;

type Outcome = Result<(), Box<dyn Error>>;

/// Times and files of the list.
fn list(folder: &Path) -> Result<Vec<(f64, String)>, Box<dyn Error>> {
    let text = fs::read_to_string(folder.join("frames.pvd"))?;
    let quoted = |line: &str, name: &str| -> Option<String> {
        let (_, rest) = line.split_once(&format!("{name}=\""))?;
        rest.split_once('"').map(|(value, _)| value.to_owned())
    };
    let sets = text.lines().filter(|line| line.starts_with("<DataSet"));
    sets.map(|line| {
        let time = quoted(line, "timestep").ok_or("no time")?;
        let file = quoted(line, "file").ok_or("no file")?;
        Ok((time.parse()?, file))
    })
    .collect()
}

fn options(folder: &Path, rate: f64) -> RunOptions {
    let mut options = RunOptions::new(Clock::Virtual);
    options.duration = Some(0.5);
    options.log = Some(folder.with_extension("mcap"));
    options.frames = Some(FrameOptions {
        folder: folder.to_owned(),
        rate,
    });
    options
}

#[test]
fn frames_come_at_exact_times_and_do_not_disturb_the_run() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    // The host makes 250 steps a second.
    for (name, rate, every) in [("all", 250.0, 0.004), ("some", 50.0, 0.02)] {
        let summary = run(
            &World::new(&loaded).unwrap(),
            &options(&at(name), rate),
            &mut |_| (),
        )?;
        assert!(summary.failures.is_empty(), "{:?}", summary.failures);
        assert!(
            summary.degradations.is_empty(),
            "{:?}",
            summary.degradations
        );
        let frames = list(&at(name))?;
        // The step at 0.5 s would follow the last tick.
        assert_eq!(frames.len() as f64, rate * 0.5, "{name}");
        for (number, (time, file)) in frames.iter().enumerate() {
            assert_eq!(*file, format!("sheet_{number:04}.vtu"));
            assert!((time - every * number as f64).abs() < 1e-9, "{time}");
        }
    }
    // A rate that does not divide that of the steps takes the first step after the time.
    run(
        &World::new(&loaded).unwrap(),
        &options(&at("odd"), 60.0),
        &mut |_| (),
    )?;
    let odd: Vec<f64> = list(&at("odd"))?.iter().map(|frame| frame.0).collect();
    assert_eq!(odd[..5], [0.0, 0.02, 0.036, 0.052, 0.068]);

    // The frames of one time are the same bytes, and the log is that of a run without frames.
    for (one, other) in [
        ("all/sheet_0100.vtu", "some/sheet_0020.vtu"),
        ("all.mcap", "some.mcap"),
    ] {
        assert!(fs::read(at(one))? == fs::read(at(other))?, "{one} {other}");
    }
    let plain = RunOptions {
        duration: Some(0.5),
        log: Some(at("plain.mcap")),
        ..RunOptions::new(Clock::Virtual)
    };
    run(&World::new(&loaded).unwrap(), &plain, &mut |_| ())?;
    assert!(fs::read(at("plain.mcap"))? == fs::read(at("all.mcap"))?);
    Ok(())
}

/// The edges that the hands hold are where the frame shows them: the sheet is stretched when the hands have moved apart.
#[test]
fn a_frame_shows_the_deformed_body() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let folder = tempfile::tempdir()?;
    let mut options = options(&folder.path().join("out"), 10.0);
    options.duration = Some(1.6);
    run(&World::new(&loaded).unwrap(), &options, &mut |_| ())?;
    let length = |number: usize| -> Result<f64, Box<dyn Error>> {
        let name = format!("sheet_{number:04}.vtu");
        let bytes = fs::read(folder.path().join("out").join(&name))?;
        let Mesh::Sheet(mesh) = read_mesh(&name, &bytes)? else {
            return Err("no sheet".into());
        };
        let x = mesh.positions.iter().map(|p| p.x);
        Ok(x.clone().fold(f64::MIN, f64::max) - x.fold(f64::MAX, f64::min))
    };
    assert!((length(0)? - 0.2).abs() < 1e-3, "{}", length(0)?);
    // Each hand has pulled by 16 mm, less what its grip yields.
    let stretched = length(15)? - length(0)?;
    assert!((0.01..0.035).contains(&stretched), "{stretched}");
    let text = fs::read_to_string(folder.path().join("out/sheet_0015.vtu"))?;
    for field in [
        "displacement",
        "velocity",
        "von_mises",
        "stress_top",
        "young",
    ] {
        assert!(text.contains(&format!("Name=\"{field}\"")), "{field}");
    }
    Ok(())
}

#[test]
fn a_rate_above_that_of_the_steps_is_refused() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let folder = tempfile::tempdir()?;
    for rate in [0.0, f64::NAN, 250.1] {
        let error = run(
            &World::new(&loaded).unwrap(),
            &options(&folder.path().join("out"), rate),
            &mut |_| (),
        );
        let error = error.err().map(|e| e.to_string()).unwrap_or_default();
        assert_eq!(
            error,
            format!(
                "--frames: found {rate}, allowed: a number above 0 and up to host.step_rate, which is 250 (Hz)"
            )
        );
    }
    Ok(())
}

/// A host that ends early leaves the frames up to then, and the run ends in order.
#[test]
fn the_frames_end_with_the_host() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let folder = tempfile::tempdir()?;
    let out = folder.path().join("out");
    let mut options = options(&out, 50.0);
    options.faults = vec![HostFault {
        kind: FaultKind::Panic,
        at: 0.2,
        duration: 0.0,
    }];
    let summary = run(&World::new(&loaded).unwrap(), &options, &mut |_| ())?;
    assert_eq!(summary.tick.count, 500);
    let frames = list(&out)?;
    assert_eq!(frames.len(), 10, "up to 0.18 s");
    Ok(())
}

/// A frame that cannot be written ends the frames. The summary says why, and gives no other reason.
#[test]
fn a_frame_that_cannot_be_written_is_a_failure() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let folder = tempfile::tempdir()?;
    let out = folder.path().join("out");
    // No file can replace this folder.
    fs::create_dir_all(out.join("sheet_0003.vtu"))?;
    let summary = run(
        &World::new(&loaded).unwrap(),
        &options(&out, 50.0),
        &mut |_| (),
    )?;
    assert_eq!(summary.tick.count, 500);
    let [failure] = &summary.failures[..] else {
        return Err(format!("{:?}", summary.failures).into());
    };
    assert!(failure.contains("sheet_0003.vtu"), "{failure}");
    assert_eq!(summary.degradations, [""; 0]);
    assert_eq!(summary.unwritten, [out.join("frames.pvd")]);
    assert_eq!(list(&out)?.len(), 3, "those before");
    Ok(())
}

/// Under the real clock no frame is lost without a word: what is listed and what is reported are all frames.
#[test]
fn the_real_clock_counts_what_is_missing() -> Outcome {
    // Many elements at every step: the writer cannot follow.
    let text = Scene::embedded_default()?
        .source
        .text
        .replace("cells = [20, 12]", "cells = [60, 36]");
    let loaded = Scene::load_texts("fine.toml", &text, &BTreeMap::new())?;
    let folder = tempfile::tempdir()?;
    let mut options = options(&folder.path().join("out"), 250.0);
    options.clock = Clock::Real;
    let summary = run(&World::new(&loaded).unwrap(), &options, &mut |_| ())?;
    let there = list(&folder.path().join("out"))?;
    let numbers = there.iter().map(|(_, file)| {
        let number = file.trim_start_matches("sheet_").trim_end_matches(".vtu");
        number.parse::<u64>()
    });
    let numbers = numbers.collect::<Result<Vec<_>, _>>()?;
    assert!(numbers.is_sorted(), "{numbers:?}");
    let last = numbers.last().copied().unwrap_or(0);
    let holes = last + 1 - there.len() as u64;
    let said = summary.degradations.iter().find_map(|line| {
        let (_, rest) = line.split_once(" frames and lacks ")?;
        let (count, _) = rest.split_once(':')?;
        count.parse::<u64>().ok()
    });
    // Those after the last that is there are counted, too.
    assert!(said.unwrap_or(0) >= holes, "{said:?} {holes}");
    assert_eq!(numbers.first(), Some(&0));
    Ok(())
}
