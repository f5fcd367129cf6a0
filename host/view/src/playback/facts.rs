//! The facts of a log that do not change while it is played, and the opening of a player.

use super::shown::Shown;
use super::{Player, PlayerError, SPAN};
use crate::history::History;
use host::bodies::{self, Built};
use host::live::frame::PROTOCOL;
use host::live::{
    BodyInfo, DeviceInfo, Folded, Frame, HandleInfo, Hello, Message, Source, Surface,
};
use host::log::fold::{FoldFacts, at_most};
use host::log::index::LogIndex;
use host::log::overview::{Overview, OverviewBuilder};
use host::scene::{LoadedScene, Scene};
use std::collections::VecDeque;
use std::io::{Read, Seek};
use std::time::Duration;

/// The facts of a log.
pub(super) struct Facts {
    pub(super) fold: FoldFacts,
    /// By body: the surface at rest, for a log without frames.
    pub(super) rest: Vec<Surface>,
}

/// The whole log in at most `most` pieces.
pub(super) fn timeline(overview: &Overview, most: usize) -> Vec<Folded> {
    let pieces = overview.pieces.iter().map(|piece| piece.folded.clone());
    at_most(most, &pieces.collect::<Vec<_>>())
}

impl<R: Read + Seek + Send> Player<R> {
    /// Opens a log. `name` is its name in messages. `progress` is given the fraction done of a log that is read from
    /// the front.
    ///
    /// # Errors
    /// [`PlayerError`].
    pub fn of(source: R, name: &str, progress: impl FnMut(f64)) -> Result<Self, PlayerError> {
        let failed = |source| PlayerError::Read {
            log: name.to_owned(),
            source,
        };
        let empty = || PlayerError::Empty {
            log: name.to_owned(),
        };
        let mut log = LogIndex::open(source).map_err(failed)?;
        if log.chunk_count() == 0 {
            return Err(empty());
        }
        let scene = format!("{name} (its scene)");
        let loaded = Scene::load_texts(&scene, log.scene(), log.files())?;
        let fold = FoldFacts::of(&loaded.scene);
        let timed = log.facts().get("clock").is_some_and(|clock| clock == "real");
        let overview = match log.overview() {
            Some(overview) => overview.clone(),
            None => read_through(&mut log, &fold, timed, progress).map_err(failed)?,
        };
        let place = log.first().map_err(failed)?.ok_or_else(empty)?;
        let last = log.last().map_err(failed)?.ok_or_else(empty)?;
        let row = log.row(place).map_err(failed)?.ok_or_else(empty)?;
        let to_ns = log.row(last).map_err(failed)?.map_or(0, |row| row.time_ns);
        let notes = notes(&log, &overview);
        let built = (0..loaded.scene.bodies.len()).map(|index| bodies::build(&loaded, index));
        let built = built.collect::<Result<Vec<_>, _>>()?;
        let hello = hello(&log, name, &loaded, &built, to_ns);
        let facts = Facts {
            rest: built
                .iter()
                .zip(0..)
                .map(|(built, index)| at_rest(built, index))
                .collect(),
            fold: fold.clone(),
        };
        let mut player = Self {
            notes,
            hello: Message::Hello(Box::new(hello)),
            from_ns: row.time_ns,
            to_ns: to_ns.max(row.time_ns),
            playing: true,
            speed: 1.0,
            at_ns: row.time_ns as f64,
            waited: Duration::ZERO,
            place,
            shown: Shown::new(fold, row),
            number: 0,
            history: History::new(SPAN),
            surfaces: Vec::new(),
            frame: Frame::default(),
            waiting: VecDeque::new(),
            failed: None,
            read: None,
            log,
            facts,
            overview,
        };
        player.begin()?;
        Ok(player)
    }
}

/// Reads all ticks of a log that has no overview.
fn read_through<R: Read + Seek>(
    log: &mut LogIndex<R>,
    facts: &FoldFacts,
    timed: bool,
    mut progress: impl FnMut(f64),
) -> Result<Overview, host::log::index::IndexError> {
    let mut builder = OverviewBuilder::new(facts.clone());
    let count = log.chunk_count();
    for number in 0..count {
        let chunk = log.chunk(number)?;
        chunk.ticks.iter().for_each(|row| builder.take(row));
        progress((number + 1) as f64 / count as f64);
    }
    Ok(builder.finish(timed))
}

/// What the log lacks.
fn notes<R: Read + Seek>(log: &LogIndex<R>, overview: &Overview) -> Vec<String> {
    let mut notes = Vec::new();
    if !log.is_complete() {
        notes.push("The log has no end: its writer was killed. The log plays to where it ends.".into());
    }
    if !log.has_frames() {
        notes.push(
            "The log has no frames of the bodies: the bodies are drawn at rest. `palpate run --log-frames RATE` writes \
             frames."
                .into(),
        );
    }
    if overview.totals.lost > 0 {
        let lost = overview.totals.lost;
        notes.push(format!("The log lacks {lost} ticks, because its ring was full."));
    }
    if overview.more_events > 0 {
        let (first, more) = (overview.events.len(), overview.more_events);
        notes.push(format!(
            "The list of events has the first {first} events and leaves out {more} later ones."
        ));
    }
    notes
}

fn hello<R: Read + Seek>(
    log: &LogIndex<R>,
    name: &str,
    loaded: &LoadedScene,
    built: &[Built],
    to_ns: u64,
) -> Hello {
    let scene = &loaded.scene;
    let fact = |key: &str| log.facts().get(key).cloned().unwrap_or_default();
    let devices = scene.devices.iter().zip(&loaded.models);
    let devices = devices.map(|(device, model)| DeviceInfo {
        name: device.name.clone(),
        model: model.name.clone(),
        max_force: device
            .max_force
            .unwrap_or(f64::INFINITY)
            .min(model.max_force),
        age_limit: scene.realtime.age_limit(),
    });
    let bodies = scene.bodies.iter().zip(built).enumerate();
    let bodies = bodies.map(|(index, (body, built))| {
        let tools = bodies::tools(body);
        let origins = bodies::handle_origins(loaded, index).unwrap_or_default();
        let handles = tools.iter().zip(origins).map(|(tool, origin)| HandleInfo {
            device: tool.device as u32,
            origin: origin.into(),
        });
        BodyInfo {
            name: body.name.clone(),
            kind: format!("{:?}", built.kind).to_lowercase(),
            vertices: built.body.vertex_count() as u32,
            elements: built.body.element_count() as u32,
            handles: handles.collect(),
        }
    });
    Hello {
        protocol: PROTOCOL.into(),
        source: Source::Log,
        file: name.to_owned(),
        scene: scene.name.clone(),
        clock: fact("clock"),
        scheme: fact("scheme"),
        tick_rate: scene.realtime.rate,
        step_rate: scene.host.step_rate,
        publish_rate: scene.host.publish_rate,
        duration: (to_ns as f64).mul_add(1e-9, 1.0 / scene.realtime.rate),
        devices: devices.collect(),
        bodies: bodies.collect(),
        facts: log.facts().clone(),
        scene_text: log.scene().to_owned(),
        files: log.files().clone(),
        ..Hello::default()
    }
}

fn at_rest(built: &Built, index: u32) -> Surface {
    let rest: Vec<f32> = built
        .mesh
        .positions()
        .iter()
        .flat_map(|p| [p.x as f32, p.y as f32, p.z as f32])
        .collect();
    Surface {
        body: index,
        vertices: (rest.len() / 3) as u32,
        rest,
        ..Surface::default()
    }
}
