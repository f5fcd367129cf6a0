//! A cell as a scene file that `palpate run` repeats.

use super::trial::Trial;
use crate::StudyError;
use host::scene::LoadedScene;
use host::scene::spec::{GripName, SchemeName};
use std::path::{Path, absolute};
use toml::{Table, Value};

/// A cell as a scene file.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The scene (TOML).
    pub text: String,
    /// The properties of the cell that the scene cannot state, one sentence each. A stall comes with the option of `palpate run` that makes
    /// it.
    pub told: Vec<String>,
}

impl Written {
    /// The scene of `trial` under `scheme`.
    ///
    /// # Errors
    /// [`StudyError`] if the text of the scene cannot be read again, which its first reading excludes.
    pub(in crate::stress) fn of(trial: &Trial, scheme: SchemeName) -> Result<Self, StudyError> {
        let trial = trial.under(scheme);
        Ok(Self {
            text: text(&trial.loaded)?,
            told: told(&trial),
        })
    }
}

/// The text of a scene with the values that the study gives it.
fn text(loaded: &LoadedScene) -> Result<String, StudyError> {
    let scene = &loaded.scene;
    let mut table: Table = loaded.source.text.parse()?;
    table.insert("duration".to_owned(), scene.duration.into());
    let (realtime, host) = (&scene.realtime, &scene.host);
    let part = inner(&mut table, "loop");
    let name = super::SCHEMES
        .iter()
        .find(|(known, _)| *known == realtime.scheme);
    for (field, value) in [
        (
            "scheme",
            Value::from(name.map_or("capped", |(_, name)| name)),
        ),
        ("age_limit", realtime.age_limit().into()),
        ("thesis_stiffness", realtime.thesis_stiffness.into()),
    ] {
        part.insert(field.to_owned(), value);
    }
    let part = inner(&mut table, "host");
    for (field, value) in [
        ("step_rate", host.step_rate),
        ("publish_rate", host.publish_rate),
        ("latency", host.latency),
    ] {
        part.insert(field.to_owned(), value.into());
    }
    for body in tables(&mut table, "body") {
        if let Some(Value::Table(mesh)) = body.get_mut("mesh") {
            beside(loaded, mesh, "file");
        }
    }
    for (device, spec) in tables(&mut table, "device").zip(&scene.devices) {
        if device
            .get("model")
            .and_then(Value::as_str)
            .is_some_and(|name| Path::new(name).extension().is_some_and(|end| end == "toml"))
        {
            beside(loaded, device, "model");
        }
        if let Some(wire) = spec.wire {
            device.insert("wire".to_owned(), wire.into());
        }
        let Some(hand) = &spec.hand else {
            continue;
        };
        let arm = hand.arm();
        // The study's hands have waypoints alone.
        let waypoints = hand.waypoints.iter();
        let waypoints =
            waypoints.map(|row| Value::Array(row.iter().map(|x| (*x).into()).collect()));
        let mut written = Table::new();
        for (field, value) in [
            ("mass", arm.mass),
            ("damping", arm.damping),
            ("stiffness", arm.stiffness),
            ("tremor", hand.tremor),
        ] {
            written.insert(field.to_owned(), value.into());
        }
        if let Some(grip) = hand.grip {
            written.insert("grip".to_owned(), grip_name(grip).into());
        }
        written.insert("waypoints".to_owned(), Value::Array(waypoints.collect()));
        let before = device.insert("hand".to_owned(), Value::Table(written));
        let presses = before.as_ref().and_then(|hand| hand.get("presses"));
        if let (Some(presses), Some(Value::Table(hand))) = (presses, device.get_mut("hand")) {
            hand.insert("presses".to_owned(), presses.clone());
        }
    }
    Ok(table.to_string())
}

/// The table `name` of a table, which is added if it is missing.
fn inner<'a>(table: &'a mut Table, name: &str) -> &'a mut Table {
    let value = table.entry(name.to_owned());
    let value = value.or_insert_with(|| Value::Table(Table::new()));
    match value {
        Value::Table(inner) => inner,
        _ => unreachable!("the scene was read before"),
    }
}

/// The tables of the list `name`.
fn tables<'a>(table: &'a mut Table, name: &str) -> impl Iterator<Item = &'a mut Table> {
    let list = table.get_mut(name).and_then(Value::as_array_mut);
    list.into_iter().flatten().filter_map(Value::as_table_mut)
}

/// Gives a file of a scene its absolute path: the written scene may lie in another folder.
fn beside(loaded: &LoadedScene, table: &mut Table, field: &str) {
    let Some(Value::String(file)) = table.get_mut(field) else {
        return;
    };
    if let Ok(path) = absolute(loaded.beside(file))
        && let Some(path) = path.to_str()
    {
        path.clone_into(file);
    }
}

fn grip_name(grip: GripName) -> &'static str {
    match grip {
        GripName::Relaxed => "relaxed",
        GripName::Typical => "typical",
        GripName::Firm => "firm",
        GripName::Rigid => "rigid",
    }
}

/// The properties of a trial that a scene file cannot state.
fn told(trial: &Trial) -> Vec<String> {
    let draw = &trial.draw;
    let mut told = Vec::new();
    for stall in super::troubled::stalls(&draw.stalls) {
        told.push(format!(
            "the host stalls: give palpate run --fault stall@{:?}+{:?}",
            stall.at, stall.duration
        ));
    }
    let percent = |fraction: f64| 100.0 * fraction;
    if draw.jitter > 0.0 {
        told.push(format!(
            "models are up to {:.1} ms later at random, {:.0} % of the models and {:.0} % of the records are lost",
            1e3 * draw.jitter * (draw.latency + 1.0 / draw.rate),
            percent(draw.models_lost),
            percent(draw.records_lost)
        ));
    }
    if let Some(softening) = draw.softening {
        told.push(format!(
            "at {:.3} s the body softens to {:.0} % of its stiffness",
            softening.at,
            percent(softening.left)
        ));
    }
    if let Some(gone) = draw.vanishing {
        told.push(format!(
            "device {:?} is absent from {:.3} s for {:.3} s",
            trial.loaded.scene.devices[gone.device].name, gone.span.at, gone.span.duration
        ));
    }
    told
}
