//! The frame of the tick that is shown.

use super::{Player, PlayerError};
use host::live::{BodyState, Event, Frame, Hand, Message, Surface, Totals, Vertices};
use host::log::fold::{HandSums, Sums};
use host::log::{TickRow, energy_sums, overview};
use rt_core::coupling::HostState;
use rt_core::record::{BodyTelemetry, DeviceTelemetry};
use rt_core::safety::SafetyState;
use std::io::{Read, Seek};

impl<R: Read + Seek + Send> Player<R> {
    /// Makes the frame of the tick that is shown. After a jump the frame has all vertices.
    pub(super) fn frame_of_place(&mut self, jumped: bool) -> Result<(), PlayerError> {
        let row = self.shown.row.clone();
        let before = self.frame.bodies.iter().map(|body| body.vertices.clone());
        let before: Vec<_> = before.collect();
        let sums = self.shown.sums();
        let hands = row.devices.iter().zip(&sums.hands);
        let hands = hands.map(|(device, sums)| hand(device, sums)).collect();
        let totals = self.totals(sums);
        let mut bodies: Vec<_> = row.bodies.iter().map(body).collect();
        for (index, state) in bodies.iter_mut().enumerate() {
            state.vertices = self.vertices(index, row.time_ns)?;
        }
        let piece = &self.shown.piece;
        let frame = Frame {
            number: self.number,
            time_ns: row.time_ns,
            folded: piece.clone(),
            totals,
            hands,
            bodies,
            events: self.events(piece.first, piece.last),
            ..Frame::default()
        };
        self.number += 1;
        self.history.push(&frame.folded);
        // The whole frame is kept for viewers that join later. Vertices that did not change are not sent again.
        let mut sent = frame.clone();
        for (body, before) in sent.bodies.iter_mut().zip(before) {
            let same = match (&body.vertices, &before) {
                (Some(now), Some(before)) => {
                    (now.step, now.time_ns, now.epoch) == (before.step, before.time_ns, before.epoch)
                }
                _ => false,
            };
            if same && !jumped {
                body.vertices = None;
            }
        }
        self.frame = frame;
        self.waiting.push_back(Message::Frame(Box::new(sent)));
        let first = self.number == 1;
        self.waiting.push_back(self.playback(first));
        Ok(())
    }

    /// The vertices of a body at a time. A surface that was not sent yet is sent first.
    fn vertices(&mut self, index: usize, time_ns: u64) -> Result<Option<Vertices>, PlayerError> {
        let Some(name) = self.facts.fold.bodies.get(index).cloned() else {
            return Ok(None);
        };
        let found = self.log.frame_at(&name, time_ns)?;
        let epoch = found.as_ref().map_or(0, |found| found.frame.epoch);
        let body = index as u32;
        let sent = |surface: &Surface| (surface.body, surface.epoch) == (body, epoch);
        if !self.surfaces.iter().any(sent) {
            let logged = match &found {
                Some(_) => self.log.surface_at(&name, time_ns)?,
                None => None,
            };
            let surface = logged.map(|logged| Surface::clone(&logged));
            let surface = surface.or_else(|| self.facts.rest.get(index).cloned());
            if let Some(surface) = surface {
                let surface = Surface {
                    body,
                    epoch,
                    ..surface
                };
                self.surfaces.push(surface.clone());
                self.waiting.push_back(Message::Surface(surface));
            }
        }
        let surface = self.surfaces.iter().find(|surface| sent(surface));
        Ok(match (found, surface) {
            (Some(found), Some(surface))
                if found.positions.len() == 3 * surface.vertices as usize =>
            {
                Some(Vertices {
                    step: found.frame.step,
                    time_ns: found.frame.time_ns,
                    epoch,
                    count: surface.vertices,
                    positions: found.positions.to_vec(),
                    ..Vertices::default()
                })
            }
            // A log without frames draws the body at rest.
            (None, Some(surface)) => Some(Vertices {
                epoch,
                count: surface.vertices,
                positions: surface.rest.clone(),
                ..Vertices::default()
            }),
            _ => None,
        })
    }

    /// The events of the ticks from `first` to `last`.
    fn events(&self, first: u64, last: u64) -> Vec<Event> {
        let events = &self.overview.events;
        let from = events.partition_point(|event| event.tick < first);
        let events = events.iter().skip(from);
        events
            .take_while(|event| event.tick <= last)
            .cloned()
            .collect()
    }

    /// The totals up to the tick that is shown. The distributions are those of the whole log.
    fn totals(&self, sums: &Sums) -> Totals {
        let whole = &self.overview.totals;
        Totals {
            lateness: whole.lateness,
            model_age: whole.model_age.clone(),
            lateness_bins: whole.lateness_bins.clone(),
            ..overview::totals(sums)
        }
    }

    /// The row that is shown.
    pub fn row(&self) -> &TickRow {
        &self.shown.row
    }
}

fn hand(device: &DeviceTelemetry, sums: &HandSums) -> Hand {
    let rotation = device.pose.rotation.coords;
    Hand {
        position: device.pose.position.into(),
        rotation: rotation.into(),
        force: device.wrench.force.into(),
        moment: device.wrench.moment.into(),
        velocity: device.twist.linear.into(),
        buttons: device.buttons,
        fresh: device.fresh,
        safety: match device.safety {
            SafetyState::Normal => "normal",
            SafetyState::Limited => "limited",
            SafetyState::Recovering => "recovering",
            SafetyState::DeviceStale => "device_stale",
            SafetyState::NotANumber => "not_a_number",
            SafetyState::Slewed => "slewed",
            SafetyState::TooFast => "too_fast",
            SafetyState::OutOfReach => "out_of_reach",
        }
        .into(),
        peak_force: sums.peak_force,
        work: sums.work,
        reach: sums.reach,
    }
}

fn body(body: &BodyTelemetry) -> BodyState {
    let sums = energy_sums(&body.energy);
    BodyState {
        state: match body.state {
            HostState::Waiting => "waiting",
            HostState::Live => "live",
            HostState::Fading => "fading",
            HostState::Held => "held",
        }
        .into(),
        sequence: body.sequence,
        epoch: body.epoch,
        age: body.age_ns as f64 * 1e-9,
        trust: body.trust,
        withheld: body.withheld.force,
        energy: sums
            .into_iter()
            .map(|(name, sum)| (name.to_owned(), sum))
            .collect(),
        capped_ticks: body.energy.capped,
        vertices: None,
    }
}
