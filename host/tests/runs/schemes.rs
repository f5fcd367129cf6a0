//! Scenes name schemes: each scheme runs under its name, and `proxy` publishes the body in series with its springs.

use host::engine::pacer::Due;
use host::engine::plan::links;
use host::engine::stats::WallStopwatch;
use host::engine::virtual_coupling::VirtualCoupling;
use host::run::prepare::{Options, Prepared};
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::LocalModel;
use std::collections::BTreeMap;
use std::error::Error;

const SCENE: &str = include_str!("../../scenes/stretch.toml");

/// The built-in scene with another scheme and additional lines under `[loop]`.
fn with(scheme: &str, lines: &str) -> Result<LoadedScene, Box<dyn Error>> {
    let text = SCENE.replacen(
        "scheme = \"capped\"",
        &format!("scheme = \"{scheme}\"\n{lines}"),
        1,
    );
    assert!(text.contains(&format!("\"{scheme}\"\n{lines}")));
    Ok(Scene::load_texts("x.toml", &text, &BTreeMap::new())?)
}

/// The tenth model that a run publishes.
fn published(scene: &LoadedScene) -> Result<LocalModel, Box<dyn Error>> {
    let mut built = Prepared::new(&World::new(scene).unwrap(), &Options::new(1.0, 1))?;
    let watch = WallStopwatch::start();
    let mut found = LocalModel::empty();
    for k in 0..10 {
        // No force acts on the hands, so that their motion is the same under all schemes.
        built.tick.tick(k * 4 * built.timing.period_ns);
        built.host.drain(|record| built.engine.follow(record));
        let due = Due {
            time_ns: 0,
            publishes: true,
        };
        built
            .engine
            .step(due, &watch, &mut |_, model| found = *model);
    }
    Ok(found)
}

#[test]
fn every_scheme_runs_under_its_name() -> Result<(), Box<dyn Error>> {
    for scheme in ["hold", "thesis", "linear", "proxy", "classic", "capped"] {
        let options = RunOptions {
            duration: Some(0.2),
            ..RunOptions::new(Clock::Virtual)
        };
        let summary = run(
            &World::new(&with(scheme, "")?).unwrap(),
            &options,
            &mut |_| {},
        )?;
        assert_eq!(summary.scheme, scheme);
        assert_eq!(summary.tick.refused_models, 0, "{scheme}");
        assert!(
            summary.devices.iter().all(|d| d.peak_force > 0.0),
            "{scheme}"
        );
    }
    Ok(())
}

#[test]
fn a_proxy_publishes_the_body_in_series_with_its_spring() -> Result<(), Box<dyn Error>> {
    let linear = published(&with("linear", "")?)?;
    assert_eq!(linear.head.sequence, 10);
    for lines in ["", "proxy_stiffness = 150.0\nproxy_damping = 0.5"] {
        let scene = with("proxy", lines)?;
        let links = links(&scene, &scene.scene.bodies[0]);
        let wanted = if lines.is_empty() {
            (3000.0, 20.0)
        } else {
            (150.0, 0.5)
        };
        // The devices of the scene are Falcons.
        assert!(links.iter().all(|l| (l.stiffness, l.damping) == wanted));
        let proxy = published(&scene)?;
        let mut coupling = VirtualCoupling::new(links);
        assert_eq!(proxy, *coupling.through(&linear));
        // The stiffness of the sheet along x is some 100 N/m.
        let own = |model: &LocalModel| model.stiffness[0][0][(0, 0)];
        let (ours, body) = (own(&proxy), own(&linear));
        assert!(ours < 0.99 * body, "{ours} {body}");
    }
    Ok(())
}
