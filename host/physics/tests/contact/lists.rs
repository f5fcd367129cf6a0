//! Kept lists miss no pair, and cost what the motion costs.

use super::motions::{self, Scene};
use physics::Vec3;
use physics::contact::{Counts, Lists, Moves, Pair, Skin, Surfaces};
use physics::mesh::Mesh;
use physics::mesh::generate::{self, Pattern};
use std::collections::BTreeSet;

/// What each cluster may move in a step (m), beside the radii.
const REACH: f64 = 0.25e-3;
/// Motions for which clusters look as far.
fn moves(surfaces: &Surfaces) -> Moves {
    Moves {
        around: (REACH - 0.1 * surfaces.parts[0].radius) / 2.3,
        ..Moves::default()
    }
}
/// Time of a step (s).
const STEP: f64 = 4e-3;

/// All pairs that may touch and are nearer than their radii and the reach, without boxes.
fn all_near(surfaces: &Surfaces, x: &[Vec3]) -> BTreeSet<Pair> {
    let part = |vertex: u32| {
        let parts = &surfaces.parts;
        parts
            .iter()
            .position(|part| part.vertices.contains(&vertex))
            .unwrap()
    };
    let count = |number: usize| u32::try_from(number).unwrap();
    let (triangles, edges) = (count(surfaces.triangles.len()), count(surfaces.edges.len()));
    let mut pairs = Vec::new();
    for triangle in 0..triangles {
        let vertices = 0..count(surfaces.vertices);
        pairs.extend(vertices.map(|vertex| Pair::VertexTriangle(vertex, triangle)));
    }
    for edge in 0..edges {
        pairs.extend((edge + 1..edges).map(|other| Pair::EdgeEdge(edge, other)));
    }
    let near = pairs.into_iter().filter(|pair| {
        let vertices = pair.vertices(surfaces);
        let (one, other) = (part(vertices[0]), part(vertices[3]));
        if !surfaces.may_touch(one, other) || pair.is_joined(surfaces) {
            return false;
        }
        let need = surfaces.parts[one].radius + surfaces.parts[other].radius + 2.0 * REACH;
        pair.foot(surfaces, x).apart.norm() <= need
    });
    near.collect()
}

/// The pairs that lists give, with edges in ascending order.
fn listed(lists: &Lists, surfaces: &Surfaces, x: &[Vec3]) -> BTreeSet<Pair> {
    let mut found = BTreeSet::new();
    lists.each(surfaces, x, &mut |pair| {
        let pair = match pair {
            Pair::EdgeEdge(a, b) => Pair::EdgeEdge(a.min(b), a.max(b)),
            pair @ Pair::VertexTriangle(..) => pair,
        };
        assert!(found.insert(pair), "{pair:?} is listed twice");
    });
    found
}

/// Runs a scene for `steps`. Returns the work of all steps.
fn run(scene: &Scene, steps: u32, mut see: impl FnMut(&Lists, &[Vec3])) -> Vec<Counts> {
    let mut lists = Lists::new(&scene.surfaces, &(scene.at)(0.0));
    let each = (0..steps).map(|step| {
        let x = (scene.at)(f64::from(step) * STEP);
        lists.follow(&scene.surfaces, &x, |_, _| moves(&scene.surfaces));
        see(&lists, &x);
        lists.counts()
    });
    each.collect()
}

#[test]
fn no_pair_is_missed() {
    for scene in motions::all(9) {
        let mut near = 0;
        run(&scene, 24, |lists, x| {
            let (needed, found) = (
                all_near(&scene.surfaces, x),
                listed(lists, &scene.surfaces, x),
            );
            let missed: Vec<_> = needed.difference(&found).collect();
            assert!(missed.is_empty(), "{}: {missed:?}", scene.name);
            near += needed.len();
        });
        // A scene in which nothing is near shows nothing.
        assert!(near > 40, "{}: {near}", scene.name);
    }
}

#[test]
fn a_rigid_motion_costs_no_search() {
    let scene = &motions::all(20)[0];
    let counts = run(scene, 100, |_, _| {});
    assert!(counts[0].searched > 0);
    assert!(counts[1..].iter().all(|counts| counts.searched == 0));
}

#[test]
fn a_search_without_room_for_its_pairs_leaves_the_other_lists() {
    let mut surfaces = Surfaces::default();
    let skin = Skin {
        radius: 0.15e-3,
        touches_itself: false,
        is_obstacle: false,
    };
    let mut x = Vec::new();
    // The two larger sheets have more pairs than the lists have room.
    for (number, [along, across]) in [(0.0, [2, 2]), (1.0, [6, 5]), (2.0, [6, 5])] {
        let size = [along, across].map(|cells| 5e-3 * f64::from(cells));
        let mut mesh =
            generate::sheet(size[0], size[1], along, across, Pattern::Alternating).unwrap();
        let by = Vec3::new(1e-3, 2e-3, 0.3e-3) * number;
        mesh.positions.iter_mut().for_each(|at| *at += by);
        x.extend_from_slice(&mesh.positions);
        surfaces.add(&Mesh::Sheet(mesh), skin).unwrap();
    }
    let mut lists = Lists::new(&surfaces, &x);
    let reaching = |most: f64| Moves {
        most,
        ..Moves::default()
    };
    // The last sheet alone goes far in the second step, so that the first list stays where it is.
    let (near, wide, far) = (moves(&surfaces), reaching(1e-3), reaching(0.1));
    let reaches = [[wide; 3], [near, near, far], [near; 3], [near; 3]];
    for (step, each) in reaches.into_iter().enumerate() {
        for at in &mut x {
            at.z += 1e-4 * at.x;
        }
        lists.follow(&surfaces, &x, |_, cluster| each[cluster]);
        // A search that finds more pairs than there is room ends at 32 for each element.
        let room = 32 * (surfaces.triangles.len() + surfaces.edges.len());
        assert_eq!(lists.counts().listed > room, step == 1);
        let (needed, found) = (all_near(&surfaces, &x), listed(&lists, &surfaces, &x));
        let missed: Vec<_> = needed.difference(&found).collect();
        assert!(needed.len() > 40 && missed.is_empty(), "{step}: {missed:?}");
    }
}
