//! The stated numbers of operations of kernels against counted operations, and the memory of a stepper.

use physics::Precision;
use physics::element::bending;
use physics::element::tet::cell::{QuadraticTet, Tet};
use physics::element::tet::hooke::{
    LINEAR_ENDS_FLOPS, POINT_ENERGY_FLOPS, POINT_LINEARIZE_FLOPS, POINT_PRODUCT_FLOPS,
    QUADRATIC_ENDS_FLOPS, QuadraticTets, TURN_FLOPS, Tets,
};
use physics::element::triangle::triangles::{self, Triangle, Triangles};
use physics::lanes::block::LANES;
use physics::material::law::Frame;
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, Freedom, HandleSpec, Material, Node, Phase, Real, SolidLaw,
    SolidMaterial, Stepper, StepperOptions, Vec3,
};
use std::cell::Cell;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

const LINEAR_LINEARIZE_FLOPS: usize = LINEAR_ENDS_FLOPS + POINT_LINEARIZE_FLOPS;
const LINEAR_PRODUCT_FLOPS: usize = LINEAR_ENDS_FLOPS + POINT_PRODUCT_FLOPS;
const QUADRATIC_LINEARIZE_FLOPS: usize = QUADRATIC_ENDS_FLOPS + 4 * POINT_LINEARIZE_FLOPS;
const QUADRATIC_PRODUCT_FLOPS: usize = QUADRATIC_ENDS_FLOPS + 4 * POINT_PRODUCT_FLOPS;

thread_local! {
    static OPERATIONS: Cell<usize> = const { Cell::new(0) };
}

/// A number that counts the operations on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
struct Counted(f64);

fn count(value: f64) -> Counted {
    OPERATIONS.set(OPERATIONS.get() + 1);
    Counted(value)
}

macro_rules! counted {
    ($trait:ident, $method:ident) => {
        impl $trait for Counted {
            type Output = Self;

            fn $method(self, other: Self) -> Self {
                count(self.0.$method(other.0))
            }
        }
    };
}

counted!(Add, add);
counted!(Sub, sub);
counted!(Mul, mul);
counted!(Div, div);

