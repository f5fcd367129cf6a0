//! Bodies that are stiffer along some directions than their devices can render: they come to rest, their soft directions
//! are exact, and plan and summary tell.

use host::engine::plan::{BodyPlan, renderable};
use host::engine::rehearsal::Rehearsal;
use host::engine::unrendered::StiffSummary;
use host::log::Log;
use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::{World, condense};
use nalgebra::Matrix3;
use rt_core::Vec3;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

type Outcome = Result<(), Box<dyn Error>>;

/// A sheet of paper, clamped at an edge, whose free edge a hand presses.
const PAPER: &str = "
bending = 1.0
damping = { mass = 2.0, stiffness = 0.0002 }
mesh.sheet = { length = 0.1, width = 0.06, cells = [12, 8], pattern = 'alternating' }
material = { young = 3e9, poisson = 0.3, thickness = 0.0001, density = 900 }
[[body.support]]
name = 's'
group = 'left'
border = 'clamped'
[[body.handle]]
name = 'h'
group = 'right'
device = 'd'
";

/// A rubber beam whose end a hand pushes across.
const BEAM: &str = "
damping = { mass = 0.5, stiffness = 0.001 }
mesh.box = { size = [0.08, 0.03, 0.005], cells = [8, 3, 2] }
material = { law = 'corotational', young = 1e7, poisson = 0.3, density = 1000 }
[[body.support]]
name = 's'
group = 'left'
[[body.handle]]
name = 'h'
group = 'right'
device = 'd'
";

/// A block that is stiffer than the device across its top.
const BLOCK: &str = "
damping = { mass = 0.5, stiffness = 0.001 }
mesh.box = { size = [0.04, 0.04, 0.02], cells = [5, 5, 3] }
material = { law = 'corotational', young = 5e5, poisson = 0.3, density = 1000 }
[[body.support]]
name = 's'
group = 'bottom'
[[body.handle]]
name = 'h'
box = [[-0.009, -0.009, 0.0099], [0.009, 0.009, 0.0101]]
device = 'd'
";

/// A body in a hand that moves by 20 mm towards negative z between 0.5 and 2.5 s, and holds.
fn scene(body: &str, model: &str, grip: &str, seed: u64) -> Result<LoadedScene, Box<dyn Error>> {
    let text = format!(
        "name = 'stiff'
seed = {seed}
gravity = [0, 0, 0]
host = {{ step_rate = 250, publish_rate = 125, latency = 0.008 }}
[[body]]
name = 'b'
{body}
[[device]]
name = 'd'
model = '{model}'
[device.hand]
grip = '{grip}'
waypoints = [[0.5, 0, 0, 0], [2.5, 0, 0, -0.02]]
"
    );
    Ok(Scene::load_texts("stiff.toml", &text, &BTreeMap::new())?)
}

/// The force of each device in each tick (N).
type Forces = Vec<Vec<Vec3>>;

/// Runs a scene. Returns its summary and its forces.
fn forces(loaded: &LoadedScene, duration: f64) -> Result<(RunSummary, Forces), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(duration),
        log: Some(path.clone()),
        ..RunOptions::new(Clock::Virtual)
    };
    let summary = run(&World::new(loaded).unwrap(), &options, &mut |_| {})?;
    let log = Log::parse(&std::fs::read(path)?)?;
    let devices = 0..loaded.scene.devices.len();
    let of = |device: usize| {
        let rows = log.rows.iter();
        rows.map(|row| row.devices[device].wrench.force).collect()
    };
    Ok((summary, devices.map(of).collect()))
}

/// The largest change of the force from one tick to the next (N).
fn jump(forces: &[Vec3]) -> f64 {
    let pairs = forces.windows(2).map(|pair| (pair[1] - pair[0]).norm());
    pairs.fold(0.0, f64::max)
}

/// Root mean square of the force about its mean (N).
fn spread(forces: &[Vec3]) -> f64 {
    let mean = forces.iter().sum::<Vec3>() / forces.len() as f64;
    let squares = forces.iter().map(|force| (force - mean).norm_squared());
    (squares.sum::<f64>() / forces.len() as f64).sqrt()
}

