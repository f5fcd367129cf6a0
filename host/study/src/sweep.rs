//! One scene with several values of some of its fields: a run in virtual time for each combination of the values.
//!
//! Each run is that of `palpate run` in virtual time, tick for tick. The runs are cells of a [`Study`]: they are
//! divided among the cores, and a sweep that was interrupted continues where it stopped.

use crate::StudyError;
use crate::compare::{Ran, run};
use crate::stress::{Done, Study, Verdict};
use crate::thin::thin;
use host::plot::{self, Component, Panel, Picture, Role, Series};
use host::run::tear_force::TearForce;
use host::scene::spec::Rotation;
use host::scene::{Field, LoadedScene, Override, SceneError};
use physics::Vec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Largest number of points of a force over time.
const POINTS: usize = 640;

/// A field of the scene and its values, as the user writes them.
#[derive(Clone, Debug)]
pub struct Axis {
    /// The field.
    pub field: Field,
    /// Its values: TOML, or else words.
    pub values: Vec<String>,
}

/// A scene for each combination of values.
#[derive(Clone, Debug)]
pub struct Sweep {
    fields: Vec<String>,
    /// The values of the fields and the scene with these values, the last field changing first.
    cells: Vec<(Vec<String>, LoadedScene)>,
    /// The component of the forces over time that is kept.
    component: Component,
    /// The text of the scene without the values, on which all results depend.
    text: String,
    /// The name of the scene.
    scene: String,
    /// The seed and the duration (s) of all runs, if they are not those of the scene.
    seed: Option<u64>,
    duration: Option<f64>,
}

/// The result of a run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Swept {
    /// The values of the fields.
    pub values: Vec<String>,
    /// The devices, in the scene's order.
    pub devices: Vec<SweptDevice>,
    /// The bodies that tore.
    pub tears: Vec<SweptTear>,
    /// The largest energy that the hands received beyond the energy stored at the start (J).
    pub net_energy: f64,
    /// Failures of the host, such as a panic.
    pub failures: Vec<String>,
}

/// A device in a run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SweptDevice {
    /// Its name.
    pub name: String,
    /// The largest force of its motors (N).
    pub peak: f64,
    /// The time of the largest force (s).
    pub peak_time: f64,
    /// Time in which the largest force of the device held a part of the force back (s).
    pub limited: f64,
    /// The most that it held back (N).
    pub held_back: f64,
    /// Its force over time (s, N): the norm, or the component along the axis of the scene that was asked for; peaks are kept.
    pub force: Vec<(f64, f64)>,
}

/// The tears of a body in a run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SweptTear {
    /// Name of the body.
    pub body: String,
    /// The force of the device that pulled hardest.
    pub force: TearForce,
    /// The torn area (m^2).
    pub area: f64,
    /// The energy that the torn area takes (J).
    pub energy: f64,
}

/// Why a combination of values cannot be run.
#[derive(Debug, thiserror::Error)]
#[error("with {given}: {source}")]
pub struct SweepError {
    /// The values, as the user writes them.
    pub given: String,
    /// The fault of the scene.
    #[source]
    pub source: SceneError,
}

impl Sweep {
    /// The combinations of the values of `axes` in `loaded`, with the `component` of their forces over time. Every scene is checked
    /// before the first run.
    ///
    /// # Errors
    /// [`SweepError`] for the first combination that the scene refuses.
    pub fn new(
        loaded: &LoadedScene,
        axes: &[Axis],
        component: Component,
    ) -> Result<Self, SweepError> {
        let mut choices: Vec<Vec<&str>> = vec![Vec::new()];
        for axis in axes {
            let longer = choices.iter().flat_map(|chosen| {
                let with = |value| [chosen.as_slice(), &[value]].concat();
                axis.values.iter().map(move |value| with(value.as_str()))
            });
            choices = longer.collect();
        }
        let cells = choices.into_iter().map(|chosen| {
            let pairs = || axes.iter().zip(&chosen);
            let overrides = pairs().map(|(axis, value)| Override::value(axis.field.clone(), value));
            let scene = loaded.overridden(&overrides.collect::<Vec<_>>());
            let scene = scene.map_err(|source| SweepError {
                given: (pairs().map(|(axis, value)| format!("--set {}={value}", axis.field)))
                    .collect::<Vec<_>>()
                    .join(" "),
                source,
            })?;
            Ok((chosen.into_iter().map(str::to_owned).collect(), scene))
        });
        Ok(Self {
            fields: axes.iter().map(|axis| axis.field.to_string()).collect(),
            cells: cells.collect::<Result<_, _>>()?,
            component,
            text: loaded.source.text.clone(),
            scene: loaded.scene.name.clone(),
            seed: None,
            duration: None,
        })
    }

