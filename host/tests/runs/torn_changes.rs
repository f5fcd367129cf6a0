//! Changes of bodies that tear or touch: hands take hold of a sheet that tears on, and another mesh takes over on a floor,
//! under another body, and after a pause of the host.

use crate::touching_scenes::{BLOCKS, DEVICES, sheet};
use host::engine::build::BuildOptions;
use host::engine::change::{ChangeError, Edit, Grip};
use host::scene::Scene;
use physics::contact::crossing::passes;
use physics::mesh::Mesh;
use physics::{Body, BodyMap, Border, Freedom, HandleSpec, Vec3};
use proptest::prelude::*;
use rt_core::Pose;
use std::collections::BTreeMap;
use support::rig::Rig;

/// Ticks between two host steps: 250 Hz.
const TICKS: u64 = 4;
/// Steps until a change lands in virtual time: 50 ms of 4 ms each, rounded up.
const LANDING: usize = 13;

fn rig(text: &str) -> Rig {
    let loaded = Scene::load_texts("x.toml", text, &BTreeMap::new()).expect("a scene");
    let mut rig = Rig::new(&loaded, BuildOptions::default());
    rig.rest.resize(3, Pose::identity());
    rig
}

fn first_body(text: &str) -> Body {
    rig(text).engine.bodies()[0].body().clone()
}

fn body(rig: &Rig, number: usize) -> &Body {
    rig.engine.bodies()[number].body()
}

/// Makes steps in which both hands move apart by `speed` (m/s) from where they are.
fn steps(rig: &mut Rig, count: usize, speed: f64) {
    for _ in 0..count {
        rig.follow(TICKS, |_, _| {});
        let by = speed * TICKS as f64 * 1e-3;
        rig.rest[0].position.x -= by;
        rig.rest[1].position.x += by;
        rig.step();
    }
}

/// The force of side `other` on side `one` (N).
fn force(rig: &Rig, sides: [usize; 2]) -> Vec3 {
    let contacts = rig.engine.contact().expect("contacts").contacts();
    let found = contacts.touching().iter().filter(|sum| sum.sides == sides);
    found.map(|sum| sum.force).sum()
}

fn edges(rig: &Rig) -> u64 {
    rig.engine.stats().tears[0].opened
}

/// Replaces a body by `new`, each vertex of which continues the nearest one at rest.
fn replace(new: Body) -> Edit {
    Edit::Replace(Box::new(move |old: Body| {
        let places = old.rest_positions().to_vec();
        let nearest = |x: &Vec3| {
            let apart = |place: &Vec3| (place - x).norm();
            let numbered = places.iter().zip(0..);
            let least = numbered.min_by(|a, b| apart(a.0).total_cmp(&apart(b.0)));
            least.map_or(0, |(_, number)| number)
        };
        let map = BodyMap {
            vertices: new.rest_positions().iter().map(nearest).collect(),
            ..BodyMap::identity(&old)
        };
        Ok((new, map))
    }))
}

/// A third hand on the vertices about a place.
fn grab(rig: &mut Rig, place: Vec3) -> Edit {
    rig.rest[2] = Pose::at(place);
    let near = (0_u32..).zip(body(rig, 0).rest_positions());
    let near = near.filter(|(_, x)| (*x - place).norm() < 6e-3);
    Edit::Grab(Grip {
        spec: HandleSpec {
            vertices: near.map(|(vertex, _)| vertex).collect(),
            origin: place,
            freedom: Freedom::Translation,
            border: Border::Hinged,
        },
        device: 2,
        link: None,
    })
}

fn assert_sound(rig: &Rig, changes: u64) {
    let stats = rig.engine.stats();
    let found = (stats.changes, stats.faults, &stats.first_fault);
    assert_eq!(found, (changes, 0, &None));
}

