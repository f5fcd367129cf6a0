//! The rows of a step depend on the surfaces alone, and each contact is one row.

use super::motions;
use alloc_count::calls::{are_counted, count};
use nalgebra::Isometry3;
use physics::Vec3;
use physics::contact::row::Response;
use physics::contact::shape::Shape;
use physics::contact::{
    Contact, Key, Lists, Meeting, Moves, Pair, Part, Placed, Rows, RowsReport, Skin, Step, Surfaces,
};
use physics::mesh::generate::{self, Pattern};
use physics::mesh::{LineMesh, Mesh};
use proptest::prelude::*;

const H: f64 = 4e-3;

/// Surfaces with their positions (m) and predicted displacements (m).
struct Scene {
    surfaces: Surfaces,
    x: Vec<Vec3>,
    u: Vec<Vec3>,
    obstacles: Vec<Placed>,
    /// The largest pressure (Pa).
    pressure: f64,
}

impl Scene {
    fn new(surfaces: Surfaces, x: Vec<Vec3>, u: Vec<Vec3>) -> Self {
        Self {
            surfaces,
            x,
            u,
            obstacles: Vec::new(),
            pressure: f64::INFINITY,
        }
    }

    /// Makes the rows of a step from some pairs, or from those that are listed.
    fn begin(&self, rows: &mut Rows, lists: &mut Lists, pairs: Option<&[Pair]>) -> RowsReport {
        let (surfaces, x, u) = (&self.surfaces, &self.x, &self.u);
        lists.follow(surfaces, x, |hierarchy, cluster| {
            Moves::of(hierarchy.members(cluster), u)
        });
        let lists = &*lists;
        let masses = vec![1e-4; x.len()];
        let v: Vec<Vec3> = u.iter().map(|u| u / H).collect();
        rows.begin(&Step {
            surfaces,
            x,
            u,
            v: &v,
            masses: &masses,
            h: H,
            parting: 0.2,
            meeting: &|one, other| {
                let by_radii = Meeting::by_radii(surfaces, 0.3)(one, other)?;
                Some(Meeting {
                    pressure: self.pressure,
                    force: f64::INFINITY,
                    ..by_radii
                })
            },
            obstacles: &self.obstacles,
            hierarchy: lists.hierarchy(),
            pairs: &|found| match pairs {
                Some(pairs) => pairs.iter().for_each(|pair| found(*pair)),
                None => lists.each(surfaces, x, found),
            },
        })
    }

    fn contacts(&self, most: usize, pairs: Option<&[Pair]>) -> (RowsReport, Vec<Contact>) {
        let mut rows = Rows::new(&self.surfaces, most);
        let mut lists = Lists::new(&self.surfaces, &self.x);
        let report = self.begin(&mut rows, &mut lists, pairs);
        (report, rows.contacts().to_vec())
    }

    fn part(&self, vertex: u32) -> (usize, &Part) {
        let mut parts = self.surfaces.parts.iter().enumerate();
        parts
            .find(|(_, part)| part.vertices.contains(&vertex))
            .unwrap()
    }

    /// All pairs that may touch at all.
    fn all_pairs(&self) -> Vec<Pair> {
        let surfaces = &self.surfaces;
        let count = |number: usize| u32::try_from(number).unwrap();
        let (triangles, edges) = (count(surfaces.triangles.len()), count(surfaces.edges.len()));
        let vertices = count(self.x.len());
        let of_vertices = (0..vertices)
            .flat_map(|vertex| (0..triangles).map(move |t| Pair::VertexTriangle(vertex, t)));
        let of_edges =
            (0..edges).flat_map(|edge| (edge + 1..edges).map(move |e| Pair::EdgeEdge(edge, e)));
        let pairs = of_vertices.chain(of_edges).filter(|pair| {
            let vertices = pair.vertices(surfaces);
            let (one, other) = (self.part(vertices[0]).0, self.part(vertices[3]).0);
            surfaces.may_touch(one, other) && !pair.is_joined(surfaces)
        });
        pairs.collect()
    }
}

/// A scene of the motions at a time (s), with the displacement of a step.
fn moved(scene: &motions::Scene, time: f64) -> Scene {
    let (x, end) = ((scene.at)(time), (scene.at)(time + H));
    let u = x.iter().zip(&end).map(|(x, end)| end - x).collect();
    Scene::new(scene.surfaces.clone(), x, u)
}

