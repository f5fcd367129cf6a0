//! Times of the frozen factor in microseconds: factorization, refresh of the panels, solve (the least and the median of
//! many), with the number of stored entries.
//!
//! `cargo bench -p palpate-physics --bench linear_panels`

use physics::linear::cholesky::Cholesky;
use physics::linear::factor::Factor;
use physics::linear::order::order;
use physics::linear::panel::Panels;
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, FactorCode, Freedom, HandleSpec, Material, SolidLaw, SolidMaterial,
    Vec3,
};
use std::time::Instant;

fn handle(vertices: &[u32], origin: Vec3) -> HandleSpec {
    HandleSpec {
        vertices: vertices.to_vec(),
        origin,
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    }
}

fn config() -> BodyConfig {
    BodyConfig {
        bending: 1.0,
        ..BodyConfig::default()
    }
}

/// A cube of 10 cm bonded at the bottom and at the top.
fn cube(cells: [u32; 3]) -> Body {
    let mesh = solid_box([0.1; 3], cells).unwrap();
    let members = |name: &str| mesh.group(name).unwrap().members.clone();
    let handles = [
        handle(&members("bottom"), Vec3::z() * -0.05),
        handle(&members("top"), Vec3::z() * 0.05),
    ];
    let material = SolidMaterial {
        young: 2e4,
        poisson: 0.3,
        density: 1000.0,
    };
    Body::solid(
        &mesh,
        &[material],
        SolidLaw::Corotational,
        config(),
        &handles,
    )
    .unwrap()
}

/// A sheet with bending, held at two ends.
fn cloth() -> Body {
    let mesh = sheet(0.27, 0.26, 27, 26, Pattern::Alternating).unwrap();
    let members = |name: &str| mesh.group(name).unwrap().members.clone();
    let handles = [
        handle(&members("left"), Vec3::x() * -0.135),
        handle(&members("right"), Vec3::x() * 0.135),
    ];
    let material = Material {
        young: 1e6,
        poisson: 0.3,
        thickness: 1e-3,
        density: 1000.0,
    };
    Body::sheet(&mesh, &[material], config(), &handles).unwrap()
}

/// Least and median of `times` runs (us).
fn time(times: usize, mut run: impl FnMut()) -> [f64; 2] {
    let mut all: Vec<f64> = (0..times)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e6
        })
        .collect();
    all.sort_by(f64::total_cmp);
    [all[0], all[times / 2]]
}

fn show(name: &str, body: &mut Body) {
    body.assemble();
    let (matrix, mass) = (body.stiffness(), &body.places().gather(body.node_masses()));
    // Implicit Euler, 10 ms, Rayleigh damping 0.1 and 0.1.
    let (by_mass, by_stiffness) = (1e4 + 10.0, 11.0);
    // Column by column: no zeros among the entries.
    let degree = Cholesky::new(matrix, 1, FactorCode::Portable).unwrap();
    let order = order(matrix, &body.places().gather(body.node_positions()));
    let exact_entries = Factor::with_code(matrix, &order, FactorCode::Portable).unwrap();
    let mut factor = Factor::new(matrix, &order).unwrap();
    let repeat = 4_000_000 / degree.factor_entries() + 3;
    let factorize = time(repeat, || {
        factor
            .factorize(matrix, mass, by_mass, by_stiffness, None)
            .unwrap();
    });
    let mut panels = Panels::new(&factor);
    let refresh = time(repeat, || panels.refresh(&factor).unwrap());
    let unknowns = factor.unknowns();
    let b: Vec<f64> = (0..unknowns).map(|i| (i as f64 * 0.37).sin()).collect();
    let mut x = b.clone();
    let exact = time(10 * repeat, || {
        x.copy_from_slice(&b);
        factor.solve(&mut x);
    });
    let mut r = vec![[0.0_f32; 4]; unknowns / 3];
    let solve = time(100 * repeat, || {
        for (node, b) in r.iter_mut().zip(b.chunks_exact(3)) {
            *node = [b[0] as f32, b[1] as f32, b[2] as f32, 0.0];
        }
        panels.solve(&mut r);
    });
    let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let error: Vec<f64> = r
        .iter()
        .zip(x.chunks_exact(3))
        .flat_map(|(r, x)| (0..3).map(|i| f64::from(r[i]) - x[i]))
        .collect();
    let pair = |[least, median]: [f64; 2]| format!("{least:>9.1} {median:>9.1}");
    println!(
        "{name:>7} {unknowns:>6} {:>8} {:>8} {:>8} {:>4} {} {} {} {} {:>8.1e}",
        degree.factor_entries(),
        exact_entries.factor_entries(),
        panels.stored(),
        factor.supernodes().blocks.len(),
        pair(factorize),
        pair(refresh),
        pair(exact),
        pair(solve),
        norm(&error) / norm(&x),
    );
}

fn main() {
    println!(
        "{:>7} {:>6} {:>8} {:>8} {:>8} {:>4} {:>19} {:>19} {:>19} {:>19} {:>8}",
        "body",
        "rows",
        "AMD",
        "entries",
        "stored",
        "",
        "factorization",
        "refresh",
        "solve by faer, f64",
        "by panels, f32",
        "error"
    );
    show("1,296", &mut cube([6; 3]));
    show("3,072", &mut cube([8; 3]));
    show("6,000", &mut cube([10; 3]));
    show("20,250", &mut cube([15; 3]));
    show("sheet", &mut cloth());
}