impl Neg for Counted {
    type Output = Self;

    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl AddAssign for Counted {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Counted {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl Precision for Counted {}

impl Real for Counted {
    type Wide = Self;

    const ZERO: Self = Self(0.0);
    const EPSILON: Self = Self(f64::EPSILON);
    const SMALL_TURN: Self = Self(1e-13);

    fn of(value: f64) -> Self {
        Self(value)
    }

    fn to_f64(self) -> f64 {
        self.0
    }

    fn widen(self) -> Self {
        self
    }

    fn narrow(value: Self) -> Self {
        value
    }

    fn sqrt(self) -> Self {
        count(self.0.sqrt())
    }

    fn split(self) -> (Self, Self) {
        let (exponent, mantissa) = self.0.split();
        (count(exponent), Self(mantissa))
    }
}

/// The number of operations of `work`.
fn operations(work: impl FnOnce()) -> usize {
    let before = OPERATIONS.get();
    work();
    OPERATIONS.get() - before
}

/// The displacements of four nodes, strained by about a hundredth. The strain grows slightly with each number of
/// `nodes`.
fn displaced(scale: f64) -> Vec<Node<Counted>> {
    displacements(4, scale)
}

fn displacements(nodes: i32, scale: f64) -> Vec<Node<Counted>> {
    (0..nodes)
        .map(|n: i32| {
            let at = |axis: i32| Counted(scale * 1e-3 * f64::from((7 * n * n + 3 * axis) % 5));
            [at(0), at(1), at(2), Counted(0.0)]
        })
        .collect()
}

/// The operations on the padding of the nodes of an element of `nodes`: one on each difference when the kernel reads it
/// and when the kernel gathers it, one on each force that is added to its node, and one on the sum of the forces at the
/// first node.
fn fill(nodes: usize) -> usize {
    let others = nodes - 1;
    2 * others + others + (others - 1) + 1
}

#[test]
fn the_stated_operations_of_a_tetrahedron_are_the_counted_ones() {
    let one = Tet {
        nodes: [0, 1, 2, 3],
        gradients: [[Vec3::x() * 10.0, Vec3::y() * 10.0, Vec3::z() * 10.0]],
        volumes: [1e-3 / 6.0],
        lambda: 1e4,
        mu: 8e3,
    };
    let mut tets = Tets::<Counted>::new(&[one; LANES]);
    let mut force = vec![[Counted(0.0); 4]; 4];
    let d = displaced(1.0);
    // The first pass finds the rotations. The second starts from these rotations and takes one Newton iteration for
    // each.
    for _ in 0..2 {
        tets.linearize(&d, &mut force);
    }
    let expected = LANES * (LINEAR_LINEARIZE_FLOPS + fill(4) + 1);
    let found = operations(|| {
        tets.linearize(&d, &mut force);
    });
    // Each further lane adds one operation, because the energies are summed at the end.
    assert_eq!(found, expected);

    // From a distant start, all lanes take one or more further turns.
    let found = operations(|| {
        tets.linearize(&displaced(3.0), &mut force);
    });
    assert!(found > expected);
    assert_eq!((found - expected) % (LANES * TURN_FLOPS), 0);

    let found = operations(|| tets.product(Counted(2.0), &d, &mut force));
    assert_eq!(found, LANES * (LINEAR_PRODUCT_FLOPS + fill(4)));

    let mut fixed = tets.in_frame(Frame::Fixed);
    let found = operations(|| {
        fixed.linearize(&d, &mut force);
    });
    let expected = LINEAR_PRODUCT_FLOPS + POINT_ENERGY_FLOPS + fill(4) + 1;
    assert_eq!(found, LANES * expected);
}

#[test]
fn the_stated_operations_of_a_quadratic_tetrahedron_are_the_counted_ones() {
    let one = QuadraticTet {
        nodes: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9],
        gradients: [[Vec3::x() * 10.0, Vec3::y() * 10.0, Vec3::z() * 10.0]; 4],
        volumes: [1e-3 / 24.0; 4],
        lambda: 1e4,
        mu: 8e3,
    };
    let mut tets = QuadraticTets::<Counted>::new(&[one; LANES]);
    let mut force = vec![[Counted(0.0); 4]; 10];
    let d = displacements(10, 1.0);
    // The first pass finds the rotations. The second starts from these rotations and takes one Newton iteration for
    // each.
    for _ in 0..2 {
        tets.linearize(&d, &mut force);
    }
    let found = operations(|| {
        tets.linearize(&d, &mut force);
    });
    // The energies are summed at the end.
    assert_eq!(found, LANES * (QUADRATIC_LINEARIZE_FLOPS + fill(10) + 1));
    let found = operations(|| tets.product(Counted(2.0), &d, &mut force));
    assert_eq!(found, LANES * (QUADRATIC_PRODUCT_FLOPS + fill(10)));

    let mut fixed = tets.in_frame(Frame::Fixed);
    let found = operations(|| {
        fixed.linearize(&d, &mut force);
    });
    let expected = QUADRATIC_PRODUCT_FLOPS + 4 * POINT_ENERGY_FLOPS + fill(10) + 1;
    assert_eq!(found, LANES * expected);
}

#[test]
fn the_stated_operations_of_a_triangle_are_the_counted_ones() {
    let one = Triangle {
        nodes: [0, 1, 2],
        gradients: [[10.0, 0.0], [0.0, 10.0]],
        frame: [Vec3::x(), Vec3::y()],
        strained: [Vec3::zeros(); 2],
        mu: 8.0,
        lambda: 10.0,
    };
    let mut triangles = Triangles::<Counted>::new(&[one; LANES]);
    let mut force = vec![[Counted(0.0); 4]; 4];
    let d = displaced(1.0);
    let found = operations(|| {
        triangles.linearize(&d, &mut force);
    });
    // The energies are summed at the end.
    assert_eq!(found, LANES * (triangles::LINEARIZE_FLOPS + fill(3) + 1));
    let found = operations(|| triangles.product(Counted(2.0), &d, &mut force));
    assert_eq!(found, LANES * (triangles::PRODUCT_FLOPS + fill(3)));
}

#[test]
fn the_stated_operations_of_isotropic_laws_are_the_counted_ones() {
    for law in [SolidLaw::StVenantKirchhoff, SolidLaw::StableNeoHookean] {
        for (quadratic, cells, nodes) in [(false, 4, 4), (true, 2, 10)] {
            let mut body = held_cube_of(law, cells, quadratic);
            let elements = body.element_count();
            let pose = body.handle_report(0).unwrap().pose;
            let mut stepper = Stepper::<Counted>::new(&body, StepperOptions::default()).unwrap();
            for _ in 0..3 {
                stepper.step(&mut body, 0.01, &[pose], || false).unwrap();
            }
            // The first pass finds the axes. The second starts from these axes and takes one sweep.
            for _ in 0..2 {
                stepper.repeat(Phase::Linearize).unwrap();
            }
            let found = operations(|| stepper.repeat(Phase::Linearize).unwrap());
            let stated = stepper.cost(Phase::Linearize).unwrap().flops;
            // Lanes that pad the last block compute as well, and the energies of lanes are summed at the end.
            let filled = elements.next_multiple_of(LANES);
            assert_eq!(
                found,
                stated / elements * filled + filled * fill(nodes) + LANES
            );
            let found = operations(|| stepper.repeat(Phase::Product).unwrap());
            let stated = stepper.cost(Phase::Product).unwrap().flops;
            assert_eq!(found, stated / elements * filled + filled * fill(nodes));
        }
    }
}

/// A sheet of whole blocks of triangles after some steps of swinging down, with or without bending.
fn swinging_sheet(bending: f64, (nx, ny): (u32, u32)) -> Stepper<Counted> {
    let mesh = sheet(0.1, 0.1, nx, ny, Pattern::Alternating).unwrap();
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
    let left = HandleSpec {
        vertices: mesh.group("left").unwrap().members.clone(),
        origin: Vec3::zeros(),
        freedom: Freedom::Translation,
        border: Border::Hinged,
    };
    let mut body = Body::sheet(&mesh, &[material], config, &[left]).unwrap();
    assert_eq!(body.element_count() % LANES, 0);
    let pose = body.handle_report(0).unwrap().pose;
    let mut stepper = Stepper::<Counted>::new(&body, StepperOptions::default()).unwrap();
    for _ in 0..5 {
        stepper.step(&mut body, 0.01, &[pose], || false).unwrap();
    }
    stepper
}

/// The operations of bending are those of a sheet that bends without those of one that does not.
#[test]
fn the_stated_operations_of_bending_are_the_counted_ones() {
    for (nx, ny) in [(4, 4), (8, 4), (8, 8)] {
        let [mut plain, mut bent] = [0.0, 1.0].map(|bending| swinging_sheet(bending, (nx, ny)));
        let stated = |phase| {
            let flops = |stepper: &Stepper<Counted>| stepper.cost(phase).unwrap().flops;
            flops(&bent) - flops(&plain)
        };
        let stated = [Phase::Linearize, Phase::Product].map(stated);
        let mut found = |phase| {
            let repeat = |stepper: &mut Stepper<Counted>| stepper.repeat(phase).unwrap();
            operations(|| repeat(&mut bent)) - operations(|| repeat(&mut plain))
        };
        let found = [Phase::Linearize, Phase::Product].map(&mut found);
        let (triangles, nodes) = ((2 * nx * ny) as usize, ((nx + 1) * (ny + 1)) as usize);
        let edges = (3 * nx * ny - nx - ny) as usize;
        // A product takes 12 operations for each of the entries, there and back.
        let entries = (stated[1] - triangles * bending::PRODUCT_FLOPS) / 12;
        // The padding of a triangle: two sides and five vectors that are read, and seven sums of forces.
        let padding = triangles * (2 + 5 + 7);
        // The padding of the transpose. The result is added to each node as well.
        let back = 2 * entries + 4 * nodes;
        assert_eq!(found[1], stated[1] + padding + 2 * entries + back);
        // The first vertex of each edge has no difference. The energies of lanes are summed at the end.
        let differences = 3 * entries - 12 * edges;
        assert_eq!(found[0], stated[0] + padding + differences + back + LANES);
    }
}

/// A cube with `n` grid cells along the edge, held at its bottom.
fn held_cube(n: u32) -> Body {
    held_cube_of(SolidLaw::Corotational, n, false)
}

/// The same under any law.
fn held_cube_of(law: SolidLaw, n: u32, quadratic: bool) -> Body {
    let mut mesh = solid_box([0.1; 3], [n; 3]).unwrap();
    if quadratic {
        mesh = mesh.quadratic();
    }
    let material = SolidMaterial {
        young: 2e4,
        poisson: 0.3,
        density: 1000.0,
    };
    let bottom = HandleSpec {
        vertices: (0_u32..)
            .zip(&mesh.positions)
            .filter(|(_, x)| x.z < -0.05 + 1e-9)
            .map(|(vertex, _)| vertex)
            .collect(),
        origin: Vec3::zeros(),
        freedom: Freedom::Translation,
        border: Border::Hinged,
    };
    let materials = vec![material; mesh.cells.len()];
    let config = BodyConfig::default();
    Body::solid(&mesh, &materials, law, config, &[bottom]).unwrap()
}

#[test]
fn repeating_a_part_changes_no_step() {
    let body = held_cube(4);
    let pose = body.handle_report(0).unwrap().pose;
    let run = |repeated: bool| {
        let mut body = body.clone();
        let mut stepper = Stepper::<f64>::new(&body, StepperOptions::default()).unwrap();
        assert!(stepper.repeat(Phase::Product).is_err());
        for _ in 0..5 {
            stepper.step(&mut body, 0.01, &[pose], || false).unwrap();
            if repeated {
                for phase in [
                    Phase::Linearize,
                    Phase::Product,
                    Phase::Precondition,
                    Phase::Vectors,
                ] {
                    stepper.repeat(phase).unwrap();
                }
            }
        }
        body
    };
    let (plain, repeated) = (run(false), run(true));
    let moved = plain.positions().map(|x| x.amax());
    assert!(moved.fold(0.0, f64::max) > 0.05);
    for (a, b) in plain.positions().zip(repeated.positions()) {
        // A repeated Newton iteration for a rotation continues from the converged rotation, whose error is 1e-13. A
        // step of some millimetres keeps that many digits.
        assert!((a - b).amax() < 1e-12, "{a} {b}");
    }
}

#[test]
fn costs_are_those_of_the_data() {
    let body = held_cube(4);
    let stepper = Stepper::<f64>::new(&body, StepperOptions::default()).unwrap();
    let single = Stepper::<f32>::new(&body, StepperOptions::default()).unwrap();
    let (elements, nodes) = (384, 125);
    let product = stepper.cost(Phase::Product).unwrap();
    assert_eq!(product.flops, elements * LINEAR_PRODUCT_FLOPS);
    // An element has four node numbers and ten numbers of eight bytes; 384 elements fill twelve blocks. The pass also
    // reads the vector, and clears and writes the result.
    assert_eq!(product.read, elements * (16 + 80) + 2 * nodes * 32);
    assert_eq!(product.written, 2 * nodes * 32);
    assert_eq!(product.touched, elements * (16 + 80) + 2 * nodes * 32);
    let half = single.cost(Phase::Product).unwrap();
    assert_eq!(half.read, elements * (16 + 40) + 2 * nodes * 16);
    assert_eq!(half.flops, product.flops);
    let linearize = stepper.cost(Phase::Linearize).unwrap();
    assert_eq!(linearize.flops, elements * LINEAR_LINEARIZE_FLOPS);
    // An element has its node numbers, nine gradients and a scale, four numbers of a quaternion, and the ratio of the
    // moduli.
    assert_eq!(linearize.read, elements * (16 + 8 * 15) + 2 * nodes * 32);
    assert_eq!(linearize.written, elements * 8 * 13 + 2 * nodes * 32);
    // A factorization takes at most the operations of a dense one, the third power of the size, and at least one
    // product for each number.
    let refresh = stepper.cost(Phase::Refresh).unwrap();
    let unknowns: usize = 3 * 100;
    assert!(refresh.flops > unknowns * unknowns / 8 && refresh.flops < unknowns.pow(3));
    // The memory of a stepper exceeds the memory that any of its parts touches. In single precision it is smaller.
    assert!(stepper.bytes() > linearize.touched + refresh.touched);
    assert!(single.bytes() < stepper.bytes());
    assert!(body.bytes() > elements * size_of::<[Vec3; 4]>());
}