#[test]
fn rows_are_those_of_all_pairs() {
    for scene in motions::all(7) {
        let mut most = 0;
        for step in [0.0, 5.0, 11.0, 23.0] {
            let scene = moved(&scene, step * H);
            let mut pairs = scene.all_pairs();
            pairs.reverse();
            let (report, all) = scene.contacts(20_000, Some(&pairs));
            let (_, listed) = scene.contacts(20_000, None);
            assert_eq!(report.dropped, 0);
            assert!(
                all == listed,
                "{}: {} {}",
                scene.surfaces.parts.len(),
                all.len(),
                listed.len()
            );
            most = most.max(all.len());
        }
        // A scene without rows shows nothing.
        assert!(most > 10, "{}: {most}", scene.name);
    }
}

#[test]
fn the_forces_of_a_contact_cancel() {
    for scene in motions::all(7) {
        let scene = moved(&scene, 11.0 * H);
        for contact in scene.contacts(20_000, None).1 {
            let force = Vec3::new(1.0, 2.0, 3.0);
            let sum: Vec3 = contact.weights.iter().map(|weight| force * *weight).sum();
            assert!(sum.norm() < 1e-14 * force.norm(), "{contact:?}");
            let first: f64 = contact.weights.iter().filter(|weight| **weight > 0.0).sum();
            assert!((first - 1.0).abs() < 1e-14);
        }
    }
}

/// A sheet of two triangles, and a vertex of a second one above its diagonal, at a height (m).
fn over_a_diagonal(height: f64, by: Vec3) -> Scene {
    let mut surfaces = Surfaces::default();
    let skin = Skin {
        radius: 0.5e-3,
        touches_itself: false,
        is_obstacle: false,
    };
    let lower = generate::sheet(0.02, 0.02, 1, 1, Pattern::Alternating).unwrap();
    let mut upper = lower.clone();
    // Stands on a corner.
    for x in &mut upper.positions {
        let corner = *x - lower.positions[0];
        *x = Vec3::new(
            0.0,
            (corner.x - corner.y) * 0.5,
            height + corner.x + corner.y,
        );
    }
    let mut x = lower.positions.clone();
    x.extend_from_slice(&upper.positions);
    surfaces.add(&Mesh::Sheet(lower), skin).unwrap();
    surfaces.add(&Mesh::Sheet(upper), skin).unwrap();
    let mut u = vec![Vec3::zeros(); x.len()];
    u[4..].fill(by);
    Scene::new(surfaces, x, u)
}

#[test]
fn a_foot_on_a_shared_edge_is_one_row() {
    for by in [Vec3::zeros(), Vec3::z() * -0.2e-3] {
        let scene = over_a_diagonal(0.9e-3, by);
        let (_, found) = scene.contacts(100, None);
        assert_eq!(found.len(), 1, "{found:#?}");
        let row = found[0].row;
        assert_eq!(found[0].key, Key::Vertex(4, 0));
        assert!((row.normal - Vec3::z()).norm() < 1e-12);
        // The overlap of 0.1 mm parts at 5 mm/s.
        assert!((row.gap + 5e-3 * H).abs() < 1e-12, "{row:?}");
        assert!((found[0].predicted - (by.z - 0.1e-3)).abs() < 1e-12);
    }
}

#[test]
fn a_vertex_that_would_pass_through_keeps_its_side() {
    let scene = over_a_diagonal(1.5e-3, Vec3::z() * -6e-3);
    let (_, found) = scene.contacts(100, None);
    let tip = found
        .iter()
        .find(|contact| contact.key == Key::Vertex(4, 0))
        .unwrap();
    assert!((tip.row.normal - Vec3::z()).norm() < 1e-12, "{tip:?}");
    assert!((tip.row.gap - 0.5e-3).abs() < 1e-12, "{tip:?}");
    assert!((tip.predicted + 5.5e-3).abs() < 1e-12, "{tip:?}");
    assert!(tip.is_impact);
}

