//! Grasps: one device holds several handles, on one body or on several.

use host::run::prepare::{self, Options, Prepared};
use host::run::session::Session;
use host::scene::{LoadedScene, Scene};
use host::solve::solve;
use host::world::{World, bodies_held, grasps};
use rt_core::{LocalModel, Telemetry, Vec3};
use runner::link::LogRecord;
use std::collections::BTreeMap;
use std::convert::Infallible;

const BLOCK: &str = "damping = { mass = 0.2, stiffness = 0.02 }\n\
     mesh.box = { size = [0.1, 0.06, 0.04], cells = [5, 3, 2] }\n";

fn load(text: &str) -> LoadedScene {
    Scene::load_texts("t.toml", text, &BTreeMap::new()).unwrap()
}

/// A scene of a device that presses what it holds, with these bodies.
fn pressed(model: &str, bodies: &str) -> LoadedScene {
    load(&format!(
        "name = 't'\n[loop]\nscheme = 'linear'\n{bodies}\n[[device]]\nname = 'd'\nmodel = '{model}'\n\
         hand = {{ grip = 'firm', waypoints = [[0.05, 0, 0, 0], [0.4, 0.002, 0.001, -0.006]] }}\n"
    ))
}

fn block(name: &str, rest: &str) -> String {
    format!(
        "[[body]]\nname = '{name}'\n{BLOCK}material = {{ young = 2e4, poisson = 0.3, density = 1000 }}\n{rest}\n\
         [[body.support]]\nname = 'table'\ngroup = 'bottom'\n"
    )
}

fn handle(name: &str, place: &str) -> String {
    format!("[[body.handle]]\nname = '{name}'\n{place}\ndevice = 'd'\n")
}

/// A handle on the top of the block between these two x (m).
fn prong(name: &str, low: f64, high: f64) -> String {
    let place = format!("box = [[{low}, -1.0, 0.019], [{high}, 1.0, 1.0]]");
    handle(name, &place)
}

/// Two handles of one grasp. The columns of vertices lie at x = -0.05, -0.03, ..., 0.05.
fn fork() -> String {
    prong("left prong", -0.05, -0.02) + &prong("right prong", 0.02, 0.05)
}

fn observed(loaded: &LoadedScene, duration: f64) -> (Vec<Telemetry>, Vec<(usize, LocalModel)>) {
    let built = Prepared::new(&World::new(loaded).unwrap(), &Options::new(duration, 1)).unwrap();
    let (mut ticks, mut models) = (Vec::new(), Vec::new());
    let sink = |record: LogRecord<'_>| match record {
        LogRecord::Tick(telemetry) => ticks.push(*telemetry),
        LogRecord::Patch(..) => {}
        LogRecord::Model(body, model) => models.push((usize::from(body), *model)),
    };
    Session::of(built).run(sink);
    (ticks, models)
}

#[test]
fn two_handles_move_as_one_handle_of_their_vertices() {
    let fork = pressed("omega3", &(block("b", "") + &fork()));
    let spec = &fork.scene.bodies[0];
    let found = grasps(&fork.scene, spec);
    assert_eq!(
        (found.len(), found[0].name(spec)),
        (1, "left prong + right prong".to_owned())
    );
    let world = World::new(&fork).unwrap();
    let built = &world.bodies[0];
    assert_eq!(
        (built.handles.len(), built.handles[0].vertices.len()),
        (1, 16)
    );
    // Between the prongs.
    assert!((built.handles[0].origin - Vec3::new(0.0, 0.0, 0.02)).norm() < 1e-15);
    assert!((world.mounts[0].origin - built.handles[0].origin).norm() == 0.0);

    // Each prong alone presses half of a block whose halves are alike. The fork feels both, and what they do to each
    // other.
    let stiffness = |loaded: &LoadedScene| {
        let (_, models) = observed(loaded, 0.1);
        models.last().unwrap().1.stiffness[0][0][(2, 2)]
    };
    let half = pressed("omega3", &(block("b", "") + &prong("prong", -0.05, -0.02)));
    let ratio = stiffness(&fork) / stiffness(&half);
    assert!((1.8..2.2).contains(&ratio), "{ratio}");
}

