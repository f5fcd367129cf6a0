//! A body that tears: mass, area, momentum and energy across edits, and the body that results.

use physics::mesh::TriMesh;
use physics::mesh::generate::{Pattern, sheet};
use physics::topology::{AdvanceOptions, Edit, NONE, Reserve};
use physics::{
    Body, BodyConfig, BodyEdit, Border, Freedom, HandleSpec, Material, TearingError, Vec3,
};

const MATERIAL: Material = Material {
    young: 1e6,
    poisson: 0.3,
    thickness: 1e-3,
    density: 1000.0,
};

fn cells() -> TriMesh {
    sheet(0.2, 0.2, 12, 12, Pattern::Alternating).expect("a sheet")
}

/// A tearable sheet in motion: its vertices have unlike positions and velocities.
fn moving(bending: f64, handles: &[HandleSpec]) -> Body {
    guided(bending, handles, &[])
}

/// As [`moving`], with supports that guide vertices along axes.
fn guided(bending: f64, handles: &[HandleSpec], supports: &[(Vec<u32>, [bool; 3])]) -> Body {
    let mesh = cells();
    let config = BodyConfig {
        bending,
        ..BodyConfig::default()
    };
    let mut body = Body::sheet(&mesh, &[MATERIAL], config, handles).expect("a sheet");
    let wave = |i: usize, k: f64| libm::sin(k * i as f64 + k);
    let x: Vec<Vec3> = (mesh.positions.iter().enumerate())
        .map(|(i, x)| x + Vec3::new(wave(i, 1.7), wave(i, 2.9), 5.0 * wave(i, 0.7)) * 2e-4)
        .collect();
    let v: Vec<Vec3> = (0..x.len())
        .map(|i| Vec3::new(wave(i, 0.3), wave(i, 1.1), wave(i, 2.3)))
        .collect();
    body.set_positions(&x).expect("positions");
    body.set_velocities(&v).expect("velocities");
    for (vertices, axes) in supports {
        body.add_support(vertices, *axes).expect("a support");
    }
    body.make_tearable(Reserve {
        vertices: 200,
        triangles: 200,
    })
    .expect("tearable");
    body
}

/// Tears `body` from a vertex on its border in a wavy line, and calls `look` with the body before and after each edit.
fn tear(body: &mut Body, snapping: f64, look: impl FnMut(&Body, &Body, &Edit, &BodyEdit)) {
    let surface = body.surface().expect("a surface");
    let tip = (0..surface.vertex_count() as u32)
        .find(|&v| {
            let x = body.node_positions()[v as usize];
            surface.on_border(v) && x.x.abs() < 0.02 && x.y < -0.09
        })
        .expect("a vertex of the lower border");
    tear_from(body, tip, 0.6, snapping, look);
}

/// Tears `body` from the vertex `tip` by up to twelve edges, which turn by up to `wave` (rad).
fn tear_from(
    body: &mut Body,
    mut tip: u32,
    wave: f64,
    snapping: f64,
    mut look: impl FnMut(&Body, &Body, &Edit, &BodyEdit),
) {
    for count in 0..12 {
        let surface = body.surface().expect("a surface");
        let angle = surface.straight_ahead(tip) + wave * libm::sin(f64::from(count));
        let options = AdvanceOptions {
            snapping,
            opening: 0.0,
        };
        let may_move = |vertex: u32| !body.is_held(vertex);
        let Some(edit) = surface.advance(tip, angle, options, may_move) else {
            break;
        };
        let before = body.clone();
        let done = body.edit(&edit).expect("an edit");
        look(&before, body, &edit, &done);
        if done.surface.tips[0] == NONE {
            break;
        }
        tip = done.surface.tips[0];
    }
}

/// Rounding of sums over some hundred terms.
const ROUNDING: f64 = 1e-12;

#[test]
fn edits_keep_mass_and_momentum() {
    for snapping in [0.0, 0.3] {
        let (mut body, mut edits) = (moving(0.0, &[]), 0);
        tear(&mut body, snapping, |before, after, _, _| {
            edits += 1;
            let (m0, m1) = (before.total_mass(), after.total_mass());
            assert!((m1 - m0).abs() <= ROUNDING * m0, "{m0} {m1}");
            let (p0, p1) = (before.momentum(), after.momentum());
            let size = before.total_mass();
            assert!((p1 - p0).norm() <= ROUNDING * size, "{p0} {p1}");
            let weight = before.total_external_force() - after.total_external_force();
            assert!(weight.norm() <= ROUNDING * before.total_external_force().norm());
        });
        assert!(edits >= 8, "{edits} edits");
    }
}

