//! Parts of a scene that would have no effect, with nothing in the results to tell so.
//!
//! Such a scene runs and gives a force of zero: a device that holds nothing, a hand that would move after the end, a first
//! model that arrives after the end. Each is a [`Warning`]. A hand that moves only if its device cannot is refused.

use super::error::SceneError;
use super::plausible::{Warning, part_along};
use super::source::Source;
use super::spec::{Hand, Scene};
use devices::DeviceFile;
use devices::falcon::MOST_FORCE;
use physics::Vec3;
use sim::DeviceModel;

/// The warnings about parts of `scene` that have no effect.
///
/// # Errors
/// [`SceneError::Value`] for waypoints without a component along the axes of the device, and for turns of a device that does not turn.
pub(super) fn check(
    scene: &Scene,
    source: &Source,
    models: &[DeviceModel],
) -> Result<Vec<Warning>, SceneError> {
    let mut warnings = Vec::new();
    let mut warn = |field: &str, found: String, usual: &str, advice: &str| {
        warnings.push(Warning {
            location: source.location(field),
            found,
            usual: usual.to_owned(),
            advice: advice.to_owned(),
        });
    };
    let handles = || scene.bodies.iter().flat_map(|body| &body.handles);
    // A scene in which bodies fall on obstacles, and which no hand holds, means it.
    let falls = handles().next().is_none() && scene.obstacles.len() > scene.tools.len();
    for (index, (device, model)) in scene.devices.iter().zip(models).enumerate() {
        let has_tool = scene.tools.iter().any(|tool| tool.device == device.name);
        if !falls && !has_tool && handles().all(|handle| handle.device != device.name) {
            warn(
                &format!("device[{index}]"),
                format!("no handle of the device {:?}", device.name),
                "a [[body.handle]] or a [[tool]] with this `device`",
                "the device would feel no force: it holds no body, and touches none",
            );
        }
        let Some(hand) = &device.hand else { continue };
        across(&format!("device[{index}].hand"), hand, model, source)?;
        for (name, rows) in [("waypoints", &hand.waypoints), ("turns", &hand.turns)] {
            if let Some((row, from)) = first_after(scene.duration, rows) {
                warn(
                    &format!("device[{index}].hand.{name}[{row}]"),
                    format!("a motion that begins at {from} s"),
                    &format!("before the end at {} s", scene.duration),
                    "are the times in milliseconds? times are in seconds; `duration` is the length of the scene",
                );
            }
        }
    }
    let arrival = 1.0 / scene.host.publish_rate + scene.host.latency;
    if !scene.devices.is_empty() && arrival >= scene.duration {
        warn(
            "host.publish_rate",
            format!("a first model {arrival} s after the start, by `publish_rate` and `latency`"),
            &format!("before the end at {} s", scene.duration),
            "the devices would feel no force",
        );
    }
    Ok(warnings)
}

/// The warnings about devices that give less force than the scene asks for: by their profiles, or by their drivers.
pub(super) fn weaker(scene: &Scene, source: &Source, profiles: &[DeviceFile]) -> Vec<Warning> {
    let devices = scene.devices.iter().zip(profiles).enumerate();
    let weaker = devices.filter_map(|(index, (device, profile))| {
        let is_falcon = match device.connect.driver.as_str() {
            "falcon" => true,
            "emulated" => profile.protocol.as_deref() == Some("falcon"),
            _ => false,
        };
        let own = profile.model.max_force;
        let most = device.max_force.unwrap_or(own);
        if most > own {
            return Some(Warning {
                location: source.location(&format!("device[{index}].max_force")),
                found: format!("{most} N"),
                usual: format!("at most {own} N, the largest force of {}", profile.name),
                advice: "the device gives no more, and larger forces of the body are cut off".to_owned(),
            });
        }
        (is_falcon && most > MOST_FORCE).then(|| Warning {
            location: source.location(&format!("device[{index}].connect")),
            found: format!("a Falcon with up to {most} N"),
            usual: format!("at most {MOST_FORCE} N, which the driver commands"),
            advice: format!(
                "larger forces of the body are cut off when the device is connected: set max_force = {MOST_FORCE} to see it \
                 in simulation"
            ),
        })
    });
    weaker.collect()
}