#[test]
fn a_body_that_its_device_cannot_render_comes_to_rest_and_is_told() -> Outcome {
    for (body, model, grip) in [
        (PAPER, "omega3", "firm"),
        (PAPER, "touch", "firm"),
        (PAPER, "falcon", "firm"),
        (BEAM, "touch", "typical"),
        (BEAM, "falcon", "relaxed"),
        (BEAM, "phantom_premium", "typical"),
        (BLOCK, "touch", "relaxed"),
    ] {
        for seed in [1, 700_071] {
            let (summary, forces) = forces(&scene(body, model, grip, seed)?, 4.0)?;
            let case = format!("{body}{model} {seed}");
            // Without springs the forces changed by up to 16 N from tick to tick, and holds rippled by up to 3 N.
            // A count changes the force by 0.2 N along each of three axes at most; the hand's own push comes on top.
            let jump = jump(&forces[0]);
            assert!(jump < 0.65, "{jump} N: {case}");
            let spread = spread(&forces[0][3_500..]);
            assert!(spread < 0.12, "{spread} N: {case}");
            let energy = &summary.energy[0];
            assert_eq!(energy.capped_ticks, 0, "{case}");
            assert!(energy.most_out < 1e-3, "{} J: {case}", energy.most_out);
            let [stiff] = summary.host.stiff.as_slice() else {
                panic!("{:?}: {case}", summary.host.stiff);
            };
            assert_eq!((&*stiff.body, &*stiff.handle), ("b", "h"));
            assert!(stiff.stiffness > stiff.rendered && !stiff.turns, "{stiff}");
            assert!(summary.to_string().contains(&stiff.to_string()));
        }
    }
    Ok(())
}

#[test]
fn two_hands_on_a_banknote_feel_no_blow_before_they_move() -> Outcome {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let loaded = Scene::load(&scenes.join("banknote_shear.toml"))?;
    let (summary, forces) = forces(&loaded, 0.4)?;
    for forces in forces {
        // 8 N and 3.9 N from tick to tick before. The hands have moved by 0.1 mm against paper that is rendered with
        // 20 N/mm.
        let most = forces.iter().map(Vec3::norm).fold(0.0, f64::max);
        assert!(most < 0.6, "{most} N");
        assert!(jump(&forces) < 0.3, "{} N", jump(&forces));
    }
    assert_eq!(summary.energy[0].capped_ticks, 0);
    assert_eq!(summary.host.stiff.len(), 1);
    Ok(())
}

/// The note buckles from 1.2 s on and tears from 1.8 s on. Its models stated stiffnesses of 13 MN/m and of either sign, by
/// which the springs moved the handles until the note stored 25 kJ.
#[test]
fn a_note_that_tears_out_of_its_plane_is_felt_as_paper() -> Outcome {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let mut loaded = Scene::load(&scenes.join("banknote_shear.toml"))?;
    // The first edge opens at 1.6 N, and the next ones at 2.7 N. A bend of stiff paper that moves on by an edge lets 0.6 N go
    // within a step. With the other seed a cut once made narrow triangles of the fold, and the hands felt 12 N for 3 ms.
    for (seed, duration, bound) in [(700_101, 2.2, 2.0), (8113, 2.7, 3.2)] {
        loaded.scene.seed = seed;
        let (summary, forces) = forces(&loaded, duration)?;
        for forces in forces {
            let most = forces.iter().map(Vec3::norm).fold(0.0, f64::max);
            assert!(most < bound, "{most} N");
            assert!(jump(&forces) < 0.8, "{} N", jump(&forces));
        }
        let account = &summary.energy[0];
        assert_eq!(account.capped_ticks, 0);
        assert!(account.most_out < 1e-3, "{} J", account.most_out);
    }
    Ok(())
}

/// The stiff directions of a scene's bodies at rest.
fn planned(loaded: &LoadedScene) -> Result<Vec<StiffSummary>, Box<dyn Error>> {
    Ok(Rehearsal::new(&World::new(loaded)?)?.stiff())
}