/// The vertices of `mesh` in the box from `min` to `max` (m).
fn in_box(mesh: &TriMesh, min: Vec3, max: Vec3) -> Vec<u32> {
    let inside = |x: &Vec3| (0..3).all(|axis| (min[axis]..=max[axis]).contains(&x[axis]));
    let numbered = (0_u32..).zip(&mesh.positions);
    numbered
        .filter_map(|(vertex, x)| inside(x).then_some(vertex))
        .collect()
}

#[test]
fn a_snap_changes_no_velocity_of_a_hand_or_along_a_guide() {
    let mesh = cells();
    let within = |low: [f64; 2], high: [f64; 2]| {
        let corner = |[x, y]: [f64; 2], z| Vec3::new(x, y, z);
        in_box(&mesh, corner(low, -1.0), corner(high, 1.0))
    };
    // Two hands hold the lower and the upper border. All other vertices are guided along z, and those on the right along
    // x as well.
    let handles = [
        within([-1.0, -1.0], [1.0, -0.09]),
        within([-1.0, 0.09], [1.0, 1.0]),
    ]
    .map(|vertices| HandleSpec {
        vertices,
        origin: Vec3::zeros(),
        freedom: Freedom::Translation,
        border: Border::Hinged,
    });
    let inner = |x: f64| within([x, -0.09], [1.0, 0.09]);
    let supports = [
        (inner(-1.0), [false, false, true]),
        (inner(0.01), [true, false, true]),
    ];
    // One tear runs beside each hand from the left border, and leads away from it slowly.
    for (hand, (row, wave)) in [(-0.1 + 0.2 / 12.0, 0.15), (0.1 - 0.2 / 12.0, -0.15)]
        .into_iter()
        .enumerate()
    {
        let mut body = guided(0.0, &handles, &supports);
        let tip = within([-1.0, row - 1e-3], [-0.099, row + 1e-3])[0];
        let (mut snaps, mut corrected) = (0, 0);
        tear_from(&mut body, tip, wave, 0.3, |before, after, _, done| {
            let moved: Vec<u32> = (done.surface.moved.iter().flatten())
                .map(|moved| moved.vertex)
                .collect();
            snaps += moved.len();
            let old = before.node_velocities();
            for (node, (v0, v1)) in (0..).zip(old.iter().zip(after.node_velocities())) {
                if before.is_held(node) {
                    assert_eq!(v0, v1, "held vertex {node}");
                } else if !moved.contains(&node) {
                    assert_eq!(v0.z, v1.z, "guided vertex {node}");
                    let on_guide = supports[1].0.contains(&node);
                    assert!(!on_guide || v0.x == v1.x, "guided vertex {node}");
                    // Neighbours that are free along y take part in the correction.
                    corrected += usize::from(v0.y != v1.y);
                }
            }
            // Along y, every edit has free vertices that restore the momentum.
            let change = (after.momentum() - before.momentum()).y;
            assert!(change.abs() <= ROUNDING * before.total_mass(), "{change}");
        });
        assert!(
            snaps >= 4 && corrected >= snaps,
            "hand {hand}: {snaps} snaps, {corrected}"
        );
    }
}

#[test]
fn edits_report_the_kinetic_energy_and_that_of_the_loads() {
    let mut body = moving(0.0, &[]);
    tear(&mut body, 0.3, |before, after, _, done| {
        let kinetic = after.kinetic_energy() - before.kinetic_energy();
        assert!((kinetic - done.kinetic).abs() <= ROUNDING * before.kinetic_energy());
        let potential = after.load_potential() - before.load_potential();
        assert!(
            (potential - done.potential).abs()
                <= ROUNDING * before.load_potential().abs().max(1e-3)
        );
    });
}

#[test]
fn opening_and_cutting_change_no_elastic_energy_and_no_place() {
    let mut body = moving(0.0, &[]);
    tear(&mut body, 0.0, |before, after, edit, done| {
        let (w0, w1) = (before.elastic_energy(), after.elastic_energy());
        assert!((w1 - w0).abs() <= ROUNDING * w0, "{edit:?}: {w0} {w1}");
        let old = before.node_positions();
        assert_eq!(&after.node_positions()[..old.len()], old);
        // A cut moves mass to a vertex between the ends of the edge: the lumped kinetic energy can only fall.
        assert!(done.kinetic <= 1e-15 + ROUNDING * before.kinetic_energy());
    });
}

