//! Bending compared with plate theory: a cylinder, a saddle and a cap, affine maps, which must not bend the sheet, and
//! deflections on many kinds of mesh.

use common::*;
use physics::body::load::spread_on_sheet;
use physics::mesh::TriMesh;
use physics::{
    Body, BodyConfig, BodyError, Equilibrium, EquilibriumOptions, Material, Rigidity, SheetLawName,
    Vec3, Weave,
};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

fn sheet(mesh: &TriMesh, material: Material) -> Body {
    Body::sheet(
        mesh,
        &[material],
        BodyConfig {
            bending: 1.0,
            ..tight()
        },
        &[],
    )
    .unwrap()
}

fn bending_energy(mesh: &TriMesh, material: Material, shape: impl Fn(&Vec3) -> Vec3) -> f64 {
    let mut sheet = sheet(mesh, material);
    sheet
        .set_positions(&mesh.positions.iter().map(shape).collect::<Vec<_>>())
        .unwrap();
    sheet.bending_energy()
}

/// Rolls the plane onto a cylinder whose axis lies at `angle` to y.
fn roll(x: &Vec3, radius: f64, angle: f64) -> Vec3 {
    let across = x.x * angle.cos() + x.y * angle.sin();
    let along = -x.x * angle.sin() + x.y * angle.cos();
    let turn = across / radius;
    Vec3::new(radius * turn.sin(), along, radius * (1.0 - turn.cos()))
}

/// The energy over the exact energy, less 1, for three meshes. Each mesh is twice as fine as the one before.
fn errors(
    mesh: impl Fn(u32) -> TriMesh,
    exact: f64,
    material: Material,
    shape: impl Fn(&Vec3) -> Vec3,
) -> [f64; 3] {
    [4, 8, 16].map(|cells| bending_energy(&mesh(cells), material, &shape) / exact - 1.0)
}

/// Meshes of a rectangle with every pattern of diagonals, and an irregular mesh.
fn meshes(lx: f64, ly: f64) -> Vec<Box<dyn Fn(u32) -> TriMesh>> {
    let mut meshes: Vec<Box<dyn Fn(u32) -> TriMesh>> = Vec::new();
    for split in [
        Split::Right,
        Split::Left,
        Split::Alternating,
        Split::Crossed,
    ] {
        meshes.push(Box::new(move |cells| {
            grid(4 * cells, 3 * cells, lx, ly, split)
        }));
    }
    meshes.push(Box::new(move |cells| {
        irregular(4 * cells, 3 * cells, lx, ly, 0.25, 17)
    }));
    meshes
}

/// The moment about the border is zero, so the strip of triangles along the border stores less energy. This error is of
/// the order of a grid cell over the width, 1/64 and 1/48 on both sides of the finest mesh, and halves with every
/// refinement, to within a thousandth on irregular meshes.
fn assert_convergent(errors: [f64; 3]) {
    assert!(errors[2].abs() < 0.03, "{errors:?}");
    assert!(
        errors[2].abs() < 0.55 * errors[1].abs() + 1e-3,
        "{errors:?}"
    );
    assert!(
        errors[1].abs() < 0.55 * errors[0].abs() + 1e-3,
        "{errors:?}"
    );
}

#[test]
fn a_cylinder_stores_half_the_rigidity_times_area_over_radius_squared() {
    let (lx, ly, radius) = (0.2, 0.15, 0.5);
    let material = rubber(0.3);
    let exact = 0.5 * material.bending_rigidity() * lx * ly / (radius * radius);
    for mesh in meshes(lx, ly) {
        for angle in [0.0, 0.5, FRAC_PI_4, FRAC_PI_2, 2.2] {
            assert_convergent(errors(&mesh, exact, material, |x| roll(x, radius, angle)));
        }
    }
}