/// The edges of a sheet that pass through its triangles, and the vertices below the floor.
fn crossed(body: &Body) -> usize {
    let Some(Mesh::Sheet(mesh)) = body.mesh() else {
        panic!("a sheet");
    };
    let at = |vertex: u32| &mesh.positions[vertex as usize];
    let mut count = mesh.positions.iter().filter(|x| x.z <= 0.0).count();
    for corners in &mesh.triangles {
        for other in &mesh.triangles {
            let shares = other.iter().any(|vertex| corners.contains(vertex));
            for [a, b] in [[0, 1], [1, 2], [2, 0]] {
                let ends = [other[a], other[b]].map(at);
                count += usize::from(!shares && passes(ends, corners.map(at)));
            }
        }
    }
    count
}

fn assert_finite_and_uncrossed(rig: &Rig) {
    let body = body(rig, 0);
    assert!(body.positions().all(|x| x.iter().all(|c| c.is_finite())));
    assert!(body.kinetic_energy().is_finite());
    assert_eq!(crossed(body), 0);
}

#[test]
fn a_sheet_on_a_floor_weighs_the_same_with_another_mesh() {
    let free = |text: String| {
        let end = text.find("[[body.handle]]").expect("handles");
        format!("{}{DEVICES}", &text[..end])
    };
    let text = free(sheet(false));
    let mut rig = rig(&text);
    steps(&mut rig, 150, 0.0);
    let weight = 9.81 * body(&rig, 0).total_mass();
    let before = force(&rig, [0, 1]).z / weight;
    let coarse = first_body(&text.replacen("cells = [8, 6]", "cells = [4, 3]", 1));
    let count = coarse.vertex_count();
    rig.engine.change(0, vec![replace(coarse)]).unwrap();
    steps(&mut rig, LANDING + 150, 0.0);
    let after = force(&rig, [0, 1]).z / weight;
    assert_sound(&rig, 1);
    assert_eq!(body(&rig, 0).vertex_count(), count);
    let errors = [before, after].map(|carried| (carried - 1.0).abs());
    assert!(errors.iter().all(|error| *error < 1e-6), "{errors:?}");
}

#[test]
fn a_block_goes_on_lying_on_one_whose_mesh_is_replaced() {
    let text = format!("{BLOCKS}{DEVICES}");
    let mut rig = rig(&text);
    steps(&mut rig, 400, 0.0);
    let weight = 9.81 * body(&rig, 1).total_mass();
    let on_upper = |rig: &Rig| -force(rig, [0, 1]).z / weight;
    assert!((on_upper(&rig) - 1.0).abs() < 1e-3, "{}", on_upper(&rig));
    let coarse = first_body(&text.replacen("cells = [4, 4, 2]", "cells = [2, 2, 1]", 1));
    rig.engine.change(0, vec![replace(coarse)]).unwrap();
    let top = |rig: &Rig| body(rig, 1).positions().map(|x| x.z).fold(0.0, f64::max);
    let (before, mut lowest) = (top(&rig), f64::INFINITY);
    for _ in 0..LANDING + 400 {
        steps(&mut rig, 1, 0.0);
        lowest = lowest.min(top(&rig));
    }
    assert_sound(&rig, 1);
    assert!((on_upper(&rig) - 1.0).abs() < 1e-3, "{}", on_upper(&rig));
    // The coarse block is stiffer, and nothing falls while its contacts are made anew: free fall over two steps is 0.6 mm.
    assert!(before - lowest < 1e-4, "{}", before - lowest);
}

#[test]
fn a_hand_takes_hold_of_a_sheet_that_tears_on_and_lets_go() {
    let mut rig = rig(&sheet(true).replacen("0.0066666666666666", "0.0133333333333333", 1));
    while edges(&rig) == 0 {
        steps(&mut rig, 1, 0.01);
    }
    let edit = grab(&mut rig, Vec3::new(0.015, -0.01, 0.0003));
    rig.engine.change(0, vec![edit]).unwrap();
    let before = edges(&rig);
    steps(&mut rig, LANDING, 0.003);
    let landed = edges(&rig);
    assert!(landed > before, "the sheet tears on meanwhile");
    assert_eq!(rig.published.last().unwrap().head.handle_count, 3);
    let release = Edit::Release { handle: 2 };
    rig.engine.change(0, vec![release]).unwrap();
    steps(&mut rig, LANDING + 40, 0.02);
    assert_eq!(rig.published.last().unwrap().head.handle_count, 2);
    assert_sound(&rig, 2);
    assert_finite_and_uncrossed(&rig);
    // The summary counts all edges: each has doubled a vertex at least.
    let report = rig.engine.stats().tears[0];
    let journal = rig.engine.bodies()[0].tears().unwrap().tearing().journal();
    assert!(report.opened as usize >= journal.len() && report.area > 0.0);
}