#[test]
fn an_overlap_parts_in_a_tenth_of_a_second() {
    let scene = over_a_diagonal(0.05e-3, Vec3::zeros());
    let mut rows = Rows::new(&scene.surfaces, 100);
    let mut lists = Lists::new(&scene.surfaces, &scene.x);
    let report = scene.begin(&mut rows, &mut lists, None);
    assert!(
        report.parting > 0 && report.parting == report.rows,
        "{report:?}"
    );
    let tip = rows.contacts()[0];
    assert!((tip.row.gap + 0.95e-3 / 0.1 * H).abs() < 1e-15, "{tip:?}");
    // The overlap of 0.95 mm is gone after 0.5 mm and 0.5 mm, with a force of 2 N.
    let parted = |contact: &Contact| Response {
        normal: 2.0,
        gap: contact.row.gap + 0.5e-3,
        ..contact.row.response(&Vec3::zeros())
    };
    let responses: Vec<Response> = rows.contacts().iter().map(parted).collect();
    rows.end(responses.iter(), &|_| false);
    let nearly = over_a_diagonal(0.9e-3, Vec3::zeros());
    assert!(nearly.begin(&mut rows, &mut lists, None).parting > 0);
    rows.end(responses.iter(), &|_| false);
    // A contact that has parted carries nothing.
    let apart = over_a_diagonal(0.999e-3, Vec3::zeros());
    assert_eq!(apart.begin(&mut rows, &mut lists, None).parting, 0);
    assert_eq!(rows.contacts()[0].row.carried, 0.0);
    let still = |response: &Response| Response {
        gap: response.gap - 0.5e-3,
        ..*response
    };
    let responses: Vec<Response> = responses.iter().map(still).collect();
    rows.end(responses.iter(), &|_| false);
    // Afterwards it is like others, and carries its force unless it opens.
    let pressed = over_a_diagonal(0.9e-3, Vec3::zeros());
    assert_eq!(pressed.begin(&mut rows, &mut lists, None).parting, 0);
    assert_eq!(rows.contacts()[0].row.carried, 2.0);
}

#[test]
fn a_force_follows_its_vertex_over_triangles() {
    let mut rows = Rows::new(&over_a_diagonal(1e-3, Vec3::zeros()).surfaces, 100);
    let mut corners = Vec::new();
    for shift in [-2e-3, 2e-3] {
        let mut scene = over_a_diagonal(0.999e-3, Vec3::zeros());
        scene.x[4..].iter_mut().for_each(|x| x.x += shift);
        let mut lists = Lists::new(&scene.surfaces, &scene.x);
        scene.begin(&mut rows, &mut lists, None);
        let tip = rows.contacts()[0];
        corners.push(tip.vertices);
        if shift > 0.0 {
            assert_eq!((tip.row.carried, tip.age), (2.0, 1));
            assert_eq!(tip.row.anchored, Vec3::new(0.3, 0.4, 0.0));
        }
        let response = Response {
            normal: 2.0,
            friction: Vec3::new(0.3, 0.4, 0.0),
            ..tip.row.response(&Vec3::zeros())
        };
        rows.end([response].iter(), &|_| false);
        assert!(rows.stored() > 0.0);
    }
    assert_ne!(corners[0], corners[1]);
}

/// Rows against each other would grow without bound.
#[test]
fn the_force_of_a_stopped_vertex_does_not_grow() {
    let scene = over_a_diagonal(0.999e-3, Vec3::zeros());
    let mut rows = Rows::new(&scene.surfaces, 100);
    let mut lists = Lists::new(&scene.surfaces, &scene.x);
    for (force, is_stopped, kept) in [(2.0, false, 2.0), (3.0, true, 2.0), (1.0, true, 1.0)] {
        scene.begin(&mut rows, &mut lists, None);
        let tip = rows.contacts()[0];
        let response = Response {
            normal: force,
            ..tip.row.response(&Vec3::zeros())
        };
        rows.end([response].iter(), &|vertex| {
            is_stopped && vertex == tip.vertices[0]
        });
        scene.begin(&mut rows, &mut lists, None);
        assert_eq!(rows.contacts()[0].forces()[0], kept);
    }
}

#[test]
fn a_full_reserve_keeps_the_deepest() {
    let scene = moved(&motions::all(7)[0], 0.0);
    let (report, all) = scene.contacts(20_000, None);
    let (cut, few) = scene.contacts(50, None);
    assert_eq!((report.dropped, few.len()), (0, 50));
    assert!(cut.dropped > 0 && cut.rows == 50, "{cut:?}");
    let deepest = |of: &[Contact]| {
        of.iter()
            .map(|one| one.predicted)
            .fold(f64::INFINITY, f64::min)
    };
    assert_eq!(deepest(&all), deepest(&few));
}

