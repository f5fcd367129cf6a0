//! A message: what goes on when a patch takes the place of the former one.
//!
//! **Messages.** Sites and proxy are where they were when a message comes. The difference to the places of the message fades
//! within half a period; that of a proxy whose floor changes, in a tenth of a second. A message of other sites can leave a contact without its place on the surface: the force of which this would
//! deprive the hand in one tick is carried, and fades too. Forces therefore never jump.
//!
//! **Friction of the host.** Tick and host stick to places of their own on the material. What one of them slipped would stay between their forces
//! for ever. The forces on a loose piece balance its weight in the host alone: there, a message leads the friction of contacts that stick a part
//! of the way to that of the host, by the difference of both forces at the time of the message. On a body that is held, the friction of the tick
//! is nearer to that of a host in every tick than the friction of a late host.

use super::contacts::{self, Contact, Contacts, loads};
use super::patch::Site;
use super::sites::most_drift;
use super::{Bounds, MAX_SITES, Offset, Tool};
use crate::geometry::{Vec3, Wrench};

/// The change of the force (N) in the tick of a message, beyond that in the tick before, that is not carried: the jump of a message
/// that no hand feels.
pub(super) const UNFELT: f64 = 0.05;
/// The part of the difference between the friction of the host and of the tick that a message takes away from a loose piece: the rest is a
/// hundredth after twenty messages, and no message is felt.
const FOLLOWS: f64 = 0.2;

impl Tool {
    /// Takes the pending patch into use. Sites and proxy stay where they are. A contact with a triangle that is there no longer goes on
    /// at the nearest point of the new surface: without its force, the surface would keep its dent and press less.
    pub(super) fn switch(&mut self) {
        let (old, new) = (&self.patch.head, &self.pending.head);
        let count = usize::from(new.site_count);
        let before = usize::from(old.site_count);
        let mut kept = [false; MAX_SITES];
        let vertices = self
            .patch
            .sites
            .iter()
            .zip(&self.pending.sites)
            .take(before.min(count));
        for (kept, (one, other)) in kept.iter_mut().zip(vertices) {
            *kept = old.epoch == new.epoch && one.vertex == other.vertex;
        }
        let (was, places) = (self.places, self.rendered(&kept, count));
        let is_kept = |corner: &u8| kept.get(usize::from(*corner)).copied().unwrap_or_default();
        let goes_on = |contact: &Contact| {
            let mut triangles = new.triangles();
            contact.corners.iter().all(is_kept)
                && triangles.any(|triangle| triangle.corners == contact.corners)
        };
        let mut contacts = Contacts::new();
        for contact in self.contacts.iter().filter(|contact| goes_on(contact)) {
            // Both lists have the same room.
            let _ = contacts.push(*contact);
        }
        for contact in &self.contacts {
            if !goes_on(contact) {
                let now = new.triangles();
                contacts::carry(
                    &mut contacts,
                    contact,
                    now,
                    [&was, &places],
                    self.config.radius,
                );
            }
        }
        self.contacts = contacts;
        let (Wrench { force, moment }, fade) = (self.contact_wrench(), self.fade);
        let [way, turn] = self.offset.now();
        let offset = Offset {
            way: way + (old.floor - new.floor) * force,
            turn: turn + (old.turning_floor - new.turning_floor) * moment,
            left: 1.0,
        };
        self.carried = self.carried.scaled(fade);
        self.patch.copy_used_from(&self.pending);
        self.offset = if before > 0 { offset } else { Offset::ZERO };
        self.relaxation = self.relaxation();
        self.is_rigid = self.patch.is_rigid();
        self.begin_sites(&kept, count);
        let fraction = -1.0 / (1.0 + self.relaxation.gain);
        self.unloaded = self.loaded(&self.places, &loads(&self.contacts), fraction);
        let each = self.sites.iter().zip(&self.patch.sites).take(count);
        (self.bounds, self.most_offset) = (Bounds::NONE, 0.0);
        for (state, site) in each {
            for time in [0.0, most_drift(&self.patch.head)] {
                self.bounds.add(&(site.drifted(time) + state.bias));
            }
            self.most_offset = self.most_offset.max(state.offset.norm());
        }
        let head = &self.patch.head;
        self.fade = 1.0;
        self.fade_step = (2.0 * self.config.period / head.period).min(0.5);
    }