#[test]
fn a_cap_and_a_saddle_store_the_energy_of_kirchhoff_s_plate() {
    let (lx, ly, curvature) = (0.2, 0.15, 0.1);
    let material = rubber(0.3);
    for (xx, xy, yy) in [
        (1.0, 0.0, 1.0),
        (1.0, 0.0, -1.0),
        (0.0, 1.0, 0.0),
        (1.0, 0.0, 0.0),
    ] {
        let square = xx * xx + 2.0 * xy * xy + yy * yy;
        let density = (1.0 - material.poisson) * square + material.poisson * (xx + yy) * (xx + yy);
        let exact = 0.5 * material.bending_rigidity() * curvature * curvature * density * lx * ly;
        // The model is quadratic in the positions, so the energy of a graph over the plane is exact at any height.
        let shape = |x: &Vec3| {
            let q = 0.5 * xx * x.x * x.x + xy * x.x * x.y + 0.5 * yy * x.y * x.y;
            Vec3::new(x.x, x.y, curvature * q)
        };
        for mesh in meshes(lx, ly) {
            assert_convergent(errors(mesh, exact, material, shape));
        }
    }
}

#[test]
fn no_affine_map_bends() {
    let mesh = irregular(8, 6, 0.2, 0.15, 0.25, 23);
    let material = rubber(0.3);
    let tilt = nalgebra::Rotation3::from_euler_angles(0.4, -1.0, 2.0);
    let map = in_plane(1.5, 0.4, -0.3, 0.7);
    let shift = Vec3::new(0.5, -0.4, 0.3);
    let energy = bending_energy(&mesh, material, |x| tilt * (map * x) + shift);
    // For comparison, the sheet is rolled to a radius of its own length. The energy is a sum of terms of both signs of
    // the size D / h^2 times h^2, with 16 digits. Its error is D times the number of blocks times 1e-16.
    let rolled = bending_energy(&mesh, material, |x| roll(x, 0.2, 0.3));
    assert!(energy.abs() < 1e-12 * rolled, "{energy:e} {rolled:e}");
}

/// A sheet that is rolled, saddled or folded at rest, with its vertices at rest and displaced.
fn curved(seed: u64) -> (TriMesh, Vec<Vec3>) {
    let mut mesh = irregular(6, 5, 0.3, 0.25, 0.2, seed);
    for x in &mut mesh.positions {
        let rolled = roll(x, 0.15, 0.4);
        *x = rolled + Vec3::z() * (2.0 * x.x * x.y + 0.3 * (x.x - 0.1).max(0.0));
    }
    let mut random = Random(seed);
    let moved = mesh.positions.iter();
    let moved = moved.map(|x| x + random.vector() * 0.005).collect();
    (mesh, moved)
}

#[test]
fn a_sheet_that_is_curved_at_rest_is_at_rest_there_in_every_orientation() {
    let material = rubber(0.3);
    let tilt = nalgebra::Rotation3::from_euler_angles(0.4, -1.0, 2.0);
    for seed in [41, 42, 43] {
        let (mesh, moved) = curved(seed);
        let mut body = sheet(&mesh, material);
        let scale = bending_energy(&mesh, material, |x| Vec3::new(x.x, x.y, 0.0));
        // Rounding errors remain, whose squares are 1e-30 of the square of the curvature at rest.
        assert!(body.bending_energy() < 1e-24 * scale);
        assert!(bending_energy(&mesh, material, |x| tilt * x + Vec3::x()) < 1e-24 * scale);
        body.set_positions(&moved).unwrap();
        let energy = body.bending_energy();
        let turned: Vec<Vec3> = moved.iter().map(|x| tilt * x).collect();
        body.set_positions(&turned).unwrap();
        assert!((body.bending_energy() / energy - 1.0).abs() < 1e-12);
    }
}

#[test]
fn no_displacement_in_the_plane_feels_the_bending() {
    let mesh = irregular(8, 6, 0.2, 0.15, 0.25, 23);
    let mut random = Random(3);
    let moved = mesh.positions.iter();
    let moved: Vec<Vec3> = moved
        .map(|x| {
            let by = random.vector() * 0.005;
            x + Vec3::new(by.x, by.y, 0.0)
        })
        .collect();
    let forces = |bending| {
        let config = BodyConfig { bending, ..tight() };
        let mut body = Body::sheet(&mesh, &[rubber(0.3)], config, &[]).unwrap();
        body.set_positions(&moved).unwrap();
        body.assemble();
        body.internal_forces().collect::<Vec<_>>()
    };
    // Any displacement in the plane, not only an affine one: slopes across edges are zero to the last bit.
    assert_eq!(forces(0.0), forces(1e3));
}

