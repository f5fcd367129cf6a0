//! The compliance of points of a surface is the inverse of the stiffness to which a body condenses onto them.

use nalgebra::{SMatrix, SVector};
use physics::mesh::generate_box::solid_box;
use physics::mesh::{Cells, TetMesh};
use physics::{
    Body, BodyConfig, Border, Condenser, Footprint, Freedom, HandlePose, HandleSpec, Held, Mat3,
    ShapeOptions, SiteCompliance, SolidLaw, SolidMaterial, Stepper, StepperOptions, Vec3,
    resultant,
};

const PERIOD: f64 = 1.0 / 60.0;
/// The stiffness or the compliance of four points.
type Matrix = SMatrix<f64, 12, 12>;

fn mesh() -> TetMesh {
    solid_box([0.06, 0.06, 0.03], [4, 4, 2]).unwrap()
}

/// The vertices of the upper side, or of the lower one if `sign` is negative.
fn side(mesh: &TetMesh, sign: f64) -> Vec<u32> {
    let most = mesh
        .positions
        .iter()
        .map(|x| sign * x.z)
        .fold(f64::MIN, f64::max);
    let numbered = (0_u32..).zip(&mesh.positions);
    let here = numbered.filter(|(_, x)| sign * x.z > most - 1e-9);
    here.map(|(vertex, _)| vertex).collect()
}

fn spec(vertices: Vec<u32>, origin: Vec3, freedom: Freedom) -> HandleSpec {
    HandleSpec {
        vertices,
        origin,
        freedom,
        border: Border::Hinged,
    }
}

/// A soft block that is held below, or a stiff one that is loose, without weight and with a handle at each of these vertices.
fn block(mesh: &TetMesh, is_held: bool, handles: &[u32]) -> Body {
    let mut specs = Vec::new();
    if is_held {
        specs.push(spec(side(mesh, -1.0), Vec3::zeros(), Freedom::Fixed));
    }
    let at = |vertex: u32| mesh.positions[vertex as usize];
    specs.extend(
        (handles.iter()).map(|vertex| spec(vec![*vertex], at(*vertex), Freedom::Translation)),
    );
    block_of(mesh, if is_held { 3e4 } else { 1e7 }, &specs)
}

/// A block of this modulus (Pa).
fn block_of(mesh: &TetMesh, young: f64, specs: &[HandleSpec]) -> Body {
    let material = SolidMaterial {
        young,
        poisson: 0.4,
        density: 1000.0,
    };
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        mass_damping: 3.0,
        stiffness_damping: 5e-3,
        ..BodyConfig::default()
    };
    Body::solid(mesh, &[material], SolidLaw::Corotational, config, specs).unwrap()
}

/// A light column whose sides do not bulge, with its lower side held or with all of it loose.
fn column(mesh: &TetMesh, is_held: bool) -> Body {
    let below = spec(side(mesh, -1.0), Vec3::zeros(), Freedom::Fixed);
    let specs = if is_held { vec![below] } else { Vec::new() };
    let material = SolidMaterial {
        young: 3e4,
        poisson: 0.0,
        density: 1.0,
    };
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        ..BodyConfig::default()
    };
    Body::solid(mesh, &[material], SolidLaw::Corotational, config, &specs).unwrap()
}

/// Four vertices of the upper side, two of them neighbours.
fn points(mesh: &TetMesh) -> [u32; 4] {
    let upper = side(mesh, 1.0);
    [0, 7, 12, 13].map(|number| upper[number])
}

/// The points as sites, with an empty place between them.
fn sites(points: [u32; 4]) -> [Option<u32>; 5] {
    let [a, b, c, d] = points.map(Some);
    [a, None, b, c, d]
}

fn compliance(body: &mut Body, sites: &[Option<u32>]) -> SiteCompliance {
    let sites: Vec<_> = sites.iter().map(|site| site.map(Footprint::of)).collect();
    spread(body, &sites)
}

fn spread(body: &mut Body, sites: &[Option<Footprint>]) -> SiteCompliance {
    spread_beside(body, sites, &[])
}

/// The compliance of sites of a body that other contacts hold.
fn spread_beside(body: &mut Body, sites: &[Option<Footprint>], held: &[Held]) -> SiteCompliance {
    let mut stepper = Stepper::<f64>::new(body, StepperOptions::default()).unwrap();
    let targets: Vec<HandlePose> = (0..body.handle_count())
        .map(|_| HandlePose::at(Vec3::zeros()))
        .collect();
    stepper.step(body, 1e-3, &targets, &mut || false).unwrap();
    let options = ShapeOptions {
        tolerance: 1e-10,
        max_iterations: 1000,
        ..ShapeOptions::default()
    };
    let mut found = SiteCompliance::new(sites.len());
    found
        .renew(&mut stepper, body, PERIOD, sites, held, &options)
        .unwrap();
    found
}

