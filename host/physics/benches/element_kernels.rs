//! Times the element kernels of the realtime step on a box of 6,000 tetrahedra and a sheet of 1,404 triangles, one thread.
//!
//! `cargo bench -p palpate-physics --bench element_kernels`

use physics::element::tet::cell::Tet;
use physics::element::tet::hooke::Tets;
use physics::element::triangle::triangles::{Triangle, Triangles};
use physics::material::law::Lame;
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::{Cells, TetMesh, TriMesh, generate_box::solid_box};
use physics::{Node, Real, Vec3};
use std::time::Instant;

type Work<'a, E, T> = &'a mut dyn FnMut(&mut E, &mut [Node<T>], usize);

const REPEATS: usize = 1000;

fn tets(mesh: &TetMesh) -> Vec<Tet> {
    let lame = Lame::new(1e4, 0.45);
    let Cells::Linear(cells) = &mesh.cells else {
        return Vec::new();
    };
    let tet = |nodes: &[u32; 4]| {
        let x = nodes.map(|node| mesh.positions[node as usize]);
        let edges = physics::Mat3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
        let rows = edges.try_inverse().unwrap_or_default();
        let g: [Vec3; 3] = core::array::from_fn(|a| rows.row(a).transpose());
        Tet {
            nodes: *nodes,
            gradients: [g],
            volumes: [edges.determinant() / 6.0],
            lambda: lame.lambda,
            mu: lame.mu,
        }
    };
    cells.iter().map(tet).collect()
}

/// Microseconds: the least and the median.
fn time(mut work: impl FnMut(usize)) -> (f64, f64) {
    let mut times: Vec<f64> = (0..REPEATS)
        .map(|repeat| {
            let start = Instant::now();
            work(repeat);
            start.elapsed().as_secs_f64() * 1e6
        })
        .collect();
    times.sort_by(f64::total_cmp);
    (times[0], times[REPEATS / 2])
}

fn table<T: Real>(name: &str, mesh: &TetMesh) {
    let tets = tets(mesh);
    let count = tets.len() as f64;
    let mut tets = Tets::<T>::new(&tets);
    // Two states in turn: twisted by up to half a radian, the second by `turn` further.
    let state = |extra: f64| -> Vec<Node<T>> {
        let twist = |x: &Vec3| {
            let angle = 5.0 * (x.z + 0.05) + extra;
            let turned = nalgebra::Rotation3::from_axis_angle(&Vec3::z_axis(), angle) * x;
            let d = turned - x + Vec3::new(0.0, 0.0, 0.1 * x.z);
            [T::of(d.x), T::of(d.y), T::of(d.z), T::ZERO]
        };
        mesh.positions.iter().map(twist).collect()
    };
    let mut out = vec![[T::ZERO; 4]; mesh.positions.len()];
    let mut row = |what: &str, work: Work<Tets<T>, T>| {
        let (least, median) = time(|repeat| work(&mut tets, &mut out, repeat));
        let per = least * 1e3 / count;
        println!("{name}  {what:<34} {least:8.1} {median:8.1} {per:8.2}");
    };
    for turn in [0.0, 1e-4, 1e-3, 1e-2] {
        let states = [state(0.0), state(turn)];
        row(
            &format!("linearize, turned by {turn:e}"),
            &mut |tets, out, repeat| {
                tets.linearize(&states[repeat % 2], out);
            },
        );
    }
    // No rotation of these is unique: all go through the singular values.
    let line = |x: &Vec3| [T::ZERO, T::of(-x.y), T::of(-x.z), T::ZERO];
    let line: Vec<Node<T>> = mesh.positions.iter().map(line).collect();
    row("linearize, crushed to a line", &mut |tets, out, _| {
        tets.linearize(&line, out);
    });
    let u = state(0.0);
    row("product", &mut |tets, out, _| {
        tets.product(T::of(1e-9), &u, out);
    });
}

fn triangles<T: Real>(name: &str, mesh: &TriMesh) {
    let triangle = |nodes: &[u32; 3]| {
        let [x0, x1, x2] = nodes.map(|node| mesh.positions[node as usize]);
        // The sheet lies in the plane of the first two axes.
        let (e1, e2) = (x1 - x0, x2 - x0);
        let twice = e1.x * e2.y - e1.y * e2.x;
        Triangle {
            nodes: *nodes,
            gradients: [[e2.y / twice, -e2.x / twice], [-e1.y / twice, e1.x / twice]],
            frame: [Vec3::x(), Vec3::y()],
            strained: [Vec3::zeros(); 2],
            mu: 2e2 * twice,
            lambda: 3e2 * twice,
        }
    };
    let list: Vec<Triangle> = mesh.triangles.iter().map(triangle).collect();
    let count = list.len() as f64;
    let mut triangles = Triangles::<T>::new(&list);
    let wave = |x: &Vec3| {
        let d = Vec3::new(0.05 * x.x, 0.0, 0.02 * (30.0 * x.x + 20.0 * x.y).sin());
        [T::of(d.x), T::of(d.y), T::of(d.z), T::ZERO]
    };
    let d: Vec<Node<T>> = mesh.positions.iter().map(wave).collect();
    let mut out = vec![[T::ZERO; 4]; mesh.positions.len()];
    let mut row = |what: &str, work: Work<Triangles<T>, T>| {
        let (least, median) = time(|repeat| work(&mut triangles, &mut out, repeat));
        let per = least * 1e3 / count;
        println!("{name}  {what:<34} {least:8.1} {median:8.1} {per:8.2}");
    };
    row("triangles, linearize", &mut |triangles, out, _| {
        triangles.linearize(&d, out);
    });
    row("triangles, product", &mut |triangles, out, _| {
        triangles.product(T::of(1e-9), &d, out);
    });
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mesh = solid_box([0.1; 3], [10; 3])?;
    println!(
        "     {:<34} {:>8} {:>8} {:>8}",
        "", "min us", "med us", "ns each"
    );
    table::<f64>("f64", &mesh);
    table::<f32>("f32", &mesh);
    let mesh = sheet(0.195, 0.09, 39, 18, Pattern::Alternating)?;
    triangles::<f64>("f64", &mesh);
    triangles::<f32>("f32", &mesh);
    Ok(())
}
