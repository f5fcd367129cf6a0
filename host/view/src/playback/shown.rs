//! The frame of the tick that is shown.

use super::{Player, PlayerError};
use host::live::frame::sites;
use host::live::{ContactArrow, EventKind, Frame, Message, Totals, Vertices};
use host::record::Surface;
use std::io::{Read, Seek};

impl<R: Read + Seek + Send> Player<R> {
    /// Makes the frame of the ticks that the gatherer has taken. After a jump the frame has all vertices.
    pub(super) fn make_frame(&mut self, jumped: bool) -> Result<(), PlayerError> {
        let mut frame = self.gatherer.frame();
        frame.number = self.number;
        frame.totals = self.totals(frame.totals);
        // The gatherer learns the worst tick of the whole log only at the end, and sees no tears.
        let others = self.overview.events.iter().filter(|event| {
            matches!(event.kind, EventKind::WorstTick | EventKind::Tear)
                && (frame.folded.first..=frame.folded.last).contains(&event.tick)
        });
        frame.events.extend(others.cloned());
        for (index, state) in frame.bodies.iter_mut().enumerate() {
            state.vertices = self.vertices(index, frame.time_ns)?;
        }
        if let Some(step) = self.log.contacts_at(frame.time_ns)? {
            frame.contacts = step.points.iter().map(ContactArrow::from).collect();
        }
        for tool in &mut frame.tools {
            let patch = (tool.device as u8, tool.patch);
            if let Some(patch) = self.log.patch_at(patch, frame.time_ns)? {
                tool.sites = sites(patch.sites());
            }
        }
        if self.stressed {
            self.add_stresses(&mut frame);
        }
        self.number += 1;
        if frame.folded.ticks > 0 {
            self.tick = frame.folded.last;
        }
        self.history.push(&frame.folded);
        // The whole frame is kept for viewers that join later. Vertices that did not change are not sent again.
        let before = std::mem::replace(&mut self.frame, frame.clone());
        if !jumped {
            for (body, before) in frame.bodies.iter_mut().zip(&before.bodies) {
                if body.vertices.as_ref().map(identity) == before.vertices.as_ref().map(identity) {
                    body.vertices = None;
                }
            }
        }
        self.waiting.push_back(Message::Frame(Box::new(frame)));
        let first = self.number == 1;
        self.waiting.push_back(self.playback(first));
        Ok(())
    }

    /// The vertices of a body at a time. The surface of their epoch is sent first, unless it was the last one sent.
    fn vertices(&mut self, index: usize, time_ns: u64) -> Result<Option<Vertices>, PlayerError> {
        let Some(name) = self.facts.bodies.get(index) else {
            return Ok(None);
        };
        let found = self.log.frame_at(name, time_ns)?;
        let (body, epoch) = (
            index as u32,
            found.as_ref().map_or(0, |found| found.frame.epoch),
        );
        let is_this = |surface: &Surface| (surface.body, surface.epoch) == (body, epoch);
        if !self.surfaces.iter().any(is_this) {
            let logged = match &found {
                Some(_) => self.log.surface_at(name, time_ns)?,
                None => None,
            };
            if let Some(surface) = logged.or_else(|| self.facts.rest.get(index).cloned()) {
                let surface = Surface {
                    body,
                    epoch,
                    ..surface
                };
                self.surfaces.retain(|before| before.body != body);
                self.surfaces.push(surface.clone());
                self.waiting.push_back(Message::Surface(surface));
            }
        }
        let Some(surface) = self.surfaces.iter().find(|surface| is_this(surface)) else {
            return Ok(None);
        };
        let (step, at_ns, positions) = match &found {
            Some(found) => (found.frame.step, found.frame.time_ns, &*found.positions),
            // A log without frames draws the body at rest.
            None => (0, 0, surface.rest.as_slice()),
        };
        let whole = positions.len() == 3 * surface.vertices as usize;
        Ok(whole.then(|| Vertices {
            step,
            time_ns: at_ns,
            epoch,
            count: surface.vertices,
            positions: positions.to_vec(),
            ..Vertices::default()
        }))
    }

    /// Adds stresses to the vertices. Those of vertices that did not change are known. A body without stresses is drawn
    /// without them, and the notes say why.
    fn add_stresses(&mut self, frame: &mut Frame) {
        for (index, state) in frame.bodies.iter_mut().enumerate() {
            let before = self.frame.bodies.get(index);
            let before = before.and_then(|body| body.vertices.as_ref());
            let Some(vertices) = &mut state.vertices else {
                continue;
            };
            let known =
                before.filter(|before| before.stressed && identity(before) == identity(vertices));
            let stress = match known {
                Some(known) => Ok(known.stress.clone()),
                None => self.stresses.at_vertices(index, vertices),
            };
            match stress {
                Ok(stress) => {
                    vertices.stress = stress;
                    vertices.stressed = true;
                }
                Err(error) => {
                    let note = error.to_string();
                    if !self.notes.contains(&note) {
                        self.notes.push(note);
                    }
                }
            }
        }
    }

    /// The totals up to the tick that is shown. The distributions are those of the whole log.
    fn totals(&self, counts: Totals) -> Totals {
        let whole = &self.overview.totals;
        Totals {
            lateness: whole.lateness,
            model_age: whole.model_age.clone(),
            lateness_bins: whole.lateness_bins.clone(),
            ..counts
        }
    }

    /// The last frame, with all vertices.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }
}

/// The step that left the body as the vertices say.
fn identity(vertices: &Vertices) -> (u64, u64, u32) {
    (vertices.step, vertices.time_ns, vertices.epoch)
}
