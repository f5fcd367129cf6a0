//! Sets of elements that follow the edits of a torn surface: energy and forces across edits, and no allocation.

use alloc_count::calls::count;
use physics::mesh::TriMesh;
use physics::mesh::generate::{Pattern, sheet};
use physics::topology::{AdvanceOptions, Reserve, Surface};
use physics::{Body, BodyConfig, Material, Vec3};

const RESERVE: Reserve = Reserve {
    vertices: 200,
    triangles: 200,
};

fn cells() -> TriMesh {
    sheet(0.2, 0.2, 12, 12, Pattern::Alternating).expect("a sheet")
}

fn rubber(bending: f64) -> Body {
    let material = Material {
        young: 1e6,
        poisson: 0.3,
        thickness: 1e-3,
        density: 1000.0,
    };
    let config = BodyConfig {
        bending,
        ..BodyConfig::default()
    };
    Body::sheet(&cells(), &[material], config, &[]).expect("a sheet")
}

/// A vertex on the border, in the middle of a side.
fn notch_root(surface: &Surface, x: &[Vec3]) -> u32 {
    (0..surface.vertex_count() as u32)
        .find(|&v| {
            let x = x[v as usize];
            surface.on_border(v) && x.x.abs() < 0.02 && x.y < -0.09
        })
        .expect("a vertex of the lower border")
}

/// Tears `body` in a wavy line, and calls `look` before and after each edit. The edits allocate nothing.
fn tear(body: &mut Body, snapping: f64, mut look: impl FnMut(f64, &Body)) -> usize {
    let mut tip = notch_root(body.surface().expect("a surface"), body.node_positions());
    let mut edits = 0;
    for step in 0..12 {
        let surface = body.surface().expect("a surface");
        let angle = surface.straight_ahead(tip) + 0.6 * libm::sin(f64::from(step));
        let options = AdvanceOptions {
            snapping,
            opening: 0.0,
        };
        let Some(edit) = surface.advance(tip, angle, options, |_| true) else {
            break;
        };
        let before = body.elastic_energy();
        let mut done = None;
        let calls = count(|| done = body.edit(&edit).ok());
        assert_eq!(calls, 0, "edit {step}: {edit:?}");
        look(before, body);
        edits += 1;
        tip = done.expect("an edit").surface.tips[0];
        if tip == physics::topology::NONE {
            break;
        }
    }
    edits
}

fn wave(body: &mut Body, height: f64) {
    let wave = |i: usize, k: f64| libm::sin(k * i as f64 + k);
    let x: Vec<Vec3> = (body.node_positions().iter().enumerate())
        .map(|(i, x)| x + Vec3::new(wave(i, 1.7), wave(i, 2.9), height * wave(i, 0.7)) * 2e-4)
        .collect();
    body.set_positions(&x).expect("positions");
}

#[test]
fn edits_of_sheets_that_bend_allocate_nothing() {
    for mut body in [rubber(1.0), rubber(0.0)] {
        wave(&mut body, 5.0);
        body.make_tearable(RESERVE).expect("tearable");
        let edits = tear(&mut body, 0.35, |_, _| {});
        assert!(edits > 6, "{edits} edits");
    }
}

/// The tolerance is the rounding of the shapes of the parts.
#[test]
fn opening_and_cutting_keep_the_energy_of_a_membrane() {
    let mut body = rubber(0.0);
    wave(&mut body, 5.0);
    body.make_tearable(RESERVE).expect("tearable");
    let edits = tear(&mut body, 0.0, |before, body| {
        let after = body.elastic_energy();
        assert!((after / before - 1.0).abs() < 1e-12, "{before:e} {after:e}");
    });
    assert!(edits > 6, "{edits} edits");
}
