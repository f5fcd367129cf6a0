//! Overrides: values that replace values of a scene for one run, such as another rate of the tick, another toughness, or a
//! simulated device in place of a real one.
//!
//! An override edits the text of the scene, and the edited text is read and checked like any other scene. The log of the
//! run holds the edited text, so that a replay of the log needs no overrides. Comments and order of the text stay.

use super::field::{Field, NoPlace, set, tables};
use super::load::load;
use super::spec::{EMULATED, SIMULATED};
use super::{LoadedScene, SceneError};
use devices::Connection;
use std::io;
use std::path::Path;
use toml_edit::{DocumentMut, InlineTable, Item, TableLike, Value};

/// A value that replaces the value of one field of a scene.
#[derive(Clone, Debug)]
pub struct Override(Change);

#[derive(Clone, Debug)]
enum Change {
    /// The value of a field.
    Field { field: Field, value: Value },
    /// The connection of a device.
    Connection { device: String, to: Connection },
    /// Every device is armed at the start.
    Armed,
}

impl Override {
    /// A number for the field `name` of the table `[table]`, in the unit of the field.
    pub fn number(table: &'static str, name: &'static str, value: f64) -> Self {
        // A whole number is quoted without its point: every `f64` below 2^53 is exact as an integer.
        let value = if value.fract() == 0.0 && value.abs() < 9e15 {
            Value::from(value as i64)
        } else {
            Value::from(value)
        };
        let field = Field::of(table, name);
        Self(Change::Field { field, value })
    }

    /// A word for the field `name` of the table `[table]`.
    pub fn word(table: &'static str, name: &'static str, value: &str) -> Self {
        let (field, value) = (Field::of(table, name), Value::from(value));
        Self(Change::Field { field, value })
    }

    /// Any value for any field: TOML, such as `450`, `true` or `[0, 0, -9.81]`, or else a word, such as `hold`.
    pub fn value(field: Field, text: &str) -> Self {
        let value = (text.parse::<Value>()).unwrap_or_else(|_| Value::from(text));
        Self(Change::Field { field, value })
    }

    /// Another connection for the device of that name, such as `sim` for a simulated device. The simulated device keeps
    /// the hand of the scene, or gets a hand that holds still. A device that is not simulated gives up its hand.
    pub fn connection(device: &str, to: &str) -> Self {
        Self(Change::Connection {
            device: device.to_owned(),
            to: Connection::parse(to),
        })
    }

    /// Every device is armed at the start of the run.
    pub fn armed() -> Self {
        Self(Change::Armed)
    }

    /// Writes the value into the text of a scene. A field or a table that the text lacks is added.
    fn write(&self, document: &mut DocumentMut) -> Result<(), (&Field, NoPlace)> {
        match &self.0 {
            Change::Field { field, value } => {
                let written = field.write(document, value.clone());
                return written.map_err(|no_place| (field, no_place));
            }
            Change::Armed => {
                let devices = document.get_mut("device").map(tables).unwrap_or_default();
                for device in devices {
                    arm(device);
                }
            }
            Change::Connection { device, to } => {
                let devices = document.get_mut("device").map(tables).unwrap_or_default();
                for table in devices {
                    if table.get("name").and_then(Item::as_str) == Some(device) {
                        connect(table, to);
                    }
                }
            }
        }
        Ok(())
    }
}

/// Gives the device of a table another connection.
fn connect(device: &mut dyn TableLike, to: &Connection) {
    set(device, "connect", Value::from(to.to_string()));
    if [SIMULATED, EMULATED].contains(&to.driver.as_str()) {
        device.remove("firmware");
        if to.driver == EMULATED {
            device.remove("wire");
        }
        if !device.contains_key("hand") {
            set(device, "hand", Value::from(InlineTable::new()));
        }
    } else {
        device.remove("hand");
        device.remove("wire");
    }
}