    /// The sites of the pending patch: those that were there where they are, and the new ones where the host has them (m).
    fn rendered(&self, kept: &[bool; MAX_SITES], count: usize) -> [Vec3; MAX_SITES] {
        let mut places = self.places;
        let drift_time = self.drift_time(&self.pending.head);
        let each = places.iter_mut().zip(&self.pending.sites).zip(kept);
        for ((place, site), _) in each.take(count).filter(|(_, kept)| !**kept) {
            *place = site.drifted(drift_time);
        }
        places
    }

    /// The displacement and the offset of each site of a new patch. A new site has the offset of the nearest one that was there.
    fn begin_sites(&mut self, kept: &[bool; MAX_SITES], count: usize) {
        let forces = loads(&self.contacts);
        let damping = self.patch.head.damping;
        let drift_time = self.drift_time(&self.patch.head);
        let each = self
            .sites
            .iter_mut()
            .zip(&self.patch.sites)
            .zip(&self.patch.compliance);
        for ((((state, site), row), place), kept) in each.zip(&self.places).zip(kept).take(count) {
            let pairs = row.iter().zip(&self.patch.sites).zip(&forces).take(count);
            let mut loaded = Vec3::zeros();
            state.bias = (site.velocity - site.drift) * damping;
            for ((block, other), force) in pairs {
                state.bias -= block * other.force;
                loaded += block * force;
            }
            if *kept {
                state.stretch = loaded + state.bias - state.viscous;
                state.offset = place - (site.drifted(drift_time) + state.stretch);
            } else {
                (state.viscous, state.offset) = (Vec3::zeros(), Vec3::zeros());
                state.stretch = loaded + state.bias;
            }
        }
        let states = self.sites;
        let each = self
            .sites
            .iter_mut()
            .zip(&self.patch.sites)
            .zip(&mut self.places);
        for (((state, site), place), _) in each.zip(kept).take(count).filter(|(_, kept)| !**kept) {
            let others = states.iter().zip(&self.patch.sites).zip(kept).take(count);
            let others = others.filter(|(_, kept)| **kept).map(|(other, _)| other);
            let distance = |other: &Site| (other.place - site.place).norm_squared();
            let nearest = others.min_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)));
            if let Some((nearest, _)) = nearest {
                state.viscous = nearest.viscous;
                state.stretch -= nearest.viscous;
                state.offset = nearest.offset;
            }
            *place = site.drifted(drift_time) + state.stretch + state.offset;
        }
    }

    /// Leads the friction of contacts that stick on a loose piece to that of the host in the new patch.
    pub(super) fn follow(&mut self) {
        let older = self.age / self.config.period + 0.5;
        let Some(was) = self.past.force(older as usize) else {
            return;
        };
        let sites = self.patch.sites.iter();
        let hosts: Vec3 = sites
            .take(usize::from(self.patch.head.site_count))
            .map(|site| -site.force)
            .sum();
        let missing = (hosts - was) * (FOLLOWS * (1.0 - self.patch.head.elastic));
        let fraction = 1.0 / (1.0 + self.relaxation.gain);
        for contact in &mut self.contacts {
            contact.lead(&missing, &self.patch, fraction);
        }
    }

    /// Carries the wrench of which a message has deprived the hand, beyond what no hand feels.
    pub(super) fn carry(&mut self, missing: &Wrench) {
        let unfelt = UNFELT + self.change;
        let part = 1.0 - unfelt / self.felt(missing);
        // The wrench fades from this tick on.
        self.carried = if part > 0.0 && self.fade > 0.0 {
            missing.scaled(part / self.fade)
        } else {
            Wrench::zero()
        };
    }

    /// Lets the present differences fade as if they had come with a message of this tick.
    pub(super) fn fade_again(&mut self) {
        let fade = core::mem::replace(&mut self.fade, 1.0);
        self.carried = self.carried.scaled(fade);
        for state in &mut self.sites {
            state.offset *= fade;
        }
        self.most_offset *= fade;
    }
}
