//! Whether the connections of a scene reach different devices.
//!
//! Two devices of a scene that reach one real device would both command it. The check asks the system what the
//! connections name, so it is made when a scene is planned or run, and not when a scene is read: the texts may differ,
//! and a log is replayed on another machine.

use super::drivers::drivers;
use super::{LoadedScene, SceneError};

/// Refuses a scene in which two devices have one connection. Nothing is opened.
///
/// # Errors
/// [`SceneError`] at the second of the two.
pub fn check(loaded: &LoadedScene) -> Result<(), SceneError> {
    let registry = drivers(Vec::new(), &loaded.beside(""));
    let devices = &loaded.scene.devices;
    for (index, device) in devices.iter().enumerate() {
        let before = devices.iter().take(index);
        let same = before
            .enumerate()
            .find(|(_, other)| registry.reach_the_same(&other.connect, &device.connect));
        let Some((first, other)) = same else { continue };
        let mut found = format!("the connection of device[{first}]");
        if other.connect != device.connect {
            let [one, another] = [&other.connect, &device.connect];
            found = format!("{found} (\"{one}\" and \"{another}\" reach one device)");
        }
        let field = format!("device[{index}].connect");
        let allowed = "a connection that no other device of the scene has; `palpate device list` prints what is connected";
        return Err(loaded.source.error(&field, found, allowed));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Override, Scene};
    use std::collections::BTreeMap;

    /// A scene with devices of these connections.
    fn scene(connections: &[&str]) -> LoadedScene {
        let mut text = String::from(
            "name = \"a\"\n[[body]]\nname = \"b\"\nmesh.box = { size = [0.1, 0.1, 0.1], cells = [1, 1, 1] }\n\
             material = { young = 1e3, poisson = 0.3, density = 1000 }\n",
        );
        for (index, connect) in connections.iter().enumerate() {
            let hand = if ["sim", "emulated"].contains(connect) {
                "hand = {}\n"
            } else {
                ""
            };
            text.extend([
                format!("[[device]]\nname = \"{index}\"\nmodel = \"omega3\"\n"),
                format!("connect = \"{connect}\"\n{hand}"),
            ]);
        }
        Scene::load_texts("a.toml", &text, &BTreeMap::new()).expect("a scene")
    }

    fn said(loaded: &LoadedScene) -> String {
        check(loaded).map_or_else(|error| error.to_string(), |()| "sound".to_owned())
    }

    #[test]
    fn one_connection_of_two_devices_is_refused() {
        let text = said(&scene(&["hid:/dev/hidraw0", "hid:/dev/hidraw0"]));
        let expected = "a.toml:13: device[1].connect: found the connection of device[0], allowed: a connection that no \
                        other";
        assert!(text.starts_with(expected), "{text}");
        // The third and the first, by other texts.
        let text = said(&scene(&["tcp:localhost:4000", "sim", "tcp:127.0.0.1:4000"]));
        let expected = "device[2].connect: found the connection of device[0] (\"tcp:localhost:4000\" and \
                        \"tcp:127.0.0.1:4000\" reach one device), allowed: ";
        assert!(text.contains(expected), "{text}");
    }

    #[test]
    fn different_devices_and_simulated_ones_are_sound() {
        for connections in [
            ["sim", "sim"],
            ["emulated", "emulated"],
            ["sim", "hid:/dev/hidraw0"],
            ["hid:/dev/hidraw0", "hid:/dev/hidraw1"],
            ["tcp:localhost:4000", "tcp:localhost:4001"],
        ] {
            assert_eq!(said(&scene(&connections)), "sound", "{connections:?}");
        }
    }

    /// A connection of the run, in place of that of the scene.
    #[test]
    fn an_override_is_held_against_the_other_devices() {
        let sound = scene(&["tcp:localhost:4000", "sim"]);
        let one = [Override::connection("1", "tcp:localhost:4000")];
        let text = said(&sound.overridden(&one).expect("a scene"));
        assert!(
            text.contains("device[1].connect: found the connection of device[0]"),
            "{text}"
        );
        let both = [Override::connection("0", "sim"), one[0].clone()];
        assert_eq!(said(&sound.overridden(&both).expect("a scene")), "sound");
    }
}