#[test]
fn a_sheet_tears_after_a_hand_has_taken_hold_of_it() {
    let mut rig = rig(&sheet(true));
    let edit = grab(&mut rig, Vec3::new(0.02, -0.01, 0.0003));
    rig.engine.change(0, vec![edit]).unwrap();
    steps(&mut rig, LANDING, 0.0);
    assert_eq!(edges(&rig), 0);
    steps(&mut rig, 60, 0.02);
    assert!(edges(&rig) > 1, "{}", edges(&rig));
    assert_sound(&rig, 1);
    assert_finite_and_uncrossed(&rig);
}

#[test]
fn a_torn_sheet_is_replaced_by_itself_and_tears_on_from_its_tip() {
    let run = |replaces: bool| {
        let mut rig = rig(&sheet(true));
        while edges(&rig) == 0 {
            steps(&mut rig, 1, 0.02);
        }
        let same = Edit::Replace(Box::new(|body: Body| {
            let map = BodyMap::identity(&body);
            Ok((body, map))
        }));
        let before = edges(&rig);
        if replaces {
            rig.engine.change(0, vec![same]).unwrap();
        }
        steps(&mut rig, LANDING - 1, 0.02);
        let waited = edges(&rig) == before;
        steps(&mut rig, 60, 0.02);
        assert_finite_and_uncrossed(&rig);
        (rig, waited)
    };
    let ((rig, waited), (other, _)) = (run(true), run(false));
    assert!(waited);
    assert_sound(&rig, 1);
    // What waited has torn since: both have come as far as the hands.
    let torn = [&rig, &other].map(|rig| rig.engine.stats().tears[0].area);
    assert!((torn[0] / torn[1] - 1.0).abs() < 0.3, "{torn:?}");
}

#[test]
fn an_intact_sheet_takes_over_from_a_torn_one() {
    let mut rig = rig(&sheet(true));
    while edges(&rig) < 2 {
        steps(&mut rig, 1, 0.02);
    }
    let area = rig.engine.stats().tears[0].area;
    let intact = first_body(&sheet(false));
    let whole = intact.vertex_count();
    rig.engine.change(0, vec![replace(intact)]).unwrap();
    steps(&mut rig, LANDING + 60, 0.0);
    assert_sound(&rig, 1);
    assert_finite_and_uncrossed(&rig);
    assert_eq!(body(&rig, 0).vertex_count(), whole);
    let tears = rig.engine.bodies()[0].tears().expect("it may tear");
    assert_eq!(
        (tears.tearing().tips().len(), tears.pieces().count()),
        (0, 1)
    );
    assert_eq!(rig.engine.stats().tears[0].area, area);
    assert_eq!(tears.tearing().report().pending, 0.0);
}

#[test]
fn a_whole_sheet_takes_over_from_two_pieces_and_its_hands_share_an_account_again() {
    let mut rig = rig(&sheet(true));
    let pieces = |rig: &Rig| rig.engine.bodies()[0].tears().unwrap().pieces().count();
    while pieces(&rig) == 1 {
        steps(&mut rig, 1, 0.02);
    }
    steps(&mut rig, 2, 0.0);
    let parted = *rig.published.last().unwrap();
    assert_eq!(parted.piece_count(), 2);
    let intact = first_body(&sheet(false));
    rig.engine.change(0, vec![replace(intact)]).unwrap();
    steps(&mut rig, LANDING + 60, 0.0);
    assert_sound(&rig, 1);
    let whole = *rig.published.last().unwrap();
    assert_eq!(whole.piece_count(), 1);
    // What the pieces had released stays told, and the sheet claims no more than the hands have given.
    assert!(whole.head.released >= parted.head.released);
    assert!(whole.head.energy.is_finite() && whole.head.energy < 0.05);
    assert_finite_and_uncrossed(&rig);
}

