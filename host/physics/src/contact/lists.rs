//! Kept lists: the pairs of things of two clusters that may touch, found once and valid while the clusters deform little.
//!
//! A **search** of two clusters lists their pairs up to a distance `L`, by distance, and keeps the positions of both. In
//! each later step, `B` is the sum of the largest departures of both clusters from the rigid motion of their union since
//! the search (`rigid`). No distance has changed by more than `B`. While `need + B <= L`, every pair that is now nearer
//! than `need` is in the list, and was nearer than `need + B` at the search: the beginning of the list suffices. `B` is
//! measured only if the sum of cheaper bounds since its last measurement (`drift`) does not show the same. If the
//! condition fails, the clusters are searched again, with `L = need + margin`. A rigid motion costs no search at all, and
//! trembling costs none, because `B` is measured against the search and is no sum over steps.
//!
//! The margin of two clusters follows their costs: it doubles if the searches computed more distances than the checks
//! between them, and is halved otherwise. Two clusters that were searched in three of their last four steps are searched
//! in each step, with a margin of zero, until they deform less than a quarter of the smallest margin in a step.
//!
//! Nothing is allocated after [`Lists::new`]. Two clusters for which no room is left are searched in each step, and counted.

use super::drift::Drift;
use super::hierarchy::Hierarchy;
use super::moves::Moves;
use super::pair::Pair;
use super::rigid::departure;
use super::search::Search;
use super::surface::Surfaces;
use crate::Vec3;
use core::ops::Range;
use nalgebra::UnitQuaternion;
use std::collections::HashMap;

/// Room for lists, as multiples of sizes of the surfaces.
const LISTS_PER_CLUSTER: usize = 16;
const ENTRIES_PER_ELEMENT: usize = 32;

/// The lists cover motions that the solver makes larger than predicted by this factor.
const SOLVED: f64 = 1.1;
/// The fraction of a margin up to which the bounds of steps are summed before the departure is measured.
const LOOSE: f64 = 0.1;

/// A pair in a list.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// The distance at the search (m), rounded down.
    distance: f32,
    pair: Pair,
}

impl Entry {
    const NONE: Self = Self {
        distance: 0.0,
        pair: Pair::VertexTriangle(0, 0),
    };
}

/// The list of two clusters.
#[derive(Clone, Debug)]
struct List {
    clusters: [usize; 2],
    /// `L` (m).
    radius: f64,
    margin: f64,
    /// The rotation of the clusters since the search.
    rotation: UnitQuaternion<f64>,
    /// `B` (m) when it was measured last, and the bounds (m) of the steps since.
    moved: f64,
    drifted: f64,
    /// The last step in which the clusters were near each other.
    step: u64,
    entries: Range<usize>,
    /// Entries that are reserved for the list.
    room: usize,
    /// Distances that the search computed, and checks since.
    relisted: usize,
    checked: usize,
    /// The last four steps, a bit each: whether the clusters were searched.
    history: u8,
    is_searching: bool,
}

/// Two clusters that are near each other in the present step.
#[derive(Clone, Copy, Debug)]
struct Near {
    clusters: [usize; 2],
    need: f64,
    /// `None`: there is no room for a list.
    list: Option<usize>,
}

/// The work of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Pairs of clusters that are near each other.
    pub near: usize,
    /// Pairs of clusters to which a rigid motion was fitted.
    pub fitted: usize,
    /// Pairs of clusters that were searched.
    pub searched: usize,
    /// Distances that the searches computed.
    pub relisted: usize,
    /// Pairs that the searches put into lists.
    pub listed: usize,
    /// Pairs at the beginning of the lists.
    pub checked: usize,
    /// Pairs of clusters without room for a list.
    pub without_room: usize,
}

/// The kept lists of all pairs of clusters.
#[derive(Debug)]
pub struct Lists {
    hierarchy: Hierarchy,
    drift: Drift,
    kept: Vec<List>,
    most: usize,
    by_clusters: HashMap<[usize; 2], usize>,
    /// Positions at the searches, `stride` for each list.
    positions: Vec<Vec3>,
    stride: usize,
    entries: Vec<Entry>,
    most_entries: usize,
    /// Entries of a search.
    scratch: Vec<Entry>,
    /// The lists in the order of their entries.
    order: Vec<usize>,
    near: Vec<Near>,
    /// By cluster, for the present step.
    moves: Vec<Moves>,
    /// How far each cluster must look (m).
    grown: Vec<f64>,
    /// Margins (m): least and most.
    margins: [f64; 2],
    step: u64,
    counts: Counts,
}