/// The first of the `rows` whose motion begins at or after `end` (s), and the time at which it begins (s).
fn first_after(end: f64, rows: &[[f64; 4]]) -> Option<(usize, f64)> {
    let moves = rows.windows(2).enumerate().find(|(_, pair)| {
        let [[from, at @ ..], [_, to @ ..]] = [pair[0], pair[1]];
        from >= end && at != to
    });
    moves.map(|(row, pair)| (row + 1, pair[0][0]))
}

/// Refuses waypoints without a part along the axes of the device, and turns of a device that does not turn: the mechanism carries the force, and
/// nothing moves.
fn across(at: &str, hand: &Hand, model: &DeviceModel, source: &Source) -> Result<(), SceneError> {
    if !hand.turns.is_empty() && model.rotation.is_none() {
        let found = "a device that does not turn";
        let allowed = "no such field: only a hand on a device whose model has `rotation` turns it";
        return Err(source.error(&format!("{at}.turns"), found, allowed));
    }
    let Some(axes) = model.axes else {
        return Ok(());
    };
    let away = |row: &&[f64; 4]| row[1..] != [0.0; 3];
    let along = |row: &[f64; 4]| axes.part(&Vec3::from_column_slice(&row[1..])) != Vec3::zeros();
    let mut rows = hand.waypoints.iter().filter(away);
    let Some(first) = rows.clone().next() else {
        return Ok(());
    };
    if rows.any(along) {
        return Ok(());
    }
    let allowed = format!("rows [time, x, y, z] with {}", part_along(axes));
    Err(source.error(&format!("{at}.waypoints"), format!("{first:?}"), allowed))
}

#[cfg(test)]
mod tests {
    use crate::{LoadedScene, Scene, SceneError};
    use std::collections::BTreeMap;

    const BODY: &str = "name = 'a'
duration = 1.0
host.publish_rate = 50
[[body]]
name = 'b'
mesh.box = { size = [0.1, 0.1, 0.1], cells = [1, 1, 1] }
material = { young = 1e3, poisson = 0.3, density = 1000 }
handle = [{ name = 'h', group = 'top', device = 'd' }]
[[device]]
name = 'd'
model = 'MODEL'
hand.waypoints = [[0.0, 0, 0, 0], [0.5, 0, 0, -0.01]]
";

    fn load(change: &[(&str, &str)]) -> Result<LoadedScene, SceneError> {
        let text = BODY.replace("MODEL", "omega3");
        let text = (change.iter()).fold(text, |text, (from, to)| text.replace(from, to));
        Scene::load_texts("a.toml", &text, &BTreeMap::new())
    }

