//! `--set`: fields of the scene that a command replaces.

use super::CommandError;
use host::scene::{Field, LoadedScene, Override, Scene};
use std::path::Path;

/// Fields of the scene that a command replaces.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct Sets {
    /// Replace a field of the scene: `body[0].tear.toughness=450` or `device[left].model=falcon`, where `[0]` is the first
    /// table of a list and `[left]` the table of that name. Units are those of the scene. May be given several times
    #[arg(long = "set", value_name = "FIELD=VALUE", value_parser = assignment)]
    sets: Vec<Assignment>,
}

/// Values of the scene that every command which runs the scene can replace.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct Values {
    #[command(flatten)]
    sets: Sets,
    /// Connection of a device: `left=sim` simulates the device `left` (its hand is the scene's, or holds still), and
    /// `left=hid:1209:c0de` opens a real device. May be given several times. Default: `connect` of the device in the
    /// scene
    #[arg(long = "device", value_name = "NAME=CONNECT", value_parser = named_connection)]
    devices: Vec<(String, String)>,
}

/// Parses `NAME=CONNECT`.
fn named_connection(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, to)) if !name.is_empty() && !to.is_empty() => {
            Ok((name.to_owned(), to.to_owned()))
        }
        _ => Err(format!(
            "found {text}, allowed: the name of a device and its connection, such as left=sim"
        )),
    }
}

/// A field and its values, as the user writes them.
#[derive(Clone, Debug)]
pub(super) struct Assignment {
    pub(super) field: Field,
    pub(super) values: Vec<String>,
}

/// Parses `FIELD=VALUE` or `FIELD=VALUE,VALUE`.
pub(super) fn assignment(text: &str) -> Result<Assignment, String> {
    let (field, value) = (text.split_once('=')).ok_or_else(|| {
        "allowed: a field of the scene and its value, such as body[0].material.young=2e5".to_owned()
    })?;
    let field = field.trim().parse::<Field>();
    Ok(Assignment {
        field: field.map_err(|error| error.to_string())?,
        values: split(value.trim()),
    })
}

/// The values of a list, which commas divide outside brackets, braces and quotes.
fn split(text: &str) -> Vec<String> {
    let (mut depth, mut quote) = (0_i32, None);
    let mut values = vec![String::new()];
    for c in text.chars() {
        match (c, quote) {
            ('"' | '\'', None) => quote = Some(c),
            (_, Some(open)) if c == open => quote = None,
            ('[' | '{', None) => depth += 1,
            (']' | '}', None) => depth -= 1,
            (',', None) if depth == 0 => {
                values.push(String::new());
                continue;
            }
            _ => {}
        }
        if let Some(value) = values.last_mut() {
            value.push(c);
        }
    }
    values.iter().map(|value| value.trim().to_owned()).collect()
}

impl Sets {
    /// Each argument as the user writes it, and its value.
    ///
    /// # Errors
    /// [`CommandError::ManyValues`] if a field has several values.
    pub(super) fn given(&self) -> Result<Vec<(String, Override)>, CommandError> {
        let each = self.sets.iter().map(|Assignment { field, values }| {
            let [value] = values.as_slice() else {
                return Err(CommandError::ManyValues {
                    given: format!("--set {field}={}", values.join(",")),
                    count: values.len(),
                });
            };
            let value_of = Override::value(field.clone(), value);
            Ok((format!("--set {field}={value}"), value_of))
        });
        each.collect()
    }
}

impl Values {
    /// Checks that every device whose connection is given exists.
    fn check_devices(&self, scene: &LoadedScene) -> Result<(), CommandError> {
        let known = &scene.scene.devices;
        let missing = self
            .devices
            .iter()
            .find(|(name, _)| known.iter().all(|device| device.name != *name));
        match missing {
            None => Ok(()),
            Some((name, to)) => Err(CommandError::NoSuchDevice {
                given: format!("--device {name}={to}"),
                found: name.clone(),
                allowed: known
                    .iter()
                    .map(|device| format!("{:?}", device.name))
                    .collect::<Vec<_>>()
                    .join(", "),
            }),
        }
    }

    /// The scene at `path`, or the built-in one, with these values, and then with those of `more`. Prints warnings about values that are possible
    /// in the scene, but unlikely.
    pub(super) fn load(
        &self,
        path: Option<&Path>,
        more: Vec<(String, Override)>,
    ) -> Result<LoadedScene, CommandError> {
        let mut given = self.sets.given()?;
        given.extend(self.devices.iter().map(|(name, to)| {
            let flag = format!("--device {name}={to}");
            (flag, Override::connection(name, to))
        }));
        given.extend(more);
        load_with(path, given, |scene| self.check_devices(scene))
    }
}

/// The scene at `path`, or the built-in one, in which the values of `given` replace those of the scene, once `check` has
/// accepted the scene without them. Prints the values of the scene that are possible, but unlikely.
pub(super) fn load_with(
    path: Option<&Path>,
    given: Vec<(String, Override)>,
    check: impl FnOnce(&LoadedScene) -> Result<(), CommandError>,
) -> Result<LoadedScene, CommandError> {
    let mut loaded = path.map_or_else(Scene::embedded_default, Scene::load)?;
    check(&loaded)?;
    let (flags, values): (Vec<_>, Vec<_>) = given.into_iter().unzip();
    if !values.is_empty() {
        loaded = (loaded.overridden(&values)).map_err(|source| CommandError::Override {
            given: flags.join(" "),
            source,
        })?;
    }
    for warning in &loaded.warnings {
        errln!("warning: {warning}");
    }
    Ok(loaded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_divide_values_outside_brackets_and_quotes() {
        for (text, values) in [
            ("450", vec!["450"]),
            ("300, 450,600", vec!["300", "450", "600"]),
            ("[0,0,-1]", vec!["[0,0,-1]"]),
            ("[0,0],[1,1]", vec!["[0,0]", "[1,1]"]),
            ("{ a = [1,2], b = 3 }", vec!["{ a = [1,2], b = 3 }"]),
            ("\"a,b\",'c,d'", vec!["\"a,b\"", "'c,d'"]),
            ("hold,capped", vec!["hold", "capped"]),
        ] {
            assert_eq!(split(text), values, "{text}");
        }
    }
}
