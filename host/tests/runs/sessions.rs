//! Sessions side by side, and after a panic of the host.

use host::engine::faults::{FaultKind, HostFault};
use host::run::prepare::Options;
use host::run::session::Session;
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::coupling::HostState;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

/// A shipped scene whose steps are shared by this number of threads.
fn scene(name: &str, threads: usize) -> Result<LoadedScene, Box<dyn Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../scenes")
        .join(name);
    let text = std::fs::read_to_string(path)?;
    let text = text.replacen("[host]\n", &format!("[host]\nthreads = {threads}\n"), 1);
    Ok(Scene::load_texts(name, &text, &BTreeMap::new())?)
}

/// The bits of the forces and of the models' sequence numbers in a tick.
fn bits(session: &mut Session) -> Option<Vec<u64>> {
    let telemetry = session.tick()?;
    let forces = telemetry.devices.iter().map(|device| device.wrench.force);
    let forces = forces.flat_map(|force| [force.x, force.y, force.z].map(f64::to_bits));
    let models = telemetry.bodies.iter().map(|body| body.sequence);
    Some(forces.chain(models).collect())
}

fn all(session: &mut Session) -> Vec<Vec<u64>> {
    std::iter::from_fn(|| bits(session)).collect()
}

#[test]
fn sessions_side_by_side_give_the_bytes_of_sessions_alone() -> Result<(), Box<dyn Error>> {
    let scenes = [scene("stretch.toml", 2)?, scene("press.toml", 1)?];
    let worlds = [World::new(&scenes[0])?, World::new(&scenes[1])?];
    let begin = |number: usize| {
        let world: &World<'_> = &worlds[number];
        Session::new(world, &Options::new(1.2, 40 + number as u64))
    };
    let alone = [all(&mut begin(0)?), all(&mut begin(1)?)];
    assert!(alone[0].len() == 1200 && alone[0] != alone[1]);

    // By turns in one thread: three sessions, two of them of one world.
    let sessions: Result<Vec<_>, _> = [0, 1, 0].into_iter().map(begin).collect();
    let mut sessions = sessions?;
    let mut turns: [Vec<Vec<u64>>; 3] = Default::default();
    for _ in 0..1200 {
        for (session, ticks) in sessions.iter_mut().zip(&mut turns) {
            ticks.extend(bits(session));
        }
    }
    assert!(turns[0] == alone[0] && turns[1] == alone[1] && turns[2] == alone[0]);

    // At the same time in threads.
    let together = std::thread::scope(|scope| {
        let threads = [0, 1, 0, 1]
            .map(|number| scope.spawn(move || begin(number).map(|mut session| all(&mut session))));
        threads.map(std::thread::ScopedJoinHandle::join)
    });
    for (found, expected) in together.into_iter().zip([0, 1, 0, 1]) {
        let found = found.map_err(|_| "a session panicked")??;
        assert!(found == alone[expected], "session {expected}");
    }
    Ok(())
}

/// After a panic of the host the ticks go on, and the force fades to the safe hold.
#[test]
fn a_session_goes_on_after_a_panic_of_its_host() -> Result<(), Box<dyn Error>> {
    let mut loaded = scene("press.toml", 1)?;
    loaded.scene.realtime.age_limit = Some(0.1);
    let mut options = Options::new(1.5, 7);
    options.faults = vec![HostFault {
        kind: FaultKind::Panic,
        at: 0.9,
        duration: 0.0,
    }];
    let mut session = Session::new(&World::new(&loaded)?, &options)?;
    let mut seen: Vec<HostState> = Vec::new();
    let mut held = 0;
    while let Some(telemetry) = session.tick() {
        let state = telemetry.bodies[0].state;
        if seen.last() != Some(&state) {
            seen.push(state);
        }
        let panicked = session.panicked().is_some();
        assert_eq!(session.engine().is_none(), panicked);
        assert_eq!(panicked, session.ticks() > 900);
        held += u64::from(state == HostState::Held);
    }
    let expected = [
        HostState::Waiting,
        HostState::Live,
        HostState::Fading,
        HostState::Held,
    ];
    assert_eq!(seen, expected);
    let ended = session.end();
    assert_eq!(ended.tick.ticks, 1500);
    assert!(ended.panicked.is_some() && !ended.stopped);
    // The host keeps what it did before the panic.
    assert!(ended.host.engine.stats().steps >= 80);
    assert!(held > 200, "{held} ticks of the hold");
    Ok(())
}