#[test]
fn an_edited_body_is_the_body_of_its_triangles() {
    // A tear from a border doubles an end of each edge, so the lists of vertices describe the sheet.
    for bending in [0.0, 1.0] {
        let mut body = moving(bending, &[]);
        tear(&mut body, 0.3, |_, _, _, _| ());
        let surface = body.surface().expect("a surface");
        let mesh = TriMesh::new(body.rest_positions().to_vec(), surface.triangles().to_vec())
            .expect("a mesh");
        let mut fresh = Body::sheet(&mesh, &[MATERIAL], *body.config(), &[]).expect("a sheet");
        fresh
            .set_positions(body.node_positions())
            .expect("positions");
        fresh
            .set_velocities(body.node_velocities())
            .expect("velocities");
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs().max(b.abs());
        assert!(
            near(body.elastic_energy(), fresh.elastic_energy()),
            "{} {}",
            body.elastic_energy(),
            fresh.elastic_energy()
        );
        assert!(near(body.kinetic_energy(), fresh.kinetic_energy()));
        body.assemble();
        fresh.assemble();
        let largest = fresh
            .internal_forces()
            .map(|f| f.norm())
            .fold(0.0, f64::max);
        for (a, b) in body.internal_forces().zip(fresh.internal_forces()) {
            assert!((a - b).norm() <= 1e-9 * largest);
        }
    }
}

#[test]
fn a_tear_does_not_part_a_handle() {
    let mesh = cells();
    let held: Vec<u32> = in_box(
        &mesh,
        Vec3::new(-1.0, -1.0, -1.0),
        Vec3::new(1.0, -0.09, 1.0),
    );
    let handle = HandleSpec {
        vertices: held.clone(),
        origin: Vec3::zeros(),
        freedom: Freedom::Translation,
        border: Border::Hinged,
    };
    let mut body = moving(0.0, &[handle]);
    let surface = body.surface().expect("a surface");
    let tip = held[held.len() / 2];
    assert!(surface.on_border(tip));
    let edit = surface
        .advance(
            tip,
            surface.straight_ahead(tip),
            AdvanceOptions {
                snapping: 0.0,
                opening: 0.0,
            },
            |_| true,
        )
        .expect("an edit");
    let before = body.clone();
    assert_eq!(
        body.edit(&edit).unwrap_err(),
        TearingError::Held { vertex: tip }
    );
    assert_eq!(body.node_positions(), before.node_positions());
    assert_eq!(body.epoch(), before.epoch());
}

#[test]
fn a_reserve_that_is_used_up_is_an_error_and_nothing_changes() {
    let mut body = moving(0.0, &[]);
    let mut body = {
        body.make_tearable(Reserve {
            vertices: 3,
            triangles: 3,
        })
        .expect("tearable");
        body
    };
    let mut tips = 0;
    let surface = body.surface().expect("a surface");
    let mut tip = (0..surface.vertex_count() as u32)
        .find(|&v| surface.on_border(v))
        .expect("a border");
    let error = loop {
        let surface = body.surface().expect("a surface");
        let edit = surface
            .advance(
                tip,
                surface.straight_ahead(tip),
                AdvanceOptions {
                    snapping: 0.0,
                    opening: 0.0,
                },
                |_| true,
            )
            .expect("an edit");
        let before = (body.epoch(), body.node_positions().len(), body.total_mass());
        match body.edit(&edit) {
            Ok(done) => tip = done.surface.tips[0],
            Err(error) => {
                assert_eq!(
                    (body.epoch(), body.node_positions().len(), body.total_mass()),
                    before
                );
                break error;
            }
        }
        tips += 1;
        assert!(tips < 10);
    };
    assert!(error.is_full(), "{error}");
}

#[test]
fn bodies_that_cannot_tear_are_refused() {
    let mesh = physics::mesh::generate_box::solid_box([0.1; 3], [1; 3]).expect("a box");
    let rubber = physics::SolidMaterial {
        young: 1e5,
        poisson: 0.3,
        density: 1000.0,
    };
    let mut solid = Body::solid(
        &mesh,
        &[rubber],
        physics::SolidLaw::Corotational,
        BodyConfig::default(),
        &[],
    )
    .expect("a solid");
    let error = solid.make_tearable(Reserve::default()).unwrap_err();
    assert!(matches!(error, TearingError::Kind { .. }), "{error}");
}