    fn warnings(change: &[(&str, &str)]) -> Vec<String> {
        let loaded = load(change).expect("a scene");
        loaded.warnings.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn parts_without_effect_are_told() {
        assert_eq!(warnings(&[]), [""; 0]);
        for (change, said) in [
            (
                vec![(
                    "handle = [{ name = 'h', group = 'top', device = 'd' }]\n",
                    "",
                )],
                "a.toml:8: device[0]: found no handle of the device \"d\", usual: a [[body.handle]] or a [[tool]] with this \
                 `device`; the device would feel no force",
            ),
            (
                vec![("[[0.0, 0, 0, 0], [0.5", "[[100, 0, 0, 0], [500")],
                "a.toml:12: device[0].hand.waypoints[1]: found a motion that begins at 100 s, usual: before the end at 1 \
                 s; are the times in milliseconds? times are in seconds; `duration` is the length of the scene",
            ),
            (
                vec![("publish_rate = 50", "publish_rate = 1\nhost.step_rate = 1")],
                "a.toml:3: host.publish_rate: found a first model 1.004 s after the start, by `publish_rate` and `latency`, \
                 usual: before the end at 1 s; the devices would feel no force",
            ),
        ] {
            let found = warnings(&change);
            assert_eq!(found.len(), 1, "{found:?}");
            assert!(found[0].starts_with(said), "{}", found[0]);
        }
        let falls = [
            (
                "handle = [{ name = 'h', group = 'top', device = 'd' }]\n",
                "",
            ),
            (
                "[[device]]",
                "[[obstacle]]\nname = 'o'\nshape = 'plane'\nposition = [0, 0, -0.1]\n[[device]]",
            ),
        ];
        assert_eq!(warnings(&falls), [""; 0]);
        assert_eq!(warnings(&falls[..1]).len(), 1);
        let panto = "name = 'panto'\naxes = ['x', 'y']\nmass = 0.06\ndamping = 0.05\nfriction = 0.05\nposition_step = 2e-5\nmax_force = 2.0\n\
                     workspace_radius = 0.04\ndriver_stiffness = 500\ndriver_damping = 1\nrate = 1000\n";
        let files = BTreeMap::from([("panto.toml".to_owned(), panto.as_bytes().to_vec())]);
        let text = BODY.replace("MODEL", "panto.toml");
        let error = Scene::load_texts("a.toml", &text, &files).expect_err("no motion");
        let said = "a.toml:12: device[0].hand.waypoints: found [0.5, 0.0, 0.0, -0.01], allowed: rows [time, x, y, z] with a \
                    part along x and y";
        assert!(error.to_string().starts_with(said), "{error}");
        let along = text.replace("0, 0, -0.01]", "0.01, 0, -0.01]");
        assert!(Scene::load_texts("a.toml", &along, &files).is_ok());
        let turned = along.replace("hand.waypoints", "hand.turns");
        let error = Scene::load_texts("a.toml", &turned, &files).expect_err("no rotation");
        let said = "a.toml:12: device[0].hand.turns: found a device that does not turn, allowed: no such field";
        assert!(error.to_string().starts_with(said), "{error}");
        // A motion that the end cuts, and a row after the end at which the hand rests, are no errors.
        for change in [
            ("[0.5, 0, 0, -0.01]]", "[1.5, 0, 0, -0.01]]"),
            (
                "[0.5, 0, 0, -0.01]]",
                "[0.5, 0, 0, -0.01], [2, 0, 0, -0.01]]",
            ),
        ] {
            assert_eq!(warnings(&[change]), [""; 0]);
        }
    }

    #[test]
    fn a_device_that_gives_less_than_the_scene_asks_for_is_told() {
        let device = |device: &str| {
            let change = ("model = 'omega3'", device);
            // A person holds a device that is not simulated.
            let person = [
                change,
                ("hand.waypoints = [[0.0, 0, 0, 0], [0.5, 0, 0, -0.01]]", ""),
            ];
            warnings(if device.contains("'falcon'\nconnect = 'falcon'") {
                &person
            } else {
                &person[..1]
            })
        };
        assert_eq!(device("model = 'falcon'\nconnect = 'sim'"), [""; 0]);
        for connect in ["falcon", "emulated"] {
            let said = device(&format!("model = 'falcon'\nconnect = '{connect}'"));
            let expected = "a.toml:12: device[0].connect: found a Falcon with up to 8 N, usual: at most 5 N, which the driver \
                            commands; ";
            assert_eq!(said.len(), 1, "{said:?}");
            assert!(said[0].starts_with(expected), "{}", said[0]);
        }
        let within = "model = 'falcon'\nconnect = 'falcon'\nmax_force = 5";
        assert_eq!(device(within), [""; 0]);
        assert_eq!(device("model = 'omega3'\nconnect = 'emulated'"), [""; 0]);
        let more = device("model = 'omega3'\nmax_force = 50");
        let said = "a.toml:12: device[0].max_force: found 50 N, usual: at most 12 N, the largest force of Force Dimension \
                    omega.3; ";
        assert!(more.len() == 1 && more[0].starts_with(said), "{more:?}");
    }
}