#[test]
fn a_change_lands_after_the_host_has_paused_and_a_device_was_lost() {
    let mut rig = rig(&sheet(true));
    while edges(&rig) == 0 {
        steps(&mut rig, 1, 0.02);
    }
    let edit = grab(&mut rig, Vec3::new(0.015, -0.01, 0.0003));
    rig.engine.change(0, vec![edit]).unwrap();
    // The host pauses for 0.2 s, while the device of the left hand reports nothing new.
    rig.follow(200, |_, _| {});
    for _ in 0..30 {
        rig.follow(TICKS, |_, hands| hands[1].position.x += 1e-3);
        rig.step();
    }
    let last = rig.published.last().unwrap();
    assert_eq!(last.head.handle_count, 3);
    assert!(last.handles().all(|handle| handle.wrench.is_finite()));
    assert_sound(&rig, 1);
    assert_finite_and_uncrossed(&rig);
}

#[test]
fn what_cannot_change_on_a_body_that_tears_is_refused_in_words() {
    let mut rig = rig(&sheet(true));
    steps(&mut rig, 5, 0.0);
    let clamp = Edit::Clamp {
        vertices: vec![0, 1],
    };
    let refused = rig.engine.change(0, vec![clamp]).unwrap_err();
    assert_eq!(refused, ChangeError::Clamped);
    let block = format!("{BLOCKS}{DEVICES}");
    let solid = first_body(&block);
    let to_solid = Edit::Replace(Box::new(move |old: Body| {
        let map = BodyMap {
            vertices: vec![0; solid.vertex_count()],
            handles: Vec::new(),
            supports: Vec::new(),
        };
        drop(old);
        Ok((solid, map))
    }));
    rig.engine.change(0, vec![to_solid]).unwrap();
    steps(&mut rig, LANDING, 0.0);
    let told = rig.engine.stats().first_fault.clone().unwrap();
    assert!(
        told.contains("replacement cannot") && told.contains("only a sheet of triangles"),
        "{told}"
    );
    // The sheet continues.
    steps(&mut rig, 20, 0.02);
    assert_eq!(rig.engine.stats().faults, 1);
    assert_finite_and_uncrossed(&rig);
}

/// A change at random.
#[derive(Clone, Copy, Debug)]
enum Change {
    Grab([f64; 2]),
    Release,
    Same,
    Intact,
}

fn change() -> impl Strategy<Value = Change> {
    prop_oneof![
        [-0.018..0.018, -0.018..0.018].prop_map(Change::Grab),
        Just(Change::Release),
        Just(Change::Same),
        Just(Change::Intact),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn after_any_changes_a_torn_sheet_is_finite_and_crosses_nothing(
        begin in 5_usize..60,
        changes in prop::collection::vec((change(), 0_usize..25), 1..4),
        speed in 0.0..0.04,
    ) {
        let mut rig = rig(&sheet(true));
        steps(&mut rig, begin, speed);
        let mut has_third = false;
        for (change, wait) in changes {
            let edit = match change {
                Change::Grab([x, y]) if !has_third => grab(&mut rig, Vec3::new(x, y, 0.0003)),
                Change::Release if has_third => Edit::Release { handle: 2 },
                Change::Same => Edit::Replace(Box::new(|body: Body| {
                    let map = BodyMap::identity(&body);
                    Ok((body, map))
                })),
                Change::Intact if !has_third => {
                    let text = sheet(false);
                    replace(first_body(&text))
                }
                _ => continue,
            };
            rig.engine.change(0, vec![edit]).unwrap();
            steps(&mut rig, LANDING + wait, speed);
            let count = body(&rig, 0).handle_count();
            // A change that the tear has overtaken is told, and the body continues.
            has_third = count == 3;
            assert_finite_and_uncrossed(&rig);
            prop_assert_eq!(rig.published.last().map(|model| usize::from(model.head.handle_count)), Some(count));
        }
    }
}