#[test]
fn ends_of_threads_that_meet_are_one_row() {
    // Two threads of three vertices, whose middle vertices lie over each other.
    let mut surfaces = Surfaces::default();
    let mut x = Vec::new();
    for (along, height) in [(Vec3::x(), 0.0), (Vec3::y(), 0.95e-3)] {
        // Bent away from each other.
        let bend = if height > 0.0 { 2e-3 } else { -2e-3 };
        let at = |i: i32| {
            along * (0.01 * f64::from(i)) + Vec3::z() * (height + bend * f64::from(i.abs()))
        };
        let positions: Vec<Vec3> = (-1..2).map(at).collect();
        x.extend_from_slice(&positions);
        let mesh = LineMesh::new(positions, vec![[0, 1], [1, 2]]).unwrap();
        let skin = Skin {
            radius: 0.5e-3,
            touches_itself: false,
            is_obstacle: false,
        };
        surfaces.add(&Mesh::Thread(mesh), skin).unwrap();
    }
    let mut scene = Scene::new(surfaces, x, vec![Vec3::zeros(); 6]);
    let (_, found) = scene.contacts(100, None);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert_eq!(found[0].key, Key::Vertex(1, 1));
    assert!((found[0].row.normal + Vec3::z()).norm() < 1e-12);
    // A vertex against a segment, then two segments.
    scene.x[3..].iter_mut().for_each(|x| x.x += 3e-3);
    scene.x[..3].iter_mut().for_each(|x| x.z = 0.0);
    let (_, found) = scene.contacts(100, None);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert_eq!(found[0].key, Key::Vertex(4, 0));
    scene.x[3..]
        .iter_mut()
        .for_each(|x| *x = Vec3::new(x.x, x.y + 3e-3, 0.95e-3));
    let (_, found) = scene.contacts(100, None);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert_eq!(found[0].key, Key::Edges([1, 2, 3, 4]));
}

#[test]
fn an_obstacle_that_moves_takes_its_contact_along() {
    let scene = moved(&motions::all(3)[4], 0.0);
    let mut scene = Scene::new(scene.surfaces, scene.x, vec![Vec3::zeros(); 32]);
    // A floor under the lower sheet, which moves and turns.
    let start = Isometry3::translation(0.0, 0.0, -0.2e-3);
    let turn = Isometry3::new(Vec3::new(1e-3, 0.0, -0.2e-3), Vec3::z() * 0.01);
    scene.obstacles = vec![Placed {
        shape: Shape::Plane,
        start,
        end: turn,
        holds: false,
    }];
    let (_, found) = scene.contacts(100, None);
    assert_eq!(found.len(), 16);
    for contact in found {
        let at = scene.x[contact.vertices[0] as usize];
        assert_eq!(contact.parts, [0, 2]);
        // The overlap of 0.05 mm parts at 5 mm/s.
        assert!((contact.row.gap + 5e-3 * H).abs() < 1e-12, "{contact:?}");
        let before = start * turn.inverse() * nalgebra::Point3::from(at - Vec3::z() * 0.2e-3);
        let motion = at - Vec3::z() * 0.2e-3 - before.coords;
        assert!((contact.row.motion - motion).norm() < 1e-12, "{contact:?}");
    }
    // A thin box that the sheet would pass through pushes it back.
    scene.obstacles[0].shape = Shape::Box {
        half: Vec3::new(1.0, 1.0, 1e-4),
    };
    let pose = Isometry3::translation(0.0, 0.0, -2e-3);
    (scene.obstacles[0].start, scene.obstacles[0].end) = (pose, pose);
    scene.u[..16].fill(Vec3::z() * -8e-3);
    let (_, found) = scene.contacts(100, None);
    let floor = found.iter().filter(|contact| contact.parts == [0, 2]);
    assert_eq!(floor.clone().count(), 16);
    for contact in floor {
        assert!((contact.row.normal - Vec3::z()).norm() < 1e-12);
        assert!((contact.row.gap - 1.65e-3).abs() < 1e-12, "{contact:?}");
    }
}