/// The expectation is the eigenvalues of the stiffness from another solver, which factorizes an assembled matrix.
#[test]
fn a_plan_names_each_direction_that_the_device_cannot_render() -> Outcome {
    for (body, model, count) in [
        (PAPER, "omega3", 2),
        (PAPER, "falcon", 2),
        (BEAM, "touch", 1),
        (BLOCK, "touch", 1),
    ] {
        let loaded = scene(body, model, "typical", 1)?;
        let world = World::new(&loaded)?;
        let response = BodyPlan::new(&world, 0).response;
        let condenser = condense(&world.bodies[0], response)?;
        let stiffness = &condenser.condensed().stiffness;
        let stiffness = Matrix3::from_fn(|i, j| stiffness[(i, j)]).symmetric_eigenvalues();
        let limit = renderable(&loaded)[0].stiffness;
        let mut expected: Vec<f64> = stiffness.iter().copied().filter(|k| *k > limit).collect();
        expected.sort_by(|one, other| other.total_cmp(one));
        let found = planned(&loaded)?;
        assert_eq!((found.len(), expected.len()), (count, count), "{found:?}");
        for (found, expected) in found.iter().zip(expected) {
            assert_eq!((&*found.body, &*found.handle), ("b", "h"));
            assert!(found.others.is_empty() && !found.turns, "{found}");
            // The shapes of a model are solved to a ten-thousandth.
            let error = (found.stiffness / expected - 1.0).abs();
            assert!(error < 1e-3, "{} N/m, not {expected}", found.stiffness);
            assert!(found.rendered <= limit, "{found}");
        }
        // The first models of a run are of the same body, which the tremor of the hand has moved by some micrometres.
        let (summary, _) = forces(&loaded, 0.05)?;
        let ratio = summary.host.stiff[0].stiffness / found[0].stiffness;
        assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    }
    Ok(())
}

#[test]
fn a_plan_names_the_handles_of_a_stiff_motion_and_the_turns() -> Outcome {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let found = planned(&Scene::load(&scenes.join("banknote_shear.toml"))?)?;
    // Along the note and across it, one hand against the other.
    assert_eq!(found.len(), 2, "{found:?}");
    for stiff in &found {
        let pair = [&stiff.handle, &stiff.others[0]];
        assert!(stiff.others.len() == 1 && pair[0] != pair[1], "{stiff}");
        assert!(stiff.to_string().contains(&format!("(with {})", pair[1])));
    }
    // The turns of a plate of 10 mm are stiffer than the Virtuose can render.
    let plate = PAPER.replace("thickness = 0.0001", "thickness = 0.01");
    let found = planned(&scene(&plate, "virtuose6d", "firm", 1)?)?;
    let turn = found.iter().find(|stiff| stiff.turns);
    let turn = turn.ok_or("no turn")?;
    assert!(turn.to_string().contains(" N m/rad"), "{turn}");
    Ok(())
}

#[test]
fn a_body_that_its_device_can_render_is_not_told() -> Outcome {
    let soft = BLOCK.replace("5e5", "5e4");
    let loaded = scene(&soft, "omega3", "typical", 3)?;
    assert!(planned(&loaded)?.is_empty());
    let (summary, _) = forces(&loaded, 1.0)?;
    assert!(summary.host.stiff.is_empty());
    assert!(!summary.to_string().contains("  stiff"));
    Ok(())
}

/// A heavy block in a device that magnifies the motion. Its inertia from one step to the next is far above the stiffness
/// of a model that serves for many steps.
const HEAVY: &str = "
damping = { mass = 1.0, stiffness = 0.01 }
mesh.box = { size = [0.1, 0.1, 0.06], cells = [5, 5, 2] }
material = { law = 'corotational', young = 3e5, poisson = 0.4, density = 1000 }
[[body.support]]
name = 's'
group = 'bottom'
[[body.handle]]
name = 'h'
box = [[-0.041, -0.031, 0.0299], [-0.009, 0.031, 0.0301]]
device = 'd'
";

#[test]
fn handles_do_not_swing_on_the_springs_of_hosts_of_any_rate() -> Outcome {
    for (step_rate, publish_rate, latency, publications) in [
        // One for each 25 ms of two seconds.
        (1000.0, 40.0, 0.004, 79),
        (1000.0, 1000.0, 0.0, 1999),
        (250.0, 250.0, 0.004, 499),
    ] {
        let mut loaded = scene(HEAVY, "falcon", "rigid", 1)?;
        let scene = &mut loaded.scene;
        (scene.host.step_rate, scene.host.publish_rate) = (step_rate, publish_rate);
        scene.host.latency = latency;
        scene.devices[0].motion_scale = 4.0;
        if let Some(hand) = &mut scene.devices[0].hand {
            hand.waypoints = vec![[0.5, 0.0, 0.0, 0.0], [1.5, 0.0, 0.0, -0.003]];
        }
        let (summary, felt) = forces(&loaded, 2.0)?;
        // A handle that swings stays behind its hand, and its body publishes nothing.
        assert_eq!(summary.host.publications, publications);
        // 2.5 times the friction.
        let jump = jump(&felt[0]);
        assert!(jump < 0.75, "{publish_rate} Hz: {jump} N");
    }
    Ok(())
}