/// A grasp of two handles is one reaction. The columns and the curves of the supports behind it are those of the supports.
#[test]
fn a_solve_has_one_reaction_for_a_tool() {
    let body = block("b", "").replace(
        "group = 'bottom'",
        "group = 'bottom'\ndisplacement = [0.0, 0.0, 0.002]",
    );
    let loaded = pressed("omega3", &(body + &fork()));
    let solution = solve(
        &World::new(&loaded).unwrap(),
        false,
        &mut |_| {},
        &mut |_| Ok::<(), Infallible>(()),
    )
    .unwrap();
    assert_eq!(solution.failures, [""; 0]);
    let named = solution.bodies[0].reactions.iter().map(|one| &*one.name);
    let named: Vec<_> = named.collect();
    assert_eq!(named, ["left prong + right prong", "table"]);
    let csv = solution.csv();
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert!(rows.iter().all(|row| row.len() == rows[0].len()), "{csv}");
    let last = |column: &str| -> f64 {
        let place = rows[0].iter().position(|name| *name == column);
        let place = place.unwrap_or_else(|| panic!("{column} in {:?}", rows[0]));
        rows.last().unwrap()[place].parse().unwrap()
    };
    assert_eq!(last("b_table_displacement_z_m"), 0.002);
    assert_eq!(last("b_left_prong___right_prong_displacement_z_m"), 0.0);
    // The bottom lifts the block against the tool.
    assert!(last("b_table_force_z_N") > 1.0);
    let curves = solution.load_curves();
    let [curve] = &curves[..] else {
        panic!("{curves:?}");
    };
    assert_eq!(curve.name, "table");
    let (moved, force) = *curve.points.last().unwrap();
    assert_eq!((moved, force), (0.002, last("b_table_force_z_N")));
}

#[test]
fn a_tool_on_two_bodies_feels_both_and_their_accounts_add_up_to_its_work() {
    let top = handle("top", "group = 'top'");
    let beside = "position = [0.3, 0.0, 0.0]\n";
    let both = block("a", "") + &top + &block("b", beside) + &top;
    let loaded = pressed("omega3", &both);
    let (ticks, _) = observed(&loaded, 0.6);
    let mut work = 0.0;
    for pair in ticks.windows(2) {
        let [before, after] = [&pair[0].devices[0], &pair[1].devices[0]];
        work -= before
            .wrench
            .force
            .dot(&(after.pose.position - before.pose.position));
    }
    let last = ticks.last().unwrap();
    let accounts = [0, 1].map(|body: usize| last.bodies[body].energy);
    let supplied = accounts[0].supplied + accounts[1].supplied;
    // Rounding of works of order 10 mJ.
    assert!(
        (supplied - work).abs() < 1e-14 && work > 1e-3,
        "{supplied} {work}"
    );
    // The bodies are alike.
    assert!((accounts[0].supplied - accounts[1].supplied).abs() < 1e-9);
    // The accounts rely on no more dissipation than the device has: each on half of it.
    let (config, _) = prepare::controls(&World::new(&loaded).unwrap(), 1).unwrap();
    let alone = pressed("omega3", &(block("a", "") + &top));
    let (whole, _) = prepare::controls(&World::new(&alone).unwrap(), 1).unwrap();
    for body in &config.bodies {
        let (share, port) = (body.passivity.ports[0], whole.bodies[0].passivity.ports[0]);
        assert_eq!(2.0 * share.damping, port.damping);
        assert_eq!(2.0 * share.friction, port.friction);
        assert_eq!(2.0 * share.most_damping, port.most_damping);
        // Before the first models, both bodies damp the hand by the safe hold.
        let hold = whole.bodies[0].hold_damping[0];
        assert_eq!(2.0 * body.hold_damping[0], hold);
        assert!(hold > 0.0);
    }
}