#[test]
fn any_orientation_bends_alike_and_three_triangles_at_an_edge_are_refused() {
    let mesh = grid(3, 2, 1.0, 1.0, Split::Right);
    let mut turned = mesh.clone();
    for triangle in turned.triangles.iter_mut().step_by(2) {
        triangle.swap(1, 2);
    }
    let energy = |mesh: &TriMesh| bending_energy(mesh, rubber(0.3), |x| roll(x, 1.0, 0.3));
    // The sums have the same terms in another order.
    assert!((energy(&mesh) / energy(&turned) - 1.0).abs() < 1e-12);

    let mut fin = mesh.clone();
    fin.positions.push(Vec3::new(0.1, 0.2, 1.0));
    fin.triangles.push([0, 5, 12]);
    let config = BodyConfig {
        bending: 1.0,
        ..tight()
    };
    let result = Body::sheet(&fin, &[rubber(0.3)], config, &[]).map(|_| ());
    assert_eq!(
        result,
        Err(BodyError::NonManifold {
            a: 0,
            b: 5,
            count: 3
        })
    );
    assert!(Body::sheet(&fin, &[rubber(0.3)], tight(), &[]).is_ok());
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn a_sheet_with_bending_pulls_down_the_gradient_of_its_energy(seed in any::<u64>()) {
        let mesh = irregular(4, 3, 0.4, 0.3, 0.25, 29);
        // The sheet is thick, so that bending matters.
        let mut sheet = sheet(&mesh, Material { thickness: 0.05, ..rubber(0.3) });
        let mut random = Random(seed);
        let x: Vec<Vec3> = mesh.positions.iter().map(|x| x + random.vector() * 0.03).collect();
        let direction: Vec<Vec3> = mesh.positions.iter().map(|_| random.vector()).collect();
        sheet.set_positions(&x).unwrap();
        // The energy is a sum of squares, so it is never negative.
        prop_assert!(sheet.bending_energy() > 0.0);
        sheet.assemble();
        let slope: f64 = sheet.internal_forces().zip(&direction).map(|(f, direction)| -f.dot(direction)).sum();
        let scale = largest(sheet.internal_forces());
        // Random positions nearly collapse a triangle now and then, and its angles then change within some 1e-4 m: central
        // differences of steps of 1e-6 m miss the slope there by 2e-4. Two steps of 1e-7 and 2e-7 m cancel the error of
        // second order (Richardson); their rounding error is below 1e-7 of the scale.
        let step = 1e-7;
        let mut energy = |by: f64| {
            let x: Vec<Vec3> = x.iter().zip(&direction).map(|(x, direction)| x + direction * by).collect();
            sheet.set_positions(&x).unwrap();
            sheet.elastic_energy()
        };
        let mut central = |step: f64| (energy(step) - energy(-step)) / (2.0 * step);
        let difference = (4.0 * central(step) - central(2.0 * step)) / 3.0;
        prop_assert!((slope - difference).abs() < 1e-6 * scale, "{slope} {difference}");
    }
}

