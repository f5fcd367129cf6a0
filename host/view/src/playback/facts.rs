//! The facts of a log that do not change while it is played, and the opening of a player.

use super::{Player, PlayerError, SPAN};
use crate::history::History;
use crate::stress::Stresses;
use host::live::gather::Gatherer;
use host::live::{Frame, Hello, Message, Source};
use host::log::index::{IndexError, LogIndex};
use host::log::overview::{Overview, OverviewBuilder};
use host::record::{Surface, TickRow};
use host::run::Clock;
use host::scene::Scene;
use host::world::World;
use std::collections::VecDeque;
use std::io::{Read, Seek};
use std::time::Duration;

/// The facts of a log.
pub(super) struct Facts {
    /// The names of the bodies.
    pub(super) bodies: Vec<String>,
    /// A gatherer of the log's scene, which has taken no tick.
    pub(super) gatherer: Gatherer,
    /// By body: the surface at rest, for a log without frames.
    pub(super) rest: Vec<Surface>,
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
        let place = log.first().map_err(failed)?.ok_or_else(empty)?;
        let last = log.last().map_err(failed)?.ok_or_else(empty)?;
        let from_ns = log.row(place).map_err(failed)?.map_or(0, |row| row.time_ns);
        let to_ns = log.row(last).map_err(failed)?.map_or(0, |row| row.time_ns);
        let scene = format!("{name} (its scene)");
        let loaded = Scene::load_texts(&scene, log.scene(), log.files())?;
        let timed = log
            .facts()
            .get("clock")
            .is_some_and(|clock| clock == "real");
        let clock = if timed { Clock::Real } else { Clock::Virtual };
        let gatherer = Gatherer::new(&loaded, clock);
        let overview = match log.overview() {
            Some(overview) => overview.clone(),
            None => read_through(&mut log, &gatherer, progress).map_err(failed)?,
        };
        let world = World::new(&loaded)?;
        let gatherer = gatherer.with_obstacles(&world.obstacles);
        let length = (to_ns.saturating_sub(from_ns) as f64) * 1e-9;
        let hello = Hello {
            file: name.to_owned(),
            duration: length + 1.0 / loaded.scene.realtime.rate,
            ..Hello::new(Source::Log, &world, log.facts().clone())
        };
        let facts = Facts {
            bodies: loaded.scene.bodies.iter().map(|b| b.name.clone()).collect(),
            rest: (0..)
                .zip(&world.bodies)
                .map(|(index, built)| Surface::of_mesh(index, built.body.epoch(), &built.mesh))
                .collect(),
            gatherer: gatherer.clone(),
        };
        let mut player = Self {
            notes: notes(&log, &overview),
            from_ns,
            to_ns: to_ns.max(from_ns),
            playing: true,
            speed: 1.0,
            at_ns: from_ns as f64,
            waited: Duration::ZERO,
            place,
            tick: 0,
            gatherer,
            number: 0,
            history: History::new(SPAN),
            stresses: Stresses::new(&hello),
            stressed: false,
            surfaces: Vec::new(),
            frame: Frame::default(),
            waiting: VecDeque::new(),
            failed: None,
            read: None,
            log,
            facts,
            overview,
            hello: Message::Hello(Box::new(hello)),
        };
        player.waiting.push_back(player.hello.clone());
        player.show(place).map_err(|error| match error {
            PlayerError::Further(source) => failed(source),
            other => other,
        })?;
        Ok(player)
    }
}

/// Reads all ticks of a log that has no overview.
fn read_through<R: Read + Seek>(
    log: &mut LogIndex<R>,
    gatherer: &Gatherer,
    mut progress: impl FnMut(f64),
) -> Result<Overview, IndexError> {
    let mut builder = OverviewBuilder::new(gatherer.clone());
    let count = log.chunk_count();
    for number in 0..count {
        let chunk = log.chunk(number)?;
        let rows = chunk.records::<TickRow>().iter();
        rows.for_each(|row| builder.take(&row.into()));
        progress((number + 1) as f64 / count as f64);
    }
    Ok(builder.finish())
}

/// The missing parts of the log.
fn notes<R: Read + Seek>(log: &LogIndex<R>, overview: &Overview) -> Vec<String> {
    let mut notes = Vec::new();
    if !log.is_complete() {
        notes.push(
            "The log has no end, because its writer was killed. It plays to where it ends.".into(),
        );
    }
    if !log.has_frames() {
        notes.push(
            "The log has no frames of the bodies, so the bodies are drawn at rest. `palpate run --log-frames RATE` \
             writes frames."
                .into(),
        );
    }
    let lost = overview.totals.lost;
    if lost > 0 {
        notes.push(format!(
            "The log lacks {lost} ticks, because its ring was full."
        ));
    }
    let (first, more) = (overview.events.len(), overview.more_events);
    if more > 0 {
        notes.push(format!(
            "The list of events has {first} events and leaves out {more} later events."
        ));
    }
    notes
}
