//! One host step at 1.4K triangles: `cargo bench --bench host_step`.
//!
//! A rubber sheet of 27 x 26 cells (1,404 triangles), held along its left and right edges by two hands
//! that stretch it slowly, with tremor; steps of 10 ms and of 1 ms, with and without bending.
//!
//! A **table** sets the time of a whole step (`assemble` and `solve`) beside what the solver left: its
//! residual, and the force error against a solution solved to 1e-12. A time without them says nothing.
//! **divan** then measures the step and its stages again: assembling, one product of the free part of the
//! stiffness with a vector, and condensing onto the hands (factorization and six columns), which is done
//! once a publication.

#[path = "../common/mod.rs"]
mod common;
mod errors;
mod stretch;

use common::tables_wanted;
use divan::{Bencher, black_box};
use physics::Vec3;
use physics::fem::{Budget, Condenser, Sheet};
use stretch::{BEGIN, stretched};

/// The plate's bending stiffness, times this; without bending the matrix has fewer blocks.
pub(crate) const BENDING: [f64; 2] = [0.0, 1.0];
/// Step lengths (s).
pub(crate) const STEPS: [f64; 2] = [0.01, 0.001];

fn main() {
    if tables_wanted() {
        errors::print();
    }
    divan::main();
}

/// What stops the solver.
pub(crate) fn budget(tolerance: f64, max_iterations: usize) -> Budget {
    Budget {
        tolerance,
        absolute_tolerance: 0.0,
        max_iterations,
    }
}

/// One product of the stiffness among free nodes.
pub(crate) fn product(sheet: &Sheet, x: &[Vec3], y: &mut [Vec3]) {
    for (row, y) in y.iter_mut().enumerate().take(sheet.stiffness().free()) {
        *y = sheet.stiffness().free_product(row, x);
    }
}

fn step(bencher: Bencher, dt: f64, bending: f64, budget: Budget) {
    let (mut sheet, hands) = stretched(bending, dt);
    sheet.set_budget(budget).expect("a budget");
    let poses = hands.at(BEGIN + dt);
    bencher
        .with_inputs(|| sheet.clone())
        .bench_local_refs(|sheet| sheet.step(dt, black_box(&poses)));
}

#[divan::bench(args = BENDING, sample_count = 200, max_time = 1)]
fn step_10ms_cg_25(bencher: Bencher, bending: f64) {
    step(bencher, STEPS[0], bending, budget(0.0, 25));
}

#[divan::bench(args = BENDING, sample_count = 200, max_time = 1)]
fn step_10ms_to_1e_6(bencher: Bencher, bending: f64) {
    step(bencher, STEPS[0], bending, budget(1e-6, 10_000));
}

#[divan::bench(args = BENDING, sample_count = 200, max_time = 1)]
fn step_1ms_cg_25(bencher: Bencher, bending: f64) {
    step(bencher, STEPS[1], bending, budget(0.0, 25));
}

#[divan::bench(args = BENDING, sample_count = 200, max_time = 1)]
fn step_1ms_to_1e_6(bencher: Bencher, bending: f64) {
    step(bencher, STEPS[1], bending, budget(1e-6, 10_000));
}

#[divan::bench(args = BENDING, sample_count = 200, max_time = 1)]
fn assemble(bencher: Bencher, bending: f64) {
    let (mut sheet, _) = stretched(bending, STEPS[0]);
    bencher.bench_local(|| black_box(&mut sheet).assemble());
}

#[divan::bench(args = BENDING, sample_count = 500, max_time = 1)]
fn one_product(bencher: Bencher, bending: f64) {
    let (sheet, _) = stretched(bending, STEPS[0]);
    let x: Vec<Vec3> = sheet.velocities().collect();
    let mut y = vec![Vec3::zeros(); x.len()];
    bencher.bench_local(|| product(black_box(&sheet), black_box(&x), black_box(&mut y)));
}

#[divan::bench(args = BENDING, sample_count = 200, max_time = 1)]
fn condense_six_columns(bencher: Bencher, bending: f64) {
    let (sheet, _) = stretched(bending, STEPS[0]);
    let mut condenser = Condenser::new(&sheet).expect("it can be condensed");
    bencher.bench_local(|| condenser.condense(black_box(&sheet), STEPS[0]).is_ok());
}