/// The deflection of the middle of a square plate under pressure, whose border is clamped or supported and free to rotate,
/// over that of the theory of thin plates (S. P. Timoshenko and S. Woinowsky-Krieger, "Theory of plates and shells",
/// tables 8 and 35).
fn plate(mesh: &TriMesh, side: f64, clamped: bool) -> f64 {
    let material = rubber(0.3);
    let config = BodyConfig {
        bending: 1.0,
        ..tight()
    };
    let mut body = Body::sheet(mesh, &[material], config, &[]).unwrap();
    let all: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let chosen = |holds: &dyn Fn(&Vec3) -> bool| -> Vec<u32> {
        let vertices = all.iter().copied();
        vertices
            .filter(|&vertex| holds(&mesh.positions[vertex as usize]))
            .collect()
    };
    let border = |x: &Vec3| {
        let inside = |c: f64| c > 1e-9 && c < side - 1e-9;
        !(inside(x.x) && inside(x.y))
    };
    body.add_support(&all, [true, true, false]).unwrap();
    let factor = if clamped {
        body.add_clamp(&chosen(&border)).unwrap();
        0.001_265_319
    } else {
        body.add_support(&chosen(&border), [false, false, true])
            .unwrap();
        0.004_062_353
    };
    // Small against the thickness: the sheet is nonlinear, and its error grows with the square.
    let deflection = 1e-4 * material.thickness;
    let pressure = deflection * material.bending_rigidity() / (factor * side.powi(4));
    let mut forces = vec![Vec3::zeros(); mesh.positions.len()];
    for (number, triangle) in (0_u32..).zip(&mesh.triangles) {
        for &vertex in triangle {
            forces[vertex as usize].z += pressure * mesh.triangle_area(number).unwrap() / 3.0;
        }
    }
    body.set_external_forces(&forces).unwrap();
    Equilibrium::new(&body, EquilibriumOptions::default())
        .unwrap()
        .solve(&mut body, &[], 1.0)
        .unwrap();
    middle(mesh, side, body.node_positions()) / deflection
}

/// The height of the middle of a square, whose vertices are at `x` now: of the vertex there, or else of the polynomial of
/// even fourth powers that fits the vertices nearby best.
fn middle(mesh: &TriMesh, side: f64, x: &[Vec3]) -> f64 {
    const TERMS: usize = 9;
    let centre = Vec3::new(0.5 * side, 0.5 * side, 0.0);
    let from_centre = |x: &Vec3| *x - centre;
    if let Some(vertex) = mesh
        .positions
        .iter()
        .position(|x| from_centre(x).norm() < 1e-9)
    {
        return x[vertex].z;
    }
    let size = side * (2.0 / mesh.triangles.len() as f64).sqrt();
    let (mut normal, mut right) = (
        nalgebra::SMatrix::<f64, TERMS, TERMS>::zeros(),
        nalgebra::SVector::<f64, TERMS>::zeros(),
    );
    for (start, now) in mesh.positions.iter().zip(x) {
        let at = from_centre(start) / size;
        if at.norm() > 3.2 {
            continue;
        }
        let (p, q) = (at.x * at.x, at.y * at.y);
        let terms = [1.0, at.x, at.y, p, at.x * at.y, q, p * p, q * q, p * q];
        let terms = nalgebra::SVector::from(terms);
        normal += terms * terms.transpose();
        right += terms * now.z;
    }
    normal.cholesky().unwrap().solve(&right)[0]
}

/// The algorithms of Gmsh that made meshes of the folder `meshes`.
const GMSH: [&str; 3] = ["frontal", "delaunay", "meshadapt"];

/// A square of this side from the folder `meshes`.
fn from_file(name: &str, cells: u32, side: f64) -> TriMesh {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/meshes");
    let text = std::fs::read_to_string(format!("{folder}/{name}_{cells}.obj")).unwrap();
    let mut mesh = TriMesh::default();
    for line in text.lines() {
        let mut words = line.split(' ');
        match words.next() {
            Some("v") => {
                let at: Vec<f64> = words.map(|word| word.parse().unwrap()).collect();
                mesh.positions.push(Vec3::new(at[0], at[1], at[2]) * side);
            }
            Some("f") => {
                let named: Vec<u32> = words.map(|word| word.parse().unwrap()).collect();
                mesh.triangles
                    .push([named[0] - 1, named[1] - 1, named[2] - 1]);
            }
            _ => panic!("{line}"),
        }
    }
    mesh.validate().unwrap();
    mesh
}