/// Arms the device of a table at the start.
fn arm(device: &mut dyn TableLike) {
    if let Some(engage) = device.get_mut("engage").and_then(Item::as_table_like_mut) {
        set(engage, "arm", Value::from("start"));
    } else {
        let mut engage = InlineTable::new();
        engage.insert("arm", Value::from("start"));
        set(device, "engage", Value::from(engage));
    }
}

impl LoadedScene {
    /// The scene with `overrides`. The files that the scene names are not read again.
    ///
    /// # Errors
    /// [`SceneError`] if the scene with the overrides is refused. The lines are those of the original text, here and
    /// in errors and warnings that are found later.
    ///
    /// ```
    /// use scene::{Override, Scene};
    ///
    /// let scene = Scene::embedded_default()?;
    /// let faster = scene.overridden(&[Override::number("loop", "rate", 2000.0)])?;
    /// assert_eq!(faster.scene.realtime.rate, 2000.0);
    /// assert!(scene.overridden(&[Override::number("loop", "rate", 1.0)]).is_err());
    /// # Ok::<(), scene::SceneError>(())
    /// ```
    pub fn overridden(&self, overrides: &[Override]) -> Result<Self, SceneError> {
        // The scene was read before: its text is TOML.
        let mut document: DocumentMut = self.source.text.parse().unwrap_or_default();
        for one in overrides {
            let written = one.write(&mut document);
            written.map_err(|(field, NoPlace { found, allowed })| {
                self.source.error(&field.to_string(), found, allowed)
            })?;
        }
        let source = self.source.edited(document.to_string());
        let folder = Path::new(&self.source.name).parent();
        let folder = folder.unwrap_or(Path::new(""));
        let kept = |path: &Path| {
            let mut files = self.files.iter();
            let file = files.find(|(name, _)| folder.join(name) == path);
            file.map(|(_, bytes)| bytes.clone())
                .ok_or_else(|| io::ErrorKind::NotFound.into())
        };
        load(source, folder, kept).map_err(|mut error| {
            // A field of a wrong type is found by its location in the edited text.
            if let Some(location) = error.location_mut() {
                location.line = self.source.location(&location.field).line;
            }
            error
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use std::collections::BTreeMap;

    const BODY: &str = "\
[[body]]
name = \"b\"
mesh.box = { size = [0.1, 0.1, 0.1], cells = [1, 1, 1] }
material = { young = 1e3, poisson = 0.3, density = 1000 }
";

    fn load(text: &str) -> LoadedScene {
        Scene::load_texts("a.toml", text, &BTreeMap::new()).expect("a scene")
    }

    /// However a scene writes its table, the field is replaced, and all else stays.
    #[test]
    fn every_notation_of_a_table_is_edited() {
        for (head, tail) in [
            ("name = \"a\"", "[loop]\nrate = 500 # slow\n"),
            ("name = \"a\"\nloop.rate = 500 # slow", ""),
            ("name = \"a\"\nloop = { rate = 500, blend = 0.4 }", ""),
            ("name = \"a\" # head", "[loop]\nblend = 0.4\n"),
            ("name = \"a\" # head", ""),
        ] {
            let before = load(&format!("{head}\n{BODY}{tail}"));
            let overrides = [
                Override::number("loop", "rate", 2000.0),
                Override::word("loop", "scheme", "hold"),
                Override::number("host", "latency", 0.0125),
            ];
            let after = before.overridden(&overrides).expect("a scene");
            let (old, new) = (&before.scene.realtime, &after.scene.realtime);
            assert_eq!(new.rate, 2000.0, "{}", after.source.text);
            assert_eq!(new.scheme, crate::spec::SchemeName::Hold);
            assert_eq!(after.scene.host.latency, 0.0125);
            assert_eq!(new.blend, old.blend);
            assert_eq!(after.scene.bodies.len(), 1);
            for comment in ["# slow", "# head"] {
                let has = |scene: &LoadedScene| scene.source.text.contains(comment);
                assert_eq!(has(&before), has(&after), "{}", after.source.text);
            }
            // The log holds the edited text, and a replay reads it.
            assert_eq!(load(&after.source.text).scene.realtime.rate, 2000.0);
        }
    }

    #[test]
    fn an_error_names_the_line_of_the_original_text() {
        let scene = load(&format!("name = \"a\"\n[loop]\nblend = 0.4\n{BODY}"));
        let said = |one| scene.overridden(&[one]).expect_err("refused").to_string();
        assert_eq!(
            said(Override::number("loop", "rate", 20.0)),
            "a.toml:2: loop.rate: found 20, allowed: a number from 100 to 10000 (Hz)"
        );
        assert_eq!(
            said(Override::number("loop", "rate", f64::NAN)),
            "a.toml:2: loop.rate: found nan, allowed: a number from 100 to 10000 (Hz)"
        );
        let schemes = said(Override::word("loop", "scheme", "held"));
        assert!(
            schemes.starts_with("a.toml:2: loop.scheme: found \"held\", allowed: "),
            "{schemes}"
        );
    }

    #[test]
    fn any_field_is_set_by_its_name() {
        let scene = load(&format!(
            "name = \"a\"\ngravity = [0, 0, -1]\n{BODY}[[body]]\nname = \"c\"\nmesh.box = {{ size = [0.1, 0.1, 0.1], \
             cells = [1, 1, 1] }}\nmaterial = {{ young = 1e3, poisson = 0.3, density = 1000 }} # soft\n"
        ));
        let set = |text: &str| {
            let (field, value) = text.split_once('=').expect("a value");
            let field = field.parse().expect("a field");
            scene.overridden(&[Override::value(field, value)])
        };
        let young = |scene: &LoadedScene, body: usize| scene.scene.bodies[body].material.young;
        for (text, body) in [
            ("body[0].material.young=250", 0),
            ("body[1].material.young=2.5e2", 1),
            ("body[c].material.young=250.0", 1),
        ] {
            let after = set(text).expect("a scene");
            assert_eq!(young(&after, body), 250.0, "{text}");
            assert_eq!(young(&after, 1 - body), 1e3, "{text}");
            assert!(after.source.text.contains("# soft"));
        }
        let after = set("gravity[2]=-2.5").expect("a scene");
        assert_eq!(after.scene.gravity, [0.0, 0.0, -2.5]);
        let after = set("gravity=[0, -9.81, 0]").expect("a scene");
        assert_eq!(after.scene.gravity, [0.0, -9.81, 0.0]);
        let after = set("loop.scheme=hold").expect("a scene");
        assert_eq!(after.scene.realtime.scheme, crate::spec::SchemeName::Hold);
        let after = set("body[0].damping.mass=2").expect("a scene");
        assert_eq!(after.scene.bodies[0].damping.mass, 2.0);

        for (text, said) in [
            (
                "body[2].material.young=1",
                "body[2].material.young: found body[2], allowed: 0, 1, b, c",
            ),
            (
                "device[left].model=falcon",
                "found device[left], allowed: a list",
            ),
            (
                "body.material.young=1",
                "found a list as `body`, allowed: a table",
            ),
            (
                "body[0].material.young=-1",
                "body[0].material.young: found -1, allowed: ",
            ),
            (
                "body[0].material.yuong=1",
                "body[0].material.yuong: unknown field",
            ),
            ("body[0].material.young=soft", "found \"soft\""),
        ] {
            let error = set(text).expect_err(text).to_string();
            assert!(error.starts_with("a.toml:"), "{error}");
            assert!(error.contains(said), "{error}");
        }
        for text in [
            "", ".", "body[", "body[].a", "body[0]a", "a..b", "a b", "[0]", "a.",
        ] {
            let error = text.parse::<Field>().expect_err(text).to_string();
            assert!(error.contains("allowed: a field of the scene"), "{error}");
        }
    }
}