impl Lists {
    /// Lists over `surfaces` at the positions `x` (m).
    pub fn new(surfaces: &Surfaces, x: &[Vec3]) -> Self {
        let hierarchy = Hierarchy::new(surfaces, x);
        let clusters = hierarchy.clusters().len();
        let largest = (0..clusters)
            .map(|cluster| hierarchy.members(cluster).len())
            .max();
        let stride = 2 * largest.unwrap_or(0);
        let most = LISTS_PER_CLUSTER * clusters;
        let elements = surfaces.triangles.len() + surfaces.edges.len();
        // Half to five thicknesses; of surfaces without thickness, a twentieth of an edge takes its place.
        let radius = surfaces
            .parts
            .iter()
            .map(|part| part.radius)
            .fold(0.0, f64::max);
        let edges = surfaces
            .edges
            .iter()
            .map(|[a, b]| (x[*a as usize] - x[*b as usize]).norm());
        let edge = edges.sum::<f64>() / surfaces.edges.len().max(1) as f64;
        let thickness = (2.0 * radius).clamp(0.05 * edge, 0.5 * edge);
        let entries = ENTRIES_PER_ELEMENT * elements;
        Self {
            kept: Vec::with_capacity(most),
            most,
            by_clusters: HashMap::with_capacity(most),
            positions: vec![Vec3::zeros(); stride * most],
            stride,
            entries: Vec::with_capacity(entries),
            most_entries: entries,
            scratch: Vec::with_capacity(entries),
            order: Vec::with_capacity(most),
            // Every pair of clusters is near every other one at most; of very many clusters, the first such step allocates.
            near: Vec::with_capacity((clusters * (clusters + 1) / 2).min(1 << 17)),
            moves: vec![Moves::default(); clusters],
            grown: vec![0.0; clusters],
            margins: [0.5 * thickness, 5.0 * thickness],
            step: 0,
            counts: Counts::default(),
            drift: Drift::new(&hierarchy, x),
            hierarchy,
        }
    }

    /// The hierarchy of boxes at the last positions.
    pub fn hierarchy(&self) -> &Hierarchy {
        &self.hierarchy
    }

    /// The work of the last step.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Has all lists searched again, because other pairs may touch.
    pub fn search_again(&mut self) {
        for list in &mut self.kept {
            list.radius = f64::NEG_INFINITY;
        }
    }

    /// Begins a step at the positions `x` (m), in which clusters are predicted to move as `moves` says. Afterwards
    /// [`each`](Self::each) gives every pair that may touch (`feet`) or cross in the step.
    pub fn follow(
        &mut self,
        surfaces: &Surfaces,
        x: &[Vec3],
        moves: impl Fn(&Hierarchy, usize) -> Moves,
    ) {
        self.step += 1;
        self.counts = Counts::default();
        self.hierarchy.refit(surfaces, x);
        self.drift.follow(&self.hierarchy, x);
        for cluster in 0..self.moves.len() {
            let mut predicted = moves(&self.hierarchy, cluster);
            let part = self.hierarchy.clusters()[cluster].part;
            predicted.most = (SOLVED * predicted.most).max(surfaces.parts[part].radius);
            self.moves[cluster] = predicted;
        }
        self.require(surfaces, x);
    }

    /// Has the step cover the solved motion of the clusters, at the same positions: no pair crosses that is not given.
    pub fn extend(
        &mut self,
        surfaces: &Surfaces,
        x: &[Vec3],
        moves: impl Fn(&Hierarchy, usize) -> Moves,
    ) {
        let mut is_larger = false;
        for cluster in 0..self.moves.len() {
            let solved = moves(&self.hierarchy, cluster).most;
            let covered = &mut self.moves[cluster].most;
            is_larger |= solved > *covered;
            *covered = covered.max(solved);
        }
        if is_larger {
            self.require(surfaces, x);
        }
    }

    fn require(&mut self, surfaces: &Surfaces, x: &[Vec3]) {
        let clusters = self.hierarchy.clusters();
        for ((grown, moves), cluster) in self.grown.iter_mut().zip(&self.moves).zip(clusters) {
            *grown = moves.alone(surfaces.parts[cluster.part].radius);
        }
        self.hierarchy.grow(&self.grown);
        self.near.clear();
        let (near, moves) = (&mut self.near, &self.moves);
        let clusters = self.hierarchy.clusters();
        self.hierarchy.near(surfaces, &mut |a, b| {
            let (one, other) = (&clusters[a], &clusters[b]);
            let radii = surfaces.parts[one.part].radius + surfaces.parts[other.part].radius;
            let need = moves[a].need(&moves[b], radii);
            let reach = one.extent + other.extent + need;
            if (one.centre - other.centre).norm_squared() <= reach * reach {
                near.push(Near {
                    clusters: [a, b],
                    need,
                    list: None,
                });
            }
        });
        self.counts.near = self.near.len();
        self.counts.checked = 0;
        for number in 0..self.near.len() {
            let near = self.near[number];
            let list = self.list_of(near.clusters);
            self.near[number].list = list;
            match list {
                Some(list) => self.keep(surfaces, x, list, near.need),
                None => self.counts.without_room += 1,
            }
        }
    }

