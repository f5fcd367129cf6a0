//! Playback of a sheet that tears: at every moment, forwards and backwards, the displays have the surface of the vertices.

use host::live::{EventKind, Frame, Message};
use host::run::{Clock, RunOptions, run};
use host::scene::Scene;
use host::world::World;
use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::path::Path;
use std::time::Instant;
use view::feed::{Command, Feed};
use view::playback::Player;
use view::terminal::Model;

type Outcome = Result<(), Box<dyn Error>>;

/// Writes a log of a sheet that two hands tear.
fn log(path: &Path) -> Outcome {
    let text = include_str!("../../tests/scenes/small_tear.toml");
    let scene = Scene::load_texts("small_tear.toml", text, &BTreeMap::new())?;
    let options = RunOptions {
        log: Some(path.to_owned()),
        log_frames: Some(100.0),
        ..RunOptions::new(Clock::Virtual)
    };
    let summary = run(&World::new(&scene).unwrap(), &options, &mut |_| {})?;
    assert_eq!(summary.failures, Vec::<String>::new());
    assert!(summary.tears[0].edges > 5);
    Ok(())
}

/// Gives a display all messages that wait, and the frames among them to `see`.
fn show(
    player: &mut Player<std::fs::File>,
    display: &mut Model,
    mut see: impl FnMut(&Frame),
) -> Outcome {
    while let Some(message) = player.take()? {
        if let Message::Frame(frame) = &message {
            see(frame);
        }
        display.take(message, Instant::now());
    }
    Ok(())
}

#[test]
fn a_torn_sheet_is_drawn_as_it_was_at_every_moment_of_its_log() -> Outcome {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    log(&path)?;
    let mut player = Player::open(&path, |_| {})?;
    // Stresses are those of the scene's elements: a torn sheet is shown without them.
    player.command(&Command::Stress { on: true });
    let mut display = Model::default();
    for message in player.present() {
        display.take(message, Instant::now());
    }
    let (mut seen, mut stressed, mut told) = (BTreeMap::new(), BTreeSet::new(), Vec::new());
    let forwards = (0..60_u64).map(|number| 10_000_000 * number);
    for at in forwards.clone().chain(forwards.rev()) {
        player.command(&Command::Seek { time_ns: at });
        show(&mut player, &mut display, |frame| {
            if let Some(vertices) = &frame.bodies[0].vertices {
                stressed.insert((vertices.epoch > 0, vertices.stressed));
            }
            told.extend(frame.events.iter().map(|event| event.kind));
        })?;
        let (surface, positions) = display.body(0).ok_or(format!("no body at {at} ns"))?;
        let shape = (surface.clone(), positions.to_vec());
        // The same moment is the same shape, from wherever one comes.
        let before = seen.entry(at).or_insert_with(|| shape.clone());
        assert!(*before == shape, "{at} ns");
        // A display that joins now sees the same.
        let mut other = Model::default();
        for message in player.present() {
            other.take(message, Instant::now());
        }
        let (surface, positions) = other.body(0).ok_or(format!("no body at {at} ns"))?;
        assert!(*surface == shape.0 && positions == shape.1, "{at} ns");
    }
    let epochs: BTreeSet<u32> = seen.values().map(|(surface, _)| surface.epoch).collect();
    assert!(epochs.len() > 3, "{epochs:?}");
    // No stress is shown once the sheet has torn.
    assert!(stressed.contains(&(false, true)) && stressed.contains(&(true, false)));
    assert!(!stressed.contains(&(true, true)), "{stressed:?}");
    let (first, last) = (&seen[&0].0, &seen[&590_000_000].0);
    assert!(last.vertices > first.vertices);

    // The picture of the moment shows the torn sheet, and the way to the next event leads to the tear.
    let shown = display.shown().ok_or("a moment")?;
    assert!(shown.still().picture().svg().contains("<svg"));
    player.command(&Command::Seek { time_ns: 0 });
    show(&mut player, &mut display, |_| {})?;
    for _ in 0..20 {
        player.command(&Command::Next);
    }
    show(&mut player, &mut display, |frame| {
        told.extend(frame.events.iter().map(|event| event.kind));
    })?;
    assert!(told.contains(&EventKind::Tear), "{told:?}");
    Ok(())
}