/// The compliance of the points.
fn between(found: &SiteCompliance) -> Matrix {
    let places = [0, 2, 3, 4];
    Matrix::from_fn(|i, j| found.between(places[i / 3], places[j / 3])[(i % 3, j % 3)])
}

/// The stiffness to which a body condenses onto its last four handles.
fn condensed(body: &mut Body) -> Matrix {
    body.assemble();
    let mut condenser = Condenser::new(body).unwrap();
    let found = condenser.condense(body, PERIOD).unwrap();
    let first = body.handle_count() - 4;
    let slot = |i: usize| 6 * (first + i / 3) + i % 3;
    Matrix::from_fn(|i, j| found.raw_stiffness[(slot(i), slot(j))])
}

#[test]
fn the_compliance_is_the_inverse_of_the_condensed_stiffness() {
    let mesh = mesh();
    let points = points(&mesh);
    let found = compliance(&mut block(&mesh, true, &[]), &sites(points));
    let stiffness = condensed(&mut block(&mesh, true, &points));
    let left = between(&found) * stiffness - Matrix::identity();
    // What the iterations leave, times the condition of the stiffness.
    assert!(left.amax() < 1e-6, "{:e}", left.amax());
    // The empty place has none.
    assert_eq!(found.between(1, 1).norm() + found.between(1, 2).norm(), 0.0);
}

/// The vertices of a side with the fractions of its area for which they stand.
fn by_area(mesh: &TetMesh, side: &[u32]) -> Vec<(u32, f64)> {
    let mut weights: Vec<(u32, f64)> = side.iter().map(|vertex| (*vertex, 0.0)).collect();
    let Cells::Linear(cells) = &mesh.cells else {
        panic!("a box of linear cells");
    };
    let faces = cells.iter().filter_map(|tet| {
        let here: Vec<u32> = tet.iter().copied().filter(|v| side.contains(v)).collect();
        <[u32; 3]>::try_from(here).ok()
    });
    for face in faces {
        let [a, b, c] = face.map(|vertex| mesh.positions[vertex as usize]);
        let area = 0.5 * (b - a).cross(&(c - a)).norm();
        for (vertex, weight) in &mut weights {
            if face.contains(vertex) {
                *weight += area / 3.0 / (0.06 * 0.06);
            }
        }
    }
    weights
}

/// A force that is spread over the upper side as a pressure is, compresses a column whose sides do not bulge by `F h / (E A)`.
#[test]
fn a_spread_force_has_the_compliance_of_its_area() {
    let mesh = mesh();
    let top = side(&mesh, 1.0);
    let weights = by_area(&mesh, &top);
    let mut body = column(&mesh, true);
    let found = spread(
        &mut body,
        &[Some(Footprint {
            node: top[0],
            weights,
        })],
    );
    let expected = 0.03 / (3e4 * 0.06 * 0.06);
    let error = found.between(0, 0)[(2, 2)] / expected - 1.0;
    // The inertia of the column in a sixtieth of a second is taken out again, up to the iterations.
    assert!(error.abs() < 1e-3, "{error:e}");
    // A single node gives way much more.
    let single = compliance(&mut body, &[Some(top[0])]);
    assert!(single.between(0, 0)[(2, 2)] > 5.0 * expected);
}

/// A sheet yields across itself, and hardly along itself: the stiff direction stays much stiffer than the device.
#[test]
fn a_direction_of_little_compliance_stays_stiff_beside_a_soft_one() {
    let device = 3000.0;
    for count in [1, 2, 4] {
        let arms: Vec<Vec3> = (0..count)
            .map(|at| Vec3::x() * f64::from(at) * 0.01)
            .collect();
        let between = |one: usize, other: usize| {
            let own = if one == other { 1.0 } else { 0.5 };
            Mat3::from_diagonal(&Vec3::new(1e-6, 0.3, 1e-6)) * own
        };
        let found = resultant(&arms, device, &between).unwrap();
        assert!(
            found[(0, 0)] > 5.0 * device && found[(2, 2)] > 5.0 * device,
            "{found}"
        );
        assert!(found[(1, 1)] < 10.0, "{found}");
    }
}

/// A handle and a support hold a block alike: no piece of it is loose.
#[test]
fn a_site_that_is_held_does_not_yield() {
    let mesh = mesh();
    let held = side(&mesh, -1.0).pop();
    let [top, ..] = points(&mesh).map(Some);
    let mut supported = block_of(&mesh, 3e4, &[]);
    supported
        .add_support(&side(&mesh, -1.0), [true; 3])
        .unwrap();
    let bodies = [block(&mesh, true, &[]), supported];
    let own = bodies.map(|mut body| {
        let found = compliance(&mut body, &[held, top]);
        assert_eq!(found.between(0, 0).norm() + found.between(0, 1).norm(), 0.0);
        found.between(1, 1)
    });
    assert!(own[0].trace() > 0.0);
    assert!((own[0] - own[1]).amax() < 1e-6 * own[0].amax(), "{own:?}");
}