    /// The list of two clusters: the kept one, or a new one that has not been searched. `None` if there is no room.
    fn list_of(&mut self, clusters: [usize; 2]) -> Option<usize> {
        if let Some(list) = self.by_clusters.get(&clusters) {
            return Some(*list);
        }
        if self.kept.len() == self.most {
            self.forget();
        }
        if self.kept.len() == self.most {
            return None;
        }
        self.by_clusters.insert(clusters, self.kept.len());
        self.kept.push(List {
            clusters,
            radius: f64::NEG_INFINITY,
            margin: self.margins[0] * 2.0,
            rotation: UnitQuaternion::identity(),
            moved: 0.0,
            drifted: 0.0,
            step: self.step,
            entries: 0..0,
            room: 0,
            relisted: 0,
            checked: 0,
            history: 0,
            is_searching: false,
        });
        Some(self.kept.len() - 1)
    }

    /// Forgets the lists that the step does not use. Called if there is no room for a further list.
    fn forget(&mut self) {
        let mut kept = 0;
        for number in 0..self.kept.len() {
            if self.kept[number].step != self.step {
                continue;
            }
            self.kept.swap(kept, number);
            let from = number * self.stride;
            self.positions
                .copy_within(from..from + self.stride, kept * self.stride);
            kept += 1;
        }
        self.kept.truncate(kept);
        self.by_clusters.clear();
        for (number, list) in self.kept.iter().enumerate() {
            self.by_clusters.insert(list.clusters, number);
        }
        for near in &mut self.near {
            let list = near.list.and_then(|_| self.by_clusters.get(&near.clusters));
            near.list = list.copied();
        }
    }

    /// Has a list hold all pairs nearer than `need` (m).
    fn keep(&mut self, surfaces: &Surfaces, x: &[Vec3], number: usize, need: f64) {
        let list = &mut self.kept[number];
        let is_new_step = list.step != self.step;
        let is_searched = list.radius >= 0.0;
        if is_searched && is_new_step {
            let drift = self.drift.between(&self.hierarchy, list.clusters);
            let is_followed = list.step + 1 == self.step;
            list.drifted += drift;
            let is_certain = need + list.moved + list.drifted <= list.radius;
            // The bound also says how much of the list is checked, so it must not become loose.
            if !(is_followed && is_certain && list.drifted <= LOOSE * list.margin) {
                self.measure(x, number);
            }
        }
        let list = &mut self.kept[number];
        list.step = self.step;
        if is_new_step {
            list.history <<= 1;
        }
        if !is_searched || need + list.moved + list.drifted > list.radius {
            self.search(surfaces, x, number, need);
        }
        let list = &self.kept[number];
        let nearest = (need + list.moved + list.drifted) as f32;
        let entries = &self.entries[list.entries.clone()];
        let checked = entries.partition_point(|entry| entry.distance <= nearest.next_up());
        self.counts.checked += checked;
        self.kept[number].checked += checked;
    }

    /// Measures how far the clusters of a list have departed from a rigid motion since the search.
    fn measure(&mut self, x: &[Vec3], number: usize) {
        let list = &mut self.kept[number];
        let [a, b] = list.clusters;
        let (first, second) = (self.hierarchy.members(a), self.hierarchy.members(b));
        let second = if a == b { &[] } else { second };
        let count = first.len() + second.len();
        let before = &self.positions[number * self.stride..][..count];
        let after = |i: usize| {
            let vertex = first.get(i).unwrap_or_else(|| &second[i - first.len()]);
            x[*vertex as usize]
        };
        let [one, other] = departure(before, after, first.len(), &mut list.rotation);
        // Two things of one cluster may depart in opposite directions.
        list.moved = if a == b { 2.0 * one } else { one + other };
        list.drifted = 0.0;
        self.counts.fitted += 1;
    }