#[test]
fn a_tool_of_six_degrees_of_freedom_feels_the_moments_about_its_origin() {
    // Two blocks hang at the ends of a bar. The second is twice as heavy.
    let hung = |name: &str, x: f64, density: f64| {
        format!(
            "[[body]]\nname = '{name}'\n{BLOCK}material = {{ young = 1e6, poisson = 0.3, density = {density} }}\n\
             position = [{x}, 0.0, 0.0]\n{}",
            handle("top", "group = 'top'")
        )
    };
    let bodies = hung("light", -0.2, 500.0) + &hung("heavy", 0.2, 1000.0);
    let text = format!(
        "name = 't'\n{bodies}\n[[device]]\nname = 'd'\nmodel = 'virtuose6d'\nhand = {{ grip = 'rigid' }}\n"
    );
    let loaded = load(&text);
    assert!(
        (World::new(&loaded).unwrap().mounts[0].origin - Vec3::new(0.0, 0.0, 0.02)).norm() < 1e-12
    );
    let (_, models) = observed(&loaded, 0.01);
    // Statics: the moment about the origin of the tool is that of the weight at the centre of mass.
    let volume = 0.1 * 0.06 * 0.04;
    for (body, x, density) in [(0, -0.2, 500.0), (1, 0.2, 1000.0)] {
        let (_, model) = models.iter().find(|(of, _)| *of == body).unwrap();
        let wrench = model.handles[0].wrench;
        let weight = volume * density * 9.81;
        assert!(
            (wrench.force.z + weight).abs() < 1e-6 * weight,
            "{}",
            wrench.force
        );
        let moment = Vec3::new(x, 0.0, -0.02).cross(&Vec3::new(0.0, 0.0, -weight));
        // The block sags a little, and the hand with it.
        assert!(
            (wrench.moment - moment).norm() < 1e-4 * moment.norm(),
            "{} {moment}",
            wrench.moment
        );
    }
}

#[test]
fn four_devices_hold_two_bodies_by_six_handles() {
    let loaded = load(include_str!("../../scenes/two_people.toml"));
    let scene = &loaded.scene;
    assert_eq!((scene.bodies.len(), scene.devices.len()), (2, 4));
    assert_eq!(
        scene
            .bodies
            .iter()
            .map(|body| body.handles.len())
            .sum::<usize>(),
        6
    );
    assert_eq!(bodies_held(scene), [1, 2, 1, 1]);
    let (ticks, models) = observed(&loaded, 2.0);
    let handles = [0, 1].map(|body| {
        let (_, model) = models.iter().find(|(of, _)| *of == body).unwrap();
        model
            .handles()
            .map(|handle| handle.device)
            .collect::<Vec<_>>()
    });
    assert_eq!(handles, [vec![0, 1], vec![1, 2, 3]]);
    // What the hands supply is what the bodies took, over all devices and bodies.
    let mut work = 0.0;
    for pair in ticks.windows(2) {
        for device in 0..4 {
            let [before, after] = [&pair[0].devices[device], &pair[1].devices[device]];
            work -= before
                .wrench
                .force
                .dot(&(after.pose.position - before.pose.position));
        }
    }
    let last = ticks.last().unwrap();
    let supplied: f64 = last.bodies().map(|body| body.energy.supplied).sum();
    // Rounding of works of order 10 mJ.
    assert!((supplied - work).abs() < 1e-13, "{supplied} {work}");
    for device in 0..4 {
        let forces = ticks
            .iter()
            .map(|tick| tick.devices[device].wrench.force.norm());
        let peak = forces.fold(0.0, f64::max);
        assert!(peak > 0.1, "device {device}: {peak} N");
    }
    // Every body gave back no more than it got, but for the allowance and the debt up to which the cap damps.
    for body in last.bodies() {
        assert!(body.energy.least > -1e-3, "{:?}", body.energy);
    }
}