#[test]
fn a_loose_body_resists_by_the_inertia_of_a_publication() {
    let mesh = mesh();
    let points = points(&mesh);
    let mut body = block(&mesh, false, &[]);
    let mass: f64 = body.node_masses().iter().sum();
    let found = compliance(&mut body, &sites(points));
    let inverse = between(&found).try_inverse().unwrap();
    // The stiffness to which the body condenses lets a rigid motion pass. The compliance has the inertia instead.
    let stiffness = condensed(&mut block(&mesh, false, &points));
    for axis in 0..3 {
        let shift = SVector::<f64, 12>::from_fn(|i, _| f64::from(u8::from(i % 3 == axis)));
        let [energy, elastic] = [inverse, stiffness].map(|of| shift.dot(&(of * shift)));
        let expected = mass / (PERIOD * PERIOD);
        // A wave passes the block twenty times in a publication, so that the shapes deform by some thousandths.
        assert!(elastic.abs() < 0.01 * expected, "{elastic:e} {expected}");
        assert!(
            (energy / expected - 1.0).abs() < 0.01,
            "{energy} {expected}"
        );
    }
}

/// A light column lies loose on a floor. Pressed from above it is as stiff as if its foot were held, `E A / h`, while its inertia is 10,000
/// times softer. Across, inertia alone resists where the floor lets it slip, and the shear of the column where the floor does not.
#[test]
fn a_loose_body_on_a_floor_is_as_stiff_as_what_holds_it() {
    let mesh = mesh();
    let top = side(&mesh, 1.0);
    let site = Footprint {
        node: top[0],
        weights: by_area(&mesh, &top),
    };
    let mut body = column(&mesh, false);
    let mass: f64 = body.node_masses().iter().sum();
    let floor = |slips: bool| {
        let below = by_area(&mesh, &side(&mesh, -1.0));
        let each = below.into_iter().map(|(node, force)| Held {
            node,
            force,
            normal: Vec3::z(),
            slips,
        });
        each.collect::<Vec<_>>()
    };
    let mut yields = |held: &[Held]| {
        let found = spread_beside(&mut body, &[Some(site.clone())], held);
        found.between(0, 0)
    };
    let (inert, pressed) = (PERIOD * PERIOD / mass, 0.03 / (3e4 * 0.06 * 0.06));
    let loose = yields(&[]);
    assert!(loose[(2, 2)] > inert && loose[(2, 2)] < 1.01 * inert);
    for slips in [true, false] {
        let found = yields(&floor(slips));
        // A contact is softer by a hundredth of the deformation of the body alone, which is a third of this one.
        let error = found[(2, 2)] / pressed - 1.0;
        assert!(error.abs() < 0.01, "{error}");
        let across = found[(0, 0)];
        if slips {
            assert!(across > inert && across < 1.1 * inert, "{across}");
        } else {
            // The shear, `h / (G A)` with `G = E / 2`, and the bending of a short column.
            assert!(across > 2.0 * pressed && across < 4.0 * pressed, "{across}");
        }
    }
}

#[test]
fn shapes_are_kept_while_nothing_changes_and_renewed_in_turn() {
    let mesh = mesh();
    let mut body = block(&mesh, true, &[]);
    let mut stepper = Stepper::<f64>::new(&body, StepperOptions::default()).unwrap();
    let target = [HandlePose::at(Vec3::zeros())];
    stepper
        .step(&mut body, 1e-3, &target, &mut || false)
        .unwrap();
    let options = ShapeOptions {
        at_a_time: 1,
        ..ShapeOptions::default()
    };
    let mut found = SiteCompliance::new(3);
    let [a, b, c, d] = points(&mesh).map(Some);
    let mut renewed = |body: &Body, stepper: &mut Stepper<f64>, sites: [Option<u32>; 3]| {
        let sites = sites.map(|site| site.map(Footprint::of));
        let report = found.renew(stepper, body, PERIOD, &sites, &[], &options);
        report.unwrap().renewed
    };
    assert_eq!(renewed(&body, &mut stepper, [a, b, c]), 9);
    assert_eq!(renewed(&body, &mut stepper, [a, b, c]), 0);
    // One is new.
    assert_eq!(renewed(&body, &mut stepper, [a, d, c]), 3);
    // The body moves on: one site at a time.
    let target = [HandlePose::at(Vec3::new(1e-3, 0.0, 0.0))];
    stepper
        .step(&mut body, 1e-3, &target, &mut || false)
        .unwrap();
    let turns: Vec<usize> = (0..4)
        .map(|_| renewed(&body, &mut stepper, [a, d, c]))
        .collect();
    assert_eq!(turns, [3, 3, 3, 0]);
}