    /// Searches the clusters of a list.
    fn search(&mut self, surfaces: &Surfaces, x: &[Vec3], number: usize, need: f64) {
        let [least, most] = self.margins;
        let list = &mut self.kept[number];
        let is_costly = list.relisted > list.checked;
        let factor = if is_costly { 2.0 } else { 0.5 };
        list.margin = (list.margin * factor).clamp(least, most);
        // A list that is searched in each step leaves this state by the deformation of one step.
        list.is_searching = if list.is_searching {
            list.moved > 0.25 * least
        } else {
            (list.history & 0b1110).count_ones() >= 2 && list.radius >= 0.0
        };
        list.radius = need + if list.is_searching { 0.0 } else { list.margin };
        (list.history, list.checked) = (list.history | 1, 0);
        (list.moved, list.drifted) = (0.0, 0.0);
        list.rotation = UnitQuaternion::identity();
        let [a, b] = list.clusters;
        let search = Search {
            surfaces,
            hierarchy: &self.hierarchy,
            x,
            radius: list.radius,
        };
        let (scratch, most, mut is_lost) = (&mut self.scratch, self.most_entries, false);
        scratch.clear();
        list.relisted = search.clusters(a, b, &mut |pair, distance| {
            is_lost |= scratch.len() == most;
            if !is_lost {
                let distance = (distance as f32).next_down();
                scratch.push(Entry { distance, pair });
            }
        });
        self.counts.searched += 1;
        self.counts.relisted += list.relisted;
        self.counts.listed += scratch.len();
        scratch
            .sort_unstable_by(|a, b| a.distance.total_cmp(&b.distance).then(a.pair.cmp(&b.pair)));
        let first = self.hierarchy.members(a);
        let second = if a == b {
            &[]
        } else {
            self.hierarchy.members(b)
        };
        let positions = &mut self.positions[number * self.stride..];
        for (to, vertex) in positions.iter_mut().zip(first.iter().chain(second)) {
            *to = x[*vertex as usize];
        }
        if is_lost || !self.store(number) {
            let list = &mut self.kept[number];
            list.radius = f64::NEG_INFINITY;
            // The list keeps its place: the room there is its own.
            list.entries.end = list.entries.start;
        }
    }

    /// Stores the pairs that a search has found. Returns whether there is room.
    fn store(&mut self, number: usize) -> bool {
        let length = self.scratch.len();
        let list = &mut self.kept[number];
        if length > list.room {
            // Some room to grow, so that the next search need not move the list.
            let room = length + length / 4;
            (list.entries, list.room) = (0..0, 0);
            if self.entries.len() + room > self.most_entries {
                self.gather();
            }
            if self.entries.len() + room > self.most_entries {
                return false;
            }
            let list = &mut self.kept[number];
            (list.entries.start, list.room) = (self.entries.len(), room);
            self.entries.resize(self.entries.len() + room, Entry::NONE);
        }
        let list = &mut self.kept[number];
        list.entries.end = list.entries.start + length;
        self.entries[list.entries.clone()].copy_from_slice(&self.scratch);
        true
    }

    /// Moves the stored lists together, without those that the step does not use.
    fn gather(&mut self) {
        for list in &mut self.kept {
            if list.step != self.step {
                (list.entries, list.room) = (0..0, 0);
                list.radius = f64::NEG_INFINITY;
            }
        }
        self.order.clear();
        self.order.extend(0..self.kept.len());
        let lists = &self.kept;
        self.order
            .sort_unstable_by_key(|number| lists[*number].entries.start);
        let mut end = 0;
        for number in &self.order {
            let list = &mut self.kept[*number];
            let length = list.entries.len();
            self.entries.copy_within(list.entries.clone(), end);
            (list.entries, list.room) = (end..end + length, length);
            end += length;
        }
        self.entries.truncate(end);
    }

    /// Calls `found` for each pair of clusters' things that may be as near as the step needs, once each.
    /// `x` are the positions of the last [`follow`](Self::follow) (m).
    pub fn each(&self, surfaces: &Surfaces, x: &[Vec3], found: &mut dyn FnMut(Pair)) {
        for near in &self.near {
            let list = near.list.map(|number| &self.kept[number]);
            if let Some(list) = list.filter(|list| list.radius >= 0.0) {
                let entries = &self.entries[list.entries.clone()];
                let nearest = ((near.need + list.moved + list.drifted) as f32).next_up();
                let found_at_search = entries.iter().take_while(|e| e.distance <= nearest);
                found_at_search.for_each(|entry| found(entry.pair));
            } else {
                let search = Search {
                    surfaces,
                    hierarchy: &self.hierarchy,
                    x,
                    radius: near.need,
                };
                let [a, b] = near.clusters;
                search.clusters(a, b, &mut |pair, _| found(pair));
            }
        }
    }
}
