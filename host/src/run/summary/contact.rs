//! The contacts in the summary of a run.

use crate::engine::contact::{Contact, ContactSums, PairTotals};
use crate::scene::Scene;
use crate::solve::report::si;
use physics::motion::contacts::Side;
use serde::Serialize;
use std::fmt;

/// The contacts of a run.
#[derive(Clone, Debug, Serialize)]
pub struct ContactSummary {
    /// By pair that touched.
    pub pairs: Vec<ContactPairSummary>,
    /// The sums over all steps and pairs.
    pub sums: ContactSums,
}

/// The contacts of a pair. Forces are sums over a step.
#[derive(Clone, Debug, Serialize)]
pub struct ContactPairSummary {
    /// The names.
    pub between: [String; 2],
    /// Number of steps in contact.
    pub steps: u64,
    /// Most contacts of a step.
    pub most_contacts: usize,
    /// Number of contacts at the end.
    pub contacts: usize,
    /// Normal force at the end (N).
    pub normal_force: f64,
    /// Friction force at the end (N).
    pub friction_force: f64,
    /// Largest normal force (N).
    pub peak_force: f64,
    /// Its time (s).
    pub peak_time: f64,
    /// Largest depth (m).
    pub depth: f64,
}

impl ContactSummary {
    /// The summary of the contacts of a scene.
    pub(crate) fn new(scene: &Scene, contact: &Contact) -> Self {
        let totals = contact.totals();
        let name = |side: Side| match side {
            Side::Body(body) => scene.bodies[body].name.clone(),
            Side::Obstacle(obstacle) => scene.obstacles[obstacle].name.clone(),
        };
        let pair = |pair: &PairTotals| ContactPairSummary {
            between: pair.between.map(name),
            steps: pair.steps,
            most_contacts: pair.most,
            contacts: pair.last.count,
            normal_force: pair.last.normal,
            friction_force: pair.last.friction,
            peak_force: pair.peak.0,
            peak_time: pair.peak.1,
            depth: pair.depth,
        };
        Self {
            pairs: totals.pairs.iter().map(pair).collect(),
            sums: totals.sums,
        }
    }

    /// Prints a line for each pair, and one for what was not as it should be.
    pub(super) fn print(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for pair in &self.pairs {
            let [one, other] = &pair.between;
            let with = if one == other {
                "itself".to_owned()
            } else {
                other.clone()
            };
            writeln!(
                f,
                "  contact    {one} with {with}: {} at the end, normal {}, friction {}; peak {} at {:.2} s, deepest {}, \
                 at most {} in a step",
                pair.contacts,
                si(pair.normal_force, "N"),
                si(pair.friction_force, "N"),
                si(pair.peak_force, "N"),
                pair.peak_time,
                si(pair.depth, "m"),
                pair.most_contacts,
            )?;
        }
        if self.pairs.is_empty() {
            writeln!(f, "  contact    nothing touched")?;
        } else {
            let sums = &self.sums;
            let given = sums.by_obstacles + sums.parted;
            let [taken, stored, given, stopped] =
                [sums.taken, sums.stored, given, sums.stopped].map(|energy| si(energy, "J"));
            writeln!(
                f,
                "             {taken} taken by contacts, of which {stored} stored; {given} given by moving obstacles and \
                 starts that overlap; {stopped} stopped"
            )?;
        }
        let ContactSums {
            dropped, squeezed, ..
        } = self.sums;
        if dropped > 0 {
            writeln!(
                f,
                "  !          {dropped} contacts found no row: the deepest ones had them"
            )?;
        }
        if squeezed > 0 {
            writeln!(
                f,
                "  !          {squeezed} pairs of elements had no room between an obstacle or a hand and another: they may \
                 have crossed"
            )?;
        }
        Ok(())
    }
}
