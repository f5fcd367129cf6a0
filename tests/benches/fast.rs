//! The parts of the fast step, each alone: `cargo bench --bench fast`.
//!
//! The bodies are 6,000 corotational tetrahedra, bonded below and above, and 1,404 membrane triangles with bending.
//! `palpate bench speed` measures the whole step, with its error and the times of other programs.

use divan::{Bencher, black_box};
use physics::element::VectorForm;
use physics::element::tet::hooke::Tets;
use physics::element::triangle::triangles::Triangles;
use physics::linear::factor::Factor;
use physics::linear::order::order;
use physics::linear::panel::Panels;
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Material, Node, Precision, SolidLaw,
    SolidMaterial, Stepper, StepperOptions, Vec3,
};

fn main() {
    divan::main();
}

const CONFIG: BodyConfig = BodyConfig {
    gravity: Vec3::new(0.0, 0.0, 0.0),
    mass_damping: 0.1,
    stiffness_damping: 0.1,
    bending: 1.0,
    tolerance: 1e-6,
    absolute_tolerance: 1e-12,
    max_iterations: 1000,
};

fn cube() -> Body {
    let mesh = solid_box([0.1; 3], [10; 3]).expect("a box");
    let material = SolidMaterial {
        young: 2e4,
        poisson: 0.3,
        density: 1000.0,
    };
    let held = ["bottom", "top"].map(|name| HandleSpec {
        vertices: mesh.group(name).expect("a face").members.clone(),
        origin: Vec3::zeros(),
        freedom: Freedom::Translation,
        border: Border::Hinged,
    });
    Body::solid(&mesh, &[material], SolidLaw::Corotational, CONFIG, &held).expect("a body")
}

fn cloth() -> Body {
    let mesh = sheet(0.2, 0.2, 27, 26, Pattern::Regular).expect("a sheet");
    let material = Material {
        young: 1e6,
        poisson: 0.4,
        thickness: 1e-3,
        density: 1000.0,
    };
    let held = ["left", "right"].map(|name| HandleSpec {
        vertices: mesh.group(name).expect("an edge").members.clone(),
        origin: Vec3::zeros(),
        freedom: Freedom::Translation,
        border: Border::Hinged,
    });
    Body::sheet(&mesh, &[material], CONFIG, &held).expect("a body")
}

/// Small displacements that differ from node to node.
fn waves<T: Precision>(count: usize) -> Vec<Node<T>> {
    let wave = |k: usize| T::of(1e-4 * (0.7 * k as f64).sin());
    (0..count)
        .map(|node| {
            [
                wave(3 * node),
                wave(3 * node + 1),
                wave(3 * node + 2),
                T::ZERO,
            ]
        })
        .collect()
}

fn tets<T: Precision>(body: &Body) -> Tets<T> {
    let Some(VectorForm::HookeanTets(_, tets)) = body.elements()[0].vector_form() else {
        panic!("no tetrahedra");
    };
    Tets::new(&tets)
}

fn triangles<T: Precision>(body: &Body) -> Triangles<T> {
    let form = body.elements()[0].vector_form();
    let Some(VectorForm::CorotationalTriangles(triangles)) = form else {
        panic!("no triangles");
    };
    Triangles::new(&triangles)
}

#[divan::bench(types = [f64, f32])]
fn tets_linearize<T: Precision>(bencher: Bencher) {
    let body = cube();
    let (mut tets, d) = (tets::<T>(&body), waves(body.vertex_count()));
    let mut force = waves(body.vertex_count());
    bencher.bench_local(|| tets.linearize(black_box(&d), &mut force).to_f64());
}

#[divan::bench(types = [f64, f32])]
fn tets_product<T: Precision>(bencher: Bencher) {
    let body = cube();
    let (tets, u) = (tets::<T>(&body), waves(body.vertex_count()));
    let mut y = waves(body.vertex_count());
    bencher.bench_local(|| tets.product(T::of(1e-3), black_box(&u), &mut y));
}

#[divan::bench(types = [f64, f32])]
fn triangles_linearize<T: Precision>(bencher: Bencher) {
    let body = cloth();
    let (mut triangles, d) = (triangles::<T>(&body), waves(body.vertex_count()));
    let mut force = waves(body.vertex_count());
    bencher.bench_local(|| triangles.linearize(black_box(&d), &mut force).to_f64());
}

#[divan::bench(types = [f64, f32])]
fn triangles_product<T: Precision>(bencher: Bencher) {
    let body = cloth();
    let (triangles, u) = (triangles::<T>(&body), waves(body.vertex_count()));
    let mut y = waves(body.vertex_count());
    bencher.bench_local(|| triangles.product(T::of(1e-3), black_box(&u), &mut y));
}

/// A factor of the matrix of a step of 10 ms, and its panels.
fn panels(body: &mut Body) -> (Factor, Panels) {
    body.assemble();
    let places = body.places();
    let order = order(body.stiffness(), &places.gather(body.node_positions()));
    let masses = places.gather(body.node_masses());
    let mut factor = Factor::new(body.stiffness(), &order).expect("memory");
    factor
        .factorize(body.stiffness(), &masses, 1e4, 11.0, None)
        .expect("positive definite");
    let panels = Panels::new(&factor);
    (factor, panels)
}

#[divan::bench(args = ["cube", "cloth"])]
fn panels_solve(bencher: Bencher, name: &str) {
    let mut body = if name == "cube" { cube() } else { cloth() };
    let (_, mut panels) = panels(&mut body);
    let right: Vec<Node<f32>> = waves(body.stiffness().free());
    bencher
        .with_inputs(|| right.clone())
        .bench_local_refs(|right| panels.solve(right));
}

#[divan::bench(args = ["cube", "cloth"])]
fn panels_refresh(bencher: Bencher, name: &str) {
    let mut body = if name == "cube" { cube() } else { cloth() };
    let (factor, mut panels) = panels(&mut body);
    bencher.bench_local(|| panels.refresh(&factor));
}

#[divan::bench(args = ["cube", "cloth"], types = [f64, f32])]
fn whole_step<T: Precision>(bencher: Bencher, name: &str) {
    let mut body = if name == "cube" { cube() } else { cloth() };
    let options = StepperOptions {
        sleep_speed: 0.0,
        ..StepperOptions::default()
    };
    let mut stepper = Stepper::<T>::new(&body, options).expect("memory");
    stepper.prepare(&body, 0.01).expect("a factor");
    let mut step = 0.0_f64;
    bencher.bench_local(|| {
        // To and fro by half a millimetre, five times a second.
        step += 1.0;
        let displacement = Vec3::z() * (5e-4 * (0.314 * step).sin());
        let poses = [HandlePose::at(Vec3::zeros()), HandlePose::at(displacement)];
        stepper
            .step(&mut body, 0.01, &poses, || false)
            .map(|report| report.iterations)
    });
}