/// A square whose diagonals are chosen by chance, with its inner vertices moved by up to `by` of a cell; the middle one
/// stays.
fn random(cells: u32, side: f64, by: f64, seed: u64) -> TriMesh {
    let mut mesh = grid(cells, cells, side, side, Split::Right);
    let mut random = Random(seed);
    for cell in 0..(cells * cells) as usize {
        if random.signed() < 0.0 {
            // The grid cuts a cell from its first to its third corner.
            let [[a, b, c], [_, _, d]] = [mesh.triangles[2 * cell], mesh.triangles[2 * cell + 1]];
            mesh.triangles[2 * cell] = [a, b, d];
            mesh.triangles[2 * cell + 1] = [b, c, d];
        }
    }
    let size = side / f64::from(cells);
    let middle = Vec3::new(0.5 * side, 0.5 * side, 0.0);
    for x in &mut mesh.positions {
        let inside = |c: f64| c > 0.5 * size && c < side - 0.5 * size;
        let moved = Vec3::new(random.signed(), random.signed(), 0.0) * (by * size);
        if inside(x.x) && inside(x.y) && (*x - middle).norm() > 0.5 * size {
            *x += moved;
        }
    }
    mesh
}

/// A kind of mesh: its name, and the mesh of a number of cells a side.
type Kind = (&'static str, Box<dyn Fn(u32) -> TriMesh>);

fn kinds(side: f64) -> Vec<Kind> {
    let mut kinds: Vec<Kind> = Vec::new();
    for (name, split) in [
        ("parallel", Split::Right),
        ("alternating", Split::Alternating),
        ("crossed", Split::Crossed),
    ] {
        kinds.push((name, Box::new(move |n| grid(n, n, side, side, split))));
    }
    for (name, by) in [
        ("random", 0.0),
        ("moved by 20 %", 0.2),
        ("moved by 30 %", 0.3),
    ] {
        kinds.push((name, Box::new(move |n| random(n, side, by, 31))));
    }
    for name in GMSH {
        kinds.push((name, Box::new(move |n| from_file(name, n, side))));
    }
    kinds
}

#[test]
fn a_supported_plate_converges_to_the_theory_on_any_mesh() {
    let side = 0.1;
    for (name, mesh) in kinds(side) {
        let [coarse, fine] = [8, 16].map(|cells| plate(&mesh(cells), side, false) - 1.0);
        // The clamped plate of `palpate bench accuracy` shows the order. Random meshes of two sizes are unrelated, and
        // their errors differ by some thousandths.
        assert!(fine.abs() < 0.01, "{name}: {fine}");
        let other = if name == "parallel" { 1e-3 } else { 5e-3 };
        assert!(
            fine.abs() < 0.35 * coarse.abs() + other,
            "{name}: {fine} after {coarse}"
        );
    }
}

/// The strip of half a cell inside the clamp has the curvature of its middle, so that the error is larger than that of the
/// supported plate; it also falls with the square of the size of the cells.
#[test]
fn a_clamped_plate_converges_to_the_theory_on_any_mesh() {
    let side = 0.1;
    for (name, mesh) in kinds(side) {
        let [coarse, fine] = [8, 16].map(|cells| plate(&mesh(cells), side, true) - 1.0);
        assert!(fine.abs() < 0.06, "{name}: {fine}");
        assert!(
            fine.abs() < 0.3 * coarse.abs() + 5e-3,
            "{name}: {fine} after {coarse}"
        );
    }
}

/// Triangulations of random points have angles down to 13 degrees and vertices of four to eleven triangles, so the errors are
/// larger than on other meshes. They fall as fast.
#[test]
fn plates_of_random_points_converge_to_the_theory() {
    let side = 0.1;
    for (clamped, most) in [(false, 0.008), (true, 0.02)] {
        let errors = [8, 16, 32].map(|cells| {
            let mesh = from_file("random_points", cells, side);
            (plate(&mesh, side, clamped) - 1.0).abs()
        });
        assert!(errors[2] < most, "{errors:?}");
        assert!(errors[2] < 0.4 * errors[1], "{errors:?}");
        assert!(errors[1] < 0.6 * errors[0], "{errors:?}");
    }
}

/// A square that is clamped on one side and loaded on the opposite one. Without Poisson's ratio it is a beam.
#[test]
fn a_cantilever_of_gmsh_s_triangles_bends_like_a_beam() {
    let side = 0.1;
    let material = rubber(0.0);
    let error = |mesh: &TriMesh| {
        let config = BodyConfig {
            bending: 1.0,
            ..tight()
        };
        let mut body = Body::sheet(mesh, &[material], config, &[]).unwrap();
        let on = |place: f64| -> Vec<u32> {
            let vertices = (0_u32..).zip(&mesh.positions);
            let near = vertices.filter(|(_, x)| (x.x - place).abs() < 1e-9);
            near.map(|(vertex, _)| vertex).collect()
        };
        body.add_clamp(&on(0.0)).unwrap();
        let deflection = 1e-4 * material.thickness;
        let force = 3.0 * material.bending_rigidity() * deflection / (side * side);
        let tip = spread_on_sheet(mesh, &on(side)).fractions;
        let forces: Vec<Vec3> = tip.iter().map(|f| Vec3::z() * (force * f)).collect();
        body.set_external_forces(&forces).unwrap();
        Equilibrium::new(&body, EquilibriumOptions::default())
            .unwrap()
            .solve(&mut body, &[], 1.0)
            .unwrap();
        let mean: f64 = body.positions().zip(&tip).map(|(x, f)| x.z * f).sum();
        mean / deflection - 1.0
    };
    for name in GMSH.into_iter().chain(["random_points"]) {
        let [coarse, fine] = [8, 16].map(|cells| error(&from_file(name, cells, side)));
        assert!(fine.abs() < 0.003, "{name}: {fine}");
        assert!(
            fine.abs() < 0.35 * coarse.abs(),
            "{name}: {fine} after {coarse}"
        );
    }
}

/// A cloth whose warp is at `angle` to x.
fn cloth(angle: f64) -> Weave {
    Weave {
        warp: Vec3::new(angle.cos(), angle.sin(), 0.3),
        young_warp: 4e5,
        young_weft: 1e5,
        poisson: 0.2,
        shear: 2e4,
        thickness: 1e-3,
        density: 300.0,
        rigidity: Rigidity {
            warp: 5e-6,
            weft: 2e-6,
            twist: 7e-7,
        },
    }
}

#[test]
fn a_rolled_cloth_stores_the_energy_of_its_warp_weft_and_twist() {
    let (lx, ly, radius) = (0.2, 0.15, 0.5);
    let energy = |mesh: &TriMesh, warp: f64, axis: f64| {
        let config = BodyConfig {
            bending: 1.0,
            ..tight()
        };
        let law = SheetLawName::Corotational;
        let mut body = Body::woven(mesh, &[cloth(warp)], law, config, &[]).unwrap();
        let rolled = mesh.positions.iter().map(|x| roll(x, radius, axis));
        body.set_positions(&rolled.collect::<Vec<_>>()).unwrap();
        body.bending_energy()
    };
    for (warp, axis) in [(0.0, 0.0), (0.0, FRAC_PI_2), (0.7, 0.1), (-2.0, 0.8)] {
        let (c, s): (f64, f64) = ((axis - warp).cos(), (axis - warp).sin());
        let Rigidity {
            warp: a,
            weft: b,
            twist: t,
        } = cloth(warp).rigidity;
        let rigidity = a * c.powi(4) + b * s.powi(4) + t * (2.0 * s * c).powi(2);
        let exact = 0.5 * rigidity * lx * ly / (radius * radius);
        for mesh in meshes(lx, ly) {
            assert_convergent(
                [4, 8, 16].map(|cells| energy(&mesh(cells), warp, axis) / exact - 1.0),
            );
        }
    }
}

/// The stress on the faces of a cylinder is `E t / (2 R (1 - nu^2))` around it, times Poisson's ratio along it. The inner
/// face is compressed.
#[test]
fn the_faces_of_a_rolled_sheet_have_the_stress_of_its_moment() {
    let (material, radius, angle) = (rubber(0.3), 0.5, 0.4);
    for mesh in meshes(0.2, 0.15) {
        let mesh = mesh(12);
        let mut body = sheet(&mesh, material);
        let rolled: Vec<Vec3> = mesh
            .positions
            .iter()
            .map(|x| roll(x, radius, angle))
            .collect();
        body.set_positions(&rolled).unwrap();
        let expected = material.young * material.thickness
            / (2.0 * radius * (1.0 - material.poisson * material.poisson));
        for (element, triangle) in mesh.triangles.iter().enumerate() {
            let corners = triangle.map(|v| mesh.positions[v as usize]);
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            // The moment vanishes at the border.
            if middle.x < 0.02 || middle.x > 0.18 || middle.y < 0.02 || middle.y > 0.13 {
                continue;
            }
            let [a, b, c] = triangle.map(|v| rolled[v as usize]);
            let up = (b - a).cross(&(c - a)).z.signum();
            let turn = (middle.x * angle.cos() + middle.y * angle.sin()) / radius;
            let around = Vec3::new(turn.cos(), 0.0, turn.sin());
            // The roll turns the direction along the axis to y.
            let along = Vec3::y();
            let stress = body.bending_stress(element) * up;
            // The normal of a triangle differs from that of the cylinder by an angle of half a cell over the radius, and
            // a patch sees a tenth of that in the curvature.
            let near =
                |found: f64, expected_here: f64| (found - expected_here).abs() < 0.03 * expected;
            assert!(near(around.dot(&(stress * around)), -expected), "{element}");
            assert!(
                near(along.dot(&(stress * along)), -0.3 * expected),
                "{element}"
            );
            assert!(near(along.dot(&(stress * around)), 0.0), "{element}");
        }
    }
}

/// The elastica: a cantilever under a force at its tip that keeps its direction (K. Mattiasson, "Numerical results from
/// large deflection beam and frame problems analysed by means of elliptic integrals", 1981, table 1).
#[test]
fn a_cantilever_bends_like_the_elastica_on_any_mesh() {
    let (length, cells) = (0.1, 50);
    let width = 4.0 * length / f64::from(cells);
    let mut kinds: Vec<TriMesh> = [Split::Right, Split::Alternating, Split::Crossed]
        .map(|split| grid(cells, 4, length, width, split))
        .to_vec();
    for seed in [51, 52, 53] {
        kinds.push(irregular(cells, 4, length, width, 0.2, seed));
    }
    // Thin, so that the stretch of the sheet is below a thousandth of the deflection, and without Poisson's ratio, so
    // that a strip is a beam.
    let material = Material {
        thickness: 1e-3,
        ..rubber(0.0)
    };
    let start = length / f64::from(cells);
    for mut mesh in kinds {
        // The first column of cells is held whole and is therefore a clamp. The beam begins where it ends.
        for x in &mut mesh.positions {
            if (x.x - start).abs() < 0.3 * start {
                x.x = start;
            }
        }
        let config = BodyConfig {
            bending: 1.0,
            ..tight()
        };
        let near = |x: f64, place: f64| (x - place).abs() < 1e-9;
        let column = |low: f64, high: f64| -> Vec<u32> {
            let vertices = (0_u32..).zip(&mesh.positions);
            let inside = vertices.filter(|(_, x)| x.x > low - 1e-9 && x.x < high + 1e-9);
            inside.map(|(vertex, _)| vertex).collect()
        };
        let mut body = Body::sheet(&mesh, &[material], config, &[]).unwrap();
        body.add_support(&column(0.0, start), [true; 3]).unwrap();
        let tip = column(length, length);
        let beam = length - start;
        let force = 10.0 * material.bending_rigidity() * width / (beam * beam);
        let mut forces = vec![Vec3::zeros(); mesh.positions.len()];
        for &vertex in &tip {
            let y = mesh.positions[vertex as usize].y;
            let at_end = near(y, 0.0) || near(y, width);
            forces[vertex as usize].z = force * if at_end { 0.125 } else { 0.25 };
        }
        body.set_external_forces(&forces).unwrap();
        let mut solver = Equilibrium::new(&body, EquilibriumOptions::default()).unwrap();
        for part in 1..=8 {
            solver.solve(&mut body, &[], f64::from(part) / 8.0).unwrap();
        }
        let moved = tip
            .iter()
            .map(|&v| body.node_positions()[v as usize] - mesh.positions[v as usize]);
        let mean = moved.sum::<Vec3>() / tip.len() as f64;
        let (down, back) = (mean.z / beam, -mean.x / beam);
        assert!((down / 0.810_61 - 1.0).abs() < 0.005, "{down}");
        assert!((back / 0.555_00 - 1.0).abs() < 0.005, "{back}");
    }
}
