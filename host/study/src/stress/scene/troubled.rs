//! The trouble of a run, around the host of every run ([`Paced`]) and its link.

use super::draw::{Draw, Span};
use super::trial::Trial;
use crate::StudyError;
use crate::chance::Chance;
use host::engine::Engine;
use host::engine::build::{self, BuildOptions};
use host::engine::faults::{FaultKind, HostFault};
use host::run::late::LateLink;
use host::run::paced::{Host, HostLink, Paced};
use host::world::World;
use rt_core::tool::Patch;
use rt_core::{LocalModel, TickRecord};
use runner::link::HostEnd;

/// A link that is late at random, and loses models and records.
pub(in crate::stress) struct Lossy {
    link: LateLink,
    /// The largest random delay beyond the latency (ns), and the fractions of models and records that are lost.
    jitter_ns: f64,
    models_lost: f64,
    records_lost: f64,
    chance: Chance,
    /// Number of records so far.
    records: u64,
    /// By body, the numbers of the newest model that was sent and of the newest that arrived.
    newest: Vec<[u64; 2]>,
}

impl Lossy {
    pub(in crate::stress) fn new(
        link: LateLink,
        draw: &Draw,
        chance: Chance,
        bodies: usize,
    ) -> Self {
        Self {
            link,
            jitter_ns: draw.jitter * (draw.latency + 1.0 / draw.rate) * 1e9,
            models_lost: draw.models_lost,
            records_lost: draw.records_lost,
            chance,
            records: 0,
            newest: vec![[0; 2]; bodies],
        }
    }
}

impl HostLink for Lossy {
    fn drain(&mut self, mut see: impl FnMut(&TickRecord)) {
        let (lost, chance) = (self.records_lost, self.chance);
        let records = &mut self.records;
        self.link.drain(|record| {
            *records += 1;
            if chance.of("record").unit(*records) >= lost {
                see(record);
            }
        });
    }

    fn send(&mut self, arrival_ns: u64, body: usize, model: &LocalModel) {
        let (number, chance) = (model.head.sequence, self.chance);
        self.newest[body][0] = number;
        if chance.of("model").unit(number) >= self.models_lost {
            let late = self.jitter_ns * chance.of("late").unit(number);
            self.link.send(arrival_ns + late as u64, body, model);
        }
    }

    fn send_patch(&mut self, arrival_ns: u64, device: usize, patch: &Patch) {
        let (number, chance) = (patch.head.sequence, self.chance);
        if chance.of("patch").unit(number) >= self.models_lost {
            let late = self.jitter_ns * chance.of("late patch").unit(number);
            self.link
                .send_patch(arrival_ns + late as u64, device, patch);
        }
    }

    fn deliver(&mut self, now_ns: u64) {
        let newest = &mut self.newest;
        self.link.deliver(now_ns, |body, model| {
            newest[body][1] = newest[body][1].max(model.head.sequence);
        });
    }

    fn into_end(self) -> HostEnd {
        self.link.into_end()
    }
}

/// The stalls of a host. A stall that begins during another one is a part of it.
pub(in crate::stress) fn stalls(spans: &[Span]) -> Vec<HostFault> {
    let mut spans = spans.to_vec();
    spans.sort_unstable_by(|a, b| a.at.total_cmp(&b.at));
    let mut faults: Vec<HostFault> = Vec::new();
    for Span { at, duration } in spans {
        match faults.last_mut() {
            Some(last) if at <= last.at + last.duration => {
                last.duration = last.duration.max(at + duration - last.at);
            }
            _ => faults.push(HostFault {
                kind: FaultKind::Stall,
                at,
                duration,
            }),
        }
    }
    faults
}

/// A host whose bodies soften.
pub(super) struct Troubled<'a> {
    host: Paced<Lossy>,
    trial: &'a Trial,
    /// By body, the number of the last model before the bodies softened here.
    softened: Option<Vec<u64>>,
}

impl<'a> Troubled<'a> {
    pub(super) fn new(host: Paced<Lossy>, trial: &'a Trial) -> Self {
        Self {
            host,
            trial,
            softened: None,
        }
    }

    /// The physics.
    pub(super) fn engine(&self) -> &Engine {
        self.host.engine()
    }

    /// Whether the tick has yet to receive a model of a softened body.
    pub(super) fn awaits_model(&self) -> bool {
        let newest = &self.host.link().newest;
        self.softened.as_ref().is_none_or(|before| {
            let mut each = before.iter().zip(newest);
            each.any(|(before, [_, arrived])| arrived <= before)
        })
    }
}

impl Host for Troubled<'_> {
    type Error = StudyError;

    fn next_ns(&self) -> u64 {
        self.host.next_ns()
    }

    fn step(&mut self) -> Result<(), StudyError> {
        let time = self.next_ns() as f64 * 1e-9;
        if let (None, Some(softening), Some(soft)) =
            (&self.softened, self.trial.draw.softening, &self.trial.soft)
            && time >= softening.at
        {
            let others = build::bodies(&World::new(soft)?, BuildOptions::default())?;
            self.host.change(|engine| engine.exchange(others))?;
            let newest = self.host.link().newest.iter();
            self.softened = Some(newest.map(|[sent, _]| *sent).collect());
        }
        let Ok(()) = self.host.step();
        Ok(())
    }

    fn deliver(&mut self, now_ns: u64) {
        self.host.deliver(now_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stalls_that_overlap_are_one() {
        let span = |at, duration| Span { at, duration };
        let found = stalls(&[span(2.0, 0.5), span(1.0, 0.5), span(1.25, 0.5)]);
        let found: Vec<_> = found.iter().map(|f| (f.at, f.duration)).collect();
        assert_eq!(found, [(1.0, 0.75), (2.0, 0.5)]);
    }
}
