//! The force with which a device tears a body: when the tear starts, the force in that tick, the largest force, and the
//! plateau. The summary of a run and a sweep use the same code, so that their numbers are equal.

use super::prepare::Prepared;
use super::tears::{TearEvents, TearSender};
use crate::scene::Scene;
use crate::world::grasps;
use rt_core::Telemetry;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Most values of a force that are kept: two minutes of ticks at 1 kHz.
const MOST: usize = 1 << 17;

/// The force of one device from the first edge that opened to the last. Forces are norms of the commanded force.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TearForce {
    /// Name of the device: of those that hold the body, the device whose force was largest between the two edges.
    pub device: String,
    /// Time of the tick in which the first edge was open (s).
    pub from: f64,
    /// Time of the tick in which the last edge was open (s).
    pub to: f64,
    /// The force in that first tick (N).
    pub start: f64,
    /// The largest force from the first edge to the last (N).
    pub peak: f64,
    /// The median of the force over the ticks from the first edge to the last (N).
    pub plateau: f64,
}

/// Watches the edges of one body and the forces of the devices that hold the body.
#[derive(Clone, Debug)]
pub(super) struct Watch {
    pulls: Vec<Pull>,
    /// Times of the first and of the latest edge (s); none before a tear.
    edges: Option<[f64; 2]>,
    /// The number of ticks from one kept force to the next.
    every: u64,
    ticks: u64,
    /// Most forces of a device that are kept.
    most: usize,
}

/// The force of one device since the first edge.
#[derive(Clone, Debug)]
struct Pull {
    device: usize,
    name: String,
    /// The force at the first edge (N).
    start: f64,
    /// The largest force so far, and until the latest edge (N).
    most: f64,
    peak: f64,
    /// The force of every tick of which one is kept (N), and the number of those until the latest edge.
    kept: Vec<f64>,
    until_edge: usize,
}

impl Watch {
    /// A watch over the body `index` of `scene`.
    pub(super) fn new(scene: &Scene, index: usize) -> Self {
        let grasps = grasps(scene, &scene.bodies[index]);
        let pulls = grasps.iter().filter_map(|grasp| {
            Some(Pull {
                device: grasp.device,
                name: scene.devices.get(grasp.device)?.name.clone(),
                start: 0.0,
                most: 0.0,
                peak: 0.0,
                kept: Vec::new(),
                until_edge: 0,
            })
        });
        Self {
            pulls: pulls.collect(),
            edges: None,
            every: 1,
            ticks: 0,
            most: MOST,
        }
    }

    /// Takes the tick at `time` (s), and whether an edge has opened since the last tick. `force`: the norm of the force
    /// of a device (N).
    pub(super) fn take(&mut self, time: f64, opened: bool, force: impl Fn(usize) -> f64) {
        let first = opened && self.edges.is_none();
        if opened {
            self.edges = Some([self.edges.map_or(time, |[first, _]| first), time]);
        }
        if self.edges.is_none() {
            return;
        }
        let keeps = self.ticks.is_multiple_of(self.every);
        for pull in &mut self.pulls {
            let now = force(pull.device);
            if first {
                pull.start = now;
            }
            pull.most = pull.most.max(now);
            if keeps {
                pull.kept.push(now);
            }
            if opened {
                pull.peak = pull.most;
                pull.until_edge = pull.kept.len();
            }
        }
        self.ticks += 1;
        // However long the run, the memory is bounded, and the median is that of ticks at equal distances.
        if self.pulls.iter().any(|pull| pull.kept.len() >= self.most) {
            self.every *= 2;
            for pull in &mut self.pulls {
                let mut number = 0;
                pull.kept.retain(|_| {
                    number += 1;
                    number % 2 == 1
                });
                pull.until_edge = pull.until_edge.div_ceil(2);
            }
        }
    }

    /// The force of the device that pulled hardest; `None` if nothing tore or no device holds the body.
    pub(super) fn finish(&self) -> Option<TearForce> {
        let [from, to] = self.edges?;
        let hardest = (self.pulls.iter()).max_by(|a, b| a.peak.total_cmp(&b.peak))?;
        Some(TearForce {
            device: hardest.name.clone(),
            from,
            to,
            start: hardest.start,
            peak: hardest.peak,
            plateau: median(&hardest.kept[..hardest.until_edge]),
        })
    }
}