#[test]
fn a_step_allocates_nothing() {
    assert!(are_counted());
    let scene = &motions::all(9)[1];
    let first = moved(scene, 0.0);
    let mut rows = Rows::new(&first.surfaces, 4_000);
    let lists = Lists::new(&first.surfaces, &first.x);
    let masses = vec![1e-4; first.x.len()];
    let obstacles = [Placed {
        shape: Shape::sphere(0.05),
        start: Isometry3::identity(),
        end: Isometry3::identity(),
        holds: false,
    }];
    let all = first.all_pairs();
    let mut responses = Vec::with_capacity(4_000);
    for step in 0..20 {
        let Scene { surfaces, x, u, .. } = moved(scene, f64::from(step) * H);
        let calls = count(|| {
            let report = rows.begin(&Step {
                surfaces: &surfaces,
                x: &x,
                u: &u,
                v: &u,
                masses: &masses,
                h: H,
                parting: 0.2,
                meeting: &Meeting::by_radii(&surfaces, 0.3),
                obstacles: &obstacles,
                hierarchy: lists.hierarchy(),
                pairs: &|found| all.iter().for_each(|pair| found(*pair)),
            });
            assert!(report.rows > 40);
            responses.clear();
            responses.extend(
                rows.contacts()
                    .iter()
                    .map(|one| one.row.response(&Vec3::zeros())),
            );
            rows.end(responses.iter(), &|_| false);
        });
        assert_eq!(calls, 0, "{step}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn the_numbers_of_triangles_and_edges_do_not_matter(
        which in 0..5_usize,
        seed in prop::collection::vec(0..u32::MAX, 1000),
        time in 0.0..0.1,
    ) {
        let mut scene = moved(&motions::all(5)[which], time);
        let (_, expected) = scene.contacts(20_000, None);
        for part in &scene.surfaces.parts {
            let all = part.triangles.start as usize..part.triangles.end as usize;
            let mut shuffled: Vec<_> = scene.surfaces.triangles[all.clone()].iter().copied().zip(seed.iter().cycle()).collect();
            shuffled.sort_by_key(|(_, at)| **at);
            let shuffled = shuffled.into_iter().map(|(corners, _)| corners);
            scene.surfaces.triangles.splice(all, shuffled);
            let all = part.edges.start as usize..part.edges.end as usize;
            let edges = scene.surfaces.edges[all.clone()].iter().zip(&scene.surfaces.opposite[all.clone()]);
            let mut shuffled: Vec<_> = edges.map(|(ends, opposite)| (*ends, *opposite)).zip(seed.iter().cycle()).collect();
            shuffled.sort_by_key(|(_, at)| **at);
            let (ends, opposite): (Vec<_>, Vec<_>) = shuffled.into_iter().map(|(edge, _)| edge).unzip();
            scene.surfaces.edges.splice(all.clone(), ends);
            scene.surfaces.opposite.splice(all, opposite);
        }
        let (_, found) = scene.contacts(20_000, None);
        prop_assert!(found == expected);
    }
}

#[test]
fn the_largest_force_is_the_pressure_on_the_smaller_area() {
    let mut scene = over_a_diagonal(0.999e-3, Vec3::zeros());
    scene.pressure = 1e4;
    // The square has 4 cm2, and two thirds of its triangles are about the ends of the diagonal.
    let areas = &scene.surfaces.areas;
    assert!((areas[..4].iter().sum::<f64>() - 4e-4).abs() < 1e-15);
    let mut rows = Rows::new(&scene.surfaces, 100);
    let mut lists = Lists::new(&scene.surfaces, &scene.x);
    scene.begin(&mut rows, &mut lists, None);
    let most = rows.contacts()[0].row.most;
    // The tip is a corner of one triangle or of two, on the diagonal.
    let tip = areas[4].min(areas[1].max(areas[0]));
    assert!((most - 1e4 * tip).abs() < 1e-12 * most, "{most} {tip}");
    // The multiplier is carried up to it.
    let row = rows.contacts()[0].row;
    let pressed = row.response(&Vec3::new(0.0, 0.0, -0.1));
    assert_eq!(pressed.normal, most);
    rows.end([pressed].iter(), &|_| false);
    scene.begin(&mut rows, &mut lists, None);
    let row = rows.contacts()[0].row;
    assert_eq!((row.carried, row.most), (most, most));
}