    /// The sweep with another seed and another duration (s) than those of the scene, if they are given.
    pub fn with(mut self, seed: Option<u64>, duration: Option<f64>) -> Self {
        (self.seed, self.duration) = (seed, duration);
        self
    }
}

impl Study for Sweep {
    type Outcome = Swept;
    const NAME: &'static str = "sweep";
    const SCHEMA: u32 = 3;

    fn seed(&self) -> u64 {
        let first = self.cells.first();
        self.seed
            .unwrap_or(first.map_or(0, |(_, cell)| cell.scene.seed))
    }

    fn cells(&self) -> u64 {
        self.cells.len() as u64
    }

    fn settings(&self) -> serde_json::Value {
        let values: Vec<_> = self.cells.iter().map(|(values, _)| values).collect();
        serde_json::json!({
            "scene": self.text,
            "fields": self.fields,
            "values": values,
            "duration": self.duration,
            "force": self.component.label(),
        })
    }

    fn cell(&self, cell: u64, done: &Done<'_>) -> Swept {
        let (values, loaded) = &self.cells[cell as usize];
        let mut loaded = loaded.clone();
        loaded.scene.seed = self.seed.unwrap_or(loaded.scene.seed);
        loaded.scene.duration = self.duration.unwrap_or(loaded.scene.duration);
        swept(values.clone(), &loaded, self.component, done)
    }

    fn summary(&self, cells: &BTreeMap<u64, Swept>) -> String {
        let runs: Vec<&Swept> = cells.values().collect();
        table(&self.scene, &self.fields, &runs)
    }

    fn verdict(&self, cells: &BTreeMap<u64, Swept>) -> Verdict {
        Verdict {
            incomplete: cells.values().any(|run| !run.failures.is_empty()),
            ..Verdict::default()
        }
    }

    fn draw(&self, cells: &BTreeMap<u64, Swept>) -> Option<Picture> {
        let runs: Vec<&Swept> = cells.values().collect();
        Some(picture(&self.scene, &self.fields, &runs, self.component))
    }
}

fn swept(
    values: Vec<String>,
    loaded: &LoadedScene,
    component: Component,
    done: &dyn Fn(f64),
) -> Swept {
    match run(loaded, &[], &|thousandths: u64| {
        done(1e-3 * thousandths as f64);
    }) {
        Ok(ran) => measured(values, loaded, component, &ran),
        Err(error) => Swept {
            values,
            devices: Vec::new(),
            tears: Vec::new(),
            net_energy: 0.0,
            failures: vec![StudyError::to_string(&error)],
        },
    }
}

fn measured(values: Vec<String>, loaded: &LoadedScene, component: Component, ran: &Ran) -> Swept {
    let record = &ran.record;
    let devices = loaded.scene.devices.iter().zip(&record.devices);
    let devices = devices.map(|(device, found)| {
        let norms: Vec<f64> = found.force.iter().map(Vec3::norm).collect();
        let peak = (0..norms.len()).max_by(|a, b| norms[*a].total_cmp(&norms[*b]));
        let peak = peak.unwrap_or(0);
        let mounted = device.mounting.rotation.map(Rotation::quaternion);
        let in_scene = |force: &Vec3| mounted.map_or(*force, |rotation| rotation * force);
        let drawn: Vec<f64> = (found.force.iter())
            .map(|force| component.of(&in_scene(force)))
            .collect();
        SweptDevice {
            name: device.name.clone(),
            peak: norms.get(peak).copied().unwrap_or(0.0),
            peak_time: peak as f64 * record.period,
            limited: found.held_back.ticks as f64 * record.period,
            held_back: found.held_back.most,
            force: thin(record.period, &drawn, POINTS),
        }
    });
    let bodies = loaded.scene.bodies.iter().zip(&ran.tears);
    let tears = bodies
        .zip(&ran.tear_forces)
        .filter_map(|((body, report), force)| {
            Some(SweptTear {
                body: body.name.clone(),
                force: force.clone()?,
                area: report.area,
                energy: report.due,
            })
        });
    Swept {
        values,
        devices: devices.collect(),
        tears: tears.collect(),
        net_energy: record.out.iter().copied().fold(0.0, f64::max),
        failures: ran.failures.clone(),
    }
}

/// The part of a field's name that tells it from the other fields of a table: the last one.
fn short(field: &str) -> &str {
    field.rsplit('.').next().unwrap_or(field)
}