/// The median of `values`, the mean of the middle two of an even number; zero of none.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let middle = |at: usize| sorted.get(at).copied().unwrap_or_default();
    let half = sorted.len() / 2;
    match sorted.len() % 2 {
        0 => 0.5 * (middle(half.saturating_sub(1)) + middle(half)),
        _ => middle(half),
    }
}

/// The watches over all bodies of a scene.
#[derive(Debug, Default)]
pub struct TearForces {
    watches: Vec<Watch>,
    /// The edges that nobody else tells.
    events: TearEvents,
    /// The bodies whose edges were told, with the times at which the steps of the edges were due (ns), oldest first.
    told: VecDeque<(usize, u64)>,
}

impl TearForces {
    /// Watches over the bodies of `scene`, whose edges [`Self::opened`] tells.
    pub(super) fn new(scene: &Scene) -> Self {
        Self {
            watches: (0..scene.bodies.len())
                .map(|index| Watch::new(scene, index))
                .collect(),
            ..Self::default()
        }
    }

    /// Watches over the bodies of `scene`, whose session is prepared.
    pub fn listening(scene: &Scene, prepared: &mut Prepared) -> Self {
        let bodies = prepared.engine.bodies();
        let sender = &mut prepared.subscribers.tears;
        if sender.is_none() {
            *sender = TearSender::new(bodies);
        }
        Self {
            events: sender.as_mut().map(TearSender::listen).unwrap_or_default(),
            ..Self::new(scene)
        }
    }

    /// An edge of `body` opened in the step that was due at `time_ns`.
    pub(super) fn opened(&mut self, body: usize, time_ns: u64) {
        self.told.push_back((body, time_ns));
    }

    /// Takes the record of a tick.
    pub fn take(&mut self, telemetry: &Telemetry) {
        while let Some((event, _)) = self.events.next() {
            self.opened(event.body as usize, event.time_ns);
        }
        let now = telemetry.time_ns;
        let time = now as f64 * 1e-9;
        let force = |device| {
            let mut devices = telemetry.devices();
            (devices.nth(device)).map_or(0.0, |device| device.wrench.force.norm())
        };
        // Under the real clock an edge may be told before the records of the ticks until then have come.
        let due = self.told.partition_point(|(_, time_ns)| *time_ns <= now);
        let due: Vec<usize> = self.told.drain(..due).map(|(body, _)| body).collect();
        for (index, watch) in self.watches.iter_mut().enumerate() {
            watch.take(time, due.contains(&index), force);
        }
    }

    /// The force at the tears of each body, in the scene's order.
    pub fn finish(&self) -> Vec<Option<TearForce>> {
        self.watches.iter().map(Watch::finish).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Edges open at ticks 10, 20 and 40 of 100; device `one` pulls with the number of the tick as force, device `two`
    /// pulls harder only before and after the tear.
    fn watched(most: usize) -> TearForce {
        let pull = |device, name: &str| Pull {
            device,
            name: name.to_owned(),
            start: 0.0,
            most: 0.0,
            peak: 0.0,
            kept: Vec::new(),
            until_edge: 0,
        };
        let mut watch = Watch {
            pulls: vec![pull(0, "one"), pull(1, "two")],
            edges: None,
            every: 1,
            ticks: 0,
            most,
        };
        for tick in 0..100 {
            let during = (10..=40).contains(&tick);
            watch.take(
                f64::from(tick) * 1e-3,
                [10, 20, 40].contains(&tick),
                |device| match device {
                    0 => f64::from(tick),
                    _ => f64::from(u8::from(!during)) * 1000.0,
                },
            );
        }
        watch.finish().expect("a tear")
    }

    #[test]
    fn start_peak_and_plateau_are_those_of_the_ticks_from_the_first_edge_to_the_last() {
        let found = watched(MOST);
        let expected = TearForce {
            device: "one".to_owned(),
            from: 10.0 * 1e-3,
            to: 40.0 * 1e-3,
            start: 10.0,
            peak: 40.0,
            plateau: 25.0,
        };
        assert_eq!(found, expected);
    }

    #[test]
    fn a_long_tear_is_bounded_and_keeps_its_plateau() {
        // At most eight values are kept: every sixteenth tick, and the median of these is within one of their distances.
        let found = watched(8);
        assert_eq!((found.start, found.peak), (10.0, 40.0));
        assert!((found.plateau - 25.0).abs() <= 16.0, "{found:?}");
        assert_eq!(median(&[]), 0.0);
        assert_eq!(median(&[4.0, 1.0]), 2.5);
    }
}
