//! The elements of a sheet after random edits against those of a sheet that is built of the torn triangles.

use super::{Body, BodyConfig};
use crate::Vec3;
use crate::element::Torn;
use crate::element::parts::Divided;
use crate::element::precision::Precision;
use crate::lanes::{Node, to_node, to_vec};
use crate::linear::block_matrix::BlockMatrix;
use crate::material::{Material, Tangent};
use crate::mesh::TriMesh;
use crate::team::Alone;
use crate::topology::{AdvanceOptions, Reserve, Surface};

/// Cells along a side of the sheet.
const CELLS: u32 = 8;

const RESERVE: Reserve = Reserve {
    vertices: 200,
    triangles: 200,
};

struct Random(u64);

impl Random {
    /// A number from -1/2 to 1/2 (Knuth's linear congruential generator).
    fn number(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    }

    fn below(&mut self, count: usize) -> usize {
        (((self.number() + 0.5) * count as f64) as usize).min(count - 1)
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::from_fn(|_, _| self.number())
    }
}

/// A flat sheet of uneven triangles of about a centimetre.
fn mesh(random: &mut Random) -> TriMesh {
    let mut mesh = TriMesh::default();
    for n in 0..(CELLS + 1).pow(2) {
        let cell = Vec3::new(f64::from(n % (CELLS + 1)), f64::from(n / (CELLS + 1)), 0.0);
        let jitter = random.vector() * 0.3;
        let place = cell + Vec3::new(jitter.x, jitter.y, 0.0);
        mesh.positions.push(place * 0.01);
    }
    for j in 0..CELLS {
        for i in 0..CELLS {
            let a = j * (CELLS + 1) + i;
            let (b, c, d) = (a + 1, a + CELLS + 2, a + CELLS + 1);
            if (i + j) % 2 == 0 {
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                mesh.triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    mesh
}

fn body(mesh: &TriMesh, bending: f64) -> Body {
    let config = BodyConfig {
        bending,
        ..BodyConfig::default()
    };
    let rubber = Material {
        young: 1e6,
        poisson: 0.3,
        thickness: 1e-3,
        density: 1000.0,
    };
    Body::sheet(mesh, &[rubber], config, &[]).unwrap()
}

/// The place of a vertex in the order of the kernels: the first vertices in reverse.
fn places(vertices: usize) -> Vec<u32> {
    let first = (CELLS + 1).pow(2);
    let place = |v: u32| if v < first { first - 1 - v } else { v };
    (0..vertices as u32).map(place).collect()
}

fn by_place<V: Copy>(values: &[V], place: &[u32]) -> Vec<V> {
    let mut all = values.to_vec();
    for (&value, &place) in values.iter().zip(place) {
        all[place as usize] = value;
    }
    all
}

/// The sets of `body` as a stepper computes them, with room for edits.
fn kernels<T: Precision>(body: &Body) -> Vec<Divided<T>> {
    let place = places(body.state.x.len());
    let rest = by_place(&body.model.rest, &place);
    let mut set = body.model.elements[0].boxed();
    set.renumber(&place);
    // A matrix that couples nothing: the kernel is not assembled.
    let apart = BlockMatrix::new(rest.len(), rest.len(), core::iter::empty());
    let mut membrane = Divided::Whole(crate::element::kernel(set, &apart, &rest));
    membrane.tearable().unwrap().reserve(RESERVE.triangles);
    let mut all = vec![membrane];
    if let Some(bending) = &body.model.bending {
        let rows = body.assembly.places.nodes();
        let rank: Vec<u32> = rows.iter().map(|&node| place[node as usize]).collect();
        let kernel = bending.kernel::<T>(&rank, &rest);
        // A stepper has a second kernel with the same constant data.
        let mut bending = Divided::Whole(Box::new(kernel.clone()) as _);
        bending.tearable().unwrap().reserve(RESERVE.triangles);
        all.push(bending);
        drop(kernel);
    }
    all
}

/// One random edit: a tear grows from a vertex on the border, or a slit begins. Returns whether there was one.
fn edit(body: &mut Body, snapping: f64, random: &mut Random) -> bool {
    let surface = body.surface().unwrap();
    let tip = random.below(surface.vertex_count()) as u32;
    let angle = (random.number() + 0.5) * surface.total_angle(tip);
    let options = AdvanceOptions {
        snapping,
        opening: 0.0,
    };
    let grown = if surface.on_border(tip) {
        surface.advance(tip, angle, options, |_| true)
    } else {
        surface.begin_slit(tip, angle, options, |_| true)
    };
    grown.is_some_and(|edit| body.edit(&edit).is_ok())
}

fn torn_mesh(body: &Body) -> TriMesh {
    TriMesh {
        positions: body.model.rest.clone(),
        triangles: body.surface().unwrap().triangles().to_vec(),
        ..TriMesh::default()
    }
}

fn largest(values: &[Vec3]) -> f64 {
    values.iter().map(Vec3::amax).fold(0.0, f64::max)
}

fn near(found: &[Vec3], expected: &[Vec3], tolerance: f64, what: &str) {
    let errors = found.iter().zip(expected).map(|(a, b)| (a - b).amax());
    let (worst, size) = (errors.fold(0.0, f64::max), largest(expected));
    assert!(found.len() == expected.len() && size > 0.0, "{what}");
    assert!(worst <= tolerance * size, "{what}: {worst:e} of {size:e}");
}

/// Compares a torn body and its kernels with a body that is built of its triangles, in a random state.
fn compare<T: Precision>(
    torn: &Body,
    kernels: &mut [Divided<T>],
    (random, tolerance): (&mut Random, f64),
) {
    let mut fresh = body(&torn_mesh(torn), torn.model.config.bending);
    let rest = &torn.model.rest;
    let turn = nalgebra::Rotation3::from_euler_angles(0.4, -0.3, 0.8);
    let x: Vec<Vec3> = rest
        .iter()
        .map(|x| turn * (x + random.vector() * 1e-3))
        .collect();
    let u: Vec<Vec3> = rest.iter().map(|_| random.vector() * 1e-3).collect();
    let count = x.len();

    fresh.state.x.clone_from(&x);
    fresh.assemble_with(Tangent::Clipped);
    let expected = &fresh.assembly.internal;
    let product: Vec<Vec3> = (0..count)
        .map(|node| fresh.assembly.row_product(node, &u))
        .collect();
    let energy = fresh.elastic_energy_at(&x);
    let same_energy = |found: f64, what: &str| {
        let error = (found / energy - 1.0).abs();
        assert!(error < tolerance, "{what}: {error:e}");
    };

    // The exact form, in place and assembled anew.
    same_energy(torn.elastic_energy_at(&x), "energy");
    let set = &torn.model.elements[0];
    let sheet = set.tearable().unwrap();
    let density = |t: usize| {
        let state = sheet.strained(t, &x).unwrap();
        state.density * state.area * state.thickness
    };
    let by_state: f64 = (0..set.count()).map(density).sum();
    assert!((by_state / set.energy(&x) - 1.0).abs() < 1e-12);
    let mut again = torn.clone();
    again.assembly.stiffness = BlockMatrix::new(0, 0, core::iter::empty());
    again.reassemble();
    again.state.x.clone_from(&x);
    again.assemble_with(Tangent::Clipped);
    near(
        &again.assembly.internal,
        expected,
        tolerance,
        "forces of the body assembled anew",
    );

    // The kernels. The blocks of all triangles make up the whole matrix.
    let all: Vec<u32> = (0..set.count() as u32).collect();
    let place = places(count);
    let d: Vec<Vec3> = x.iter().zip(rest).map(|(x, rest)| x - rest).collect();
    let d: Vec<Node<T>> = by_place(&d, &place).iter().map(to_node).collect();
    let single: Vec<Node<T>> = by_place(&u, &place).iter().map(to_node).collect();
    let mut force = vec![[T::ZERO; 4]; count];
    let mut found = force.clone();
    let mut sum = 0.0;
    let mut local = vec![Vec3::zeros(); count];
    let u = by_place(&u, &place);
    for set in kernels {
        sum += set.linearize(&Alone, &d, &mut force);
        set.product(&Alone, T::of(1.0), &single, &mut found);
        let set = set.tearable().unwrap();
        set.local_stiffness(&all, &d, &mut |row, column, block| {
            local[row as usize] += block * u[column as usize];
        });
    }
    let vectors = |nodes: &[Node<T>]| nodes.iter().map(to_vec).collect::<Vec<Vec3>>();
    same_energy(sum, "energy of the kernels");
    near(
        &vectors(&force),
        &by_place(expected, &place),
        tolerance,
        "forces of the kernels",
    );
    near(
        &vectors(&found),
        &by_place(&product, &place),
        tolerance,
        "products of the kernels",
    );
    near(
        &local,
        &by_place(&product, &place),
        tolerance,
        "local stiffness of the kernels",
    );
}

fn follow_random_edits<T: Precision>(bending: f64, seed: u64, tolerance: f64) {
    let mut random = Random(seed);
    let mesh = mesh(&mut random);
    let mut torn = body(&mesh, bending);
    torn.make_tearable(RESERVE).unwrap();
    let mut kernels = kernels::<T>(&torn);
    let mut edits = 0;
    compare(&torn, &mut kernels, (&mut random, tolerance));
    for count in 0..120 {
        let snapping = [0.0, 0.35][count % 2];
        if !edit(&mut torn, snapping, &mut random) {
            continue;
        }
        edits += 1;
        let place = places(torn.state.x.len());
        let rest = by_place(&torn.model.rest, &place);
        let edit = Torn {
            surface: torn.surface().unwrap(),
            place: Some(&place),
            rest: &rest,
        };
        for set in &mut kernels {
            set.tearable().unwrap().follow(&edit);
        }
        if edits % 4 == 0 {
            compare(&torn, &mut kernels, (&mut random, tolerance));
        }
    }
    let added = torn.surface().unwrap().triangle_count() - mesh.triangles.len();
    println!("bending {bending}: {edits} edits, {added} triangles added");
    assert!(
        edits >= 20 && added >= 10,
        "{edits} edits, {added} triangles"
    );
}

/// Rounding errors of some hundred operations. The weights of bending are solutions of small systems of equations, which
/// lose up to four digits if vertices are near a conic.
#[test]
fn a_torn_sheet_has_the_forces_of_a_sheet_built_of_its_triangles() {
    for seed in [1, 2, 3] {
        follow_random_edits::<f64>(0.0, seed, 1e-10);
        follow_random_edits::<f64>(1.0, seed, 1e-8);
    }
    follow_random_edits::<f32>(1.0, 4, 2e-3);
}

/// A cut leaves the strain of each part what it was, and an opened edge the triangles. The tolerance is the rounding of
/// the shapes.
#[test]
fn opening_and_cutting_change_no_energy_of_the_plane() {
    let mut random = Random(5);
    let mut torn = body(&mesh(&mut random), 0.0);
    torn.make_tearable(RESERVE).unwrap();
    for x in &mut torn.state.x {
        *x += random.vector() * 1e-3;
    }
    let energy = |torn: &Body| torn.model.elements[0].energy(&torn.state.x);
    let before = energy(&torn);
    let mut edits = 0;
    for _ in 0..120 {
        edits += usize::from(edit(&mut torn, 0.0, &mut random));
        let error = (energy(&torn) / before - 1.0).abs();
        assert!(error < 1e-12, "{edits} edits: {error:e}");
    }
    assert!(edits > 20);
}

/// The edits leave the vectors of bending where they are in memory.
#[test]
fn bending_follows_within_its_room() {
    let mut random = Random(6);
    let mut torn = body(&mesh(&mut random), 1.0);
    torn.make_tearable(RESERVE).unwrap();
    let copy = |torn: &Body| torn.model.bending.clone().unwrap();
    let mut bending = copy(&torn);
    let places = |bending: &crate::element::bending::Bending| bending.addresses();
    let before = places(&bending);
    for _ in 0..120 {
        if edit(&mut torn, 0.35, &mut random) {
            let surface: &Surface = torn.surface().unwrap();
            let (rows, rest) = (&torn.assembly.places, &torn.model.rest);
            let edit = Torn {
                surface,
                place: Some(rows.of_nodes()),
                rest,
            };
            let nodes = rows.nodes();
            bending.follow(&edit, &|row| rest[nodes[row as usize] as usize]);
        }
    }
    assert_eq!(places(&bending), before);
}