/// One row for each run.
fn table(scene: &str, fields: &[String], runs: &[&Swept]) -> String {
    let mut text = String::new();
    put!(text, "{scene}: {} runs in virtual time\n", runs.len());
    let mut heads: Vec<String> = fields.iter().map(|field| short(field).to_owned()).collect();
    let first = runs.iter().max_by_key(|run| run.devices.len());
    let devices = first.map_or(&[][..], |run| &run.devices);
    heads.extend((devices.iter()).map(|device| format!("{} peak N (at s)", device.name)));
    heads.push("net energy mJ".to_owned());
    let tears = runs.iter().any(|run| !run.tears.is_empty());
    if tears {
        heads.push("tear: start N (at s), peak N, plateau N, mm2, mJ".to_owned());
    }
    let limited = (runs.iter().flat_map(|run| &run.devices)).any(|device| device.limited > 0.0);
    if limited {
        heads.push("limited by the device: s, by at most N".to_owned());
    }
    put!(text, "| {} |", heads.join(" | "));
    put!(text, "|{}", "---|".repeat(heads.len()));
    for run in runs {
        let mut row = run.values.clone();
        let peak = |device: &SweptDevice| format!("{:.3} ({:.3})", device.peak, device.peak_time);
        row.extend(run.devices.iter().map(peak));
        row.push(format!("{:.3}", 1e3 * run.net_energy));
        if tears {
            let each = run.tears.iter().map(|tear| {
                format!(
                    "{:.2} ({:.3}), {:.2}, {:.2}, {:.1}, {:.2}",
                    tear.force.start,
                    tear.force.from,
                    tear.force.peak,
                    tear.force.plateau,
                    1e6 * tear.area,
                    1e3 * tear.energy
                )
            });
            row.push(each.collect::<Vec<_>>().join("; "));
        }
        if limited {
            let each = run.devices.iter().filter(|device| device.limited > 0.0);
            let each = each.map(|device| {
                let (name, time, most) = (&device.name, device.limited, device.held_back);
                format!("{name} {time:.3}, {most:.2}")
            });
            row.push(each.collect::<Vec<_>>().join("; "));
        }
        put!(text, "| {} |", row.join(" | "));
    }
    for run in runs {
        for failure in &run.failures {
            put!(text, "\nFAILED {}: {failure}", named(fields, run));
        }
    }
    text
}

/// The values of a run with the names of their fields.
fn named(fields: &[String], run: &Swept) -> String {
    let pairs = fields.iter().zip(&run.values);
    let pairs: Vec<_> = pairs
        .map(|(field, value)| format!("{} {value}", short(field)))
        .collect();
    pairs.join(", ")
}

/// The force of each device over time, a line for each run.
fn picture(scene: &str, fields: &[String], runs: &[&Swept], component: Component) -> Picture {
    let first = runs.iter().max_by_key(|run| run.devices.len());
    let devices = first.map_or(&[][..], |run| &run.devices);
    let panels = devices.iter().enumerate().map(|(index, device)| Panel {
        title: device.name.clone(),
        x_label: "Time (s)".to_owned(),
        y_label: format!("Force{} (N)", component.label()),
        series: (runs.iter().enumerate())
            .filter_map(|(number, run)| {
                Some(Series {
                    name: named(fields, run),
                    points: run.devices.get(index)?.force.clone(),
                    role: Role::Number(number),
                    ..Series::default()
                })
            })
            .collect(),
        ..Panel::default()
    });
    let panels: Vec<_> = panels.collect();
    let subtitle = format!("virtual time; by {}", fields.join(", "));
    plot::panels(
        &format!("{scene}: {} runs", runs.len()),
        &subtitle,
        1,
        &panels,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_combination_has_its_scene_and_an_impossible_one_is_refused_before_the_first_run() {
        let loaded = host::scene::Scene::embedded_default().expect("the built-in scene");
        let axis = |field: &str, values: &[&str]| Axis {
            field: field.parse().expect("a field"),
            values: values.iter().map(|value| (*value).to_owned()).collect(),
        };
        let axes = [
            axis("body[0].material.young", &["1e5", "2e5", "3e5"]),
            axis("loop.scheme", &["hold", "capped"]),
        ];
        let sweep = Sweep::new(&loaded, &axes, Component::Norm).expect("six scenes");
        let found: Vec<_> = (sweep.cells.iter())
            .map(|(values, cell)| (values.join(" "), cell.scene.bodies[0].material.young))
            .collect();
        assert_eq!(found.len(), 6);
        assert_eq!(found[1], ("1e5 capped".to_owned(), 1e5));
        assert_eq!(found[4], ("3e5 hold".to_owned(), 3e5));
        let axes = [axis("body[0].material.young", &["1e5", "-2"])];
        let said = Sweep::new(&loaded, &axes, Component::Norm)
            .expect_err("refused")
            .to_string();
        assert!(
            said.starts_with("with --set body[0].material.young=-2: "),
            "{said}"
        );
        assert!(said.contains("found -2"), "{said}");
    }
}
