//! One host step at 1.4K triangles: `cargo bench --bench host_step`.
//!
//! A rubber sheet of 27 x 26 cells (1,404 triangles) is held along its left and right edges by two hands that stretch
//! it slowly, with tremor. Steps of 10 ms and of 1 ms, with and without bending.
//!
//! A **table** lists the time of a whole step (`assemble` and `solve`) with the error of the solver: its residual, and
//! the force error against a solution to 1e-12. A time without the error is meaningless. Another table lists the stages
//! alone: the assembly, one product of the free part of the stiffness with a vector, and the condensation onto the
//! hands (factorization and six columns), which is done once a publication. **divan** then measures steps and stages
//! again, in wall time. On a busy machine only the tables are reliable.

#[path = "../common/mod.rs"]
mod common;
mod errors;
mod stages;
mod stretch;

use common::tables_wanted;
use divan::{Bencher, black_box};
use physics::{Body, Budget, Condenser, Vec3};
use stretch::{BEGIN, BENDING, Case, STEPS, case};

/// Names of the sheets in divan.
const SHEETS: [&str; 2] = ["membrane", "with bending"];

fn main() {
    if tables_wanted() {
        errors::print();
        stages::print();
    }
    divan::main();
}

/// The stopping criterion of the solver.
pub(crate) fn budget(tolerance: f64, max_iterations: usize) -> Budget {
    Budget {
        tolerance,
        absolute_tolerance: 0.0,
        max_iterations,
    }
}

/// One product of the stiffness among free nodes.
pub(crate) fn product(sheet: &Body, x: &[Vec3], y: &mut [Vec3]) {
    for (row, y) in y.iter_mut().enumerate().take(sheet.stiffness().free()) {
        *y = sheet.stiffness().free_product(row, x);
    }
}

fn named(sheet: &str, dt: f64) -> &'static Case {
    case(BENDING[usize::from(sheet == SHEETS[1])], dt)
}

fn step(bencher: Bencher, dt: f64, name: &str, budget: Budget) {
    let Case { sheet, hands, .. } = named(name, dt);
    let mut sheet = sheet.clone();
    sheet.set_budget(budget).expect("a budget");
    let poses = hands.at(BEGIN + dt);
    bencher
        .with_inputs(|| sheet.clone())
        .bench_local_refs(|sheet| sheet.step(dt, black_box(&poses)));
}

#[divan::bench(args = SHEETS, sample_count = 200, max_time = 0.7)]
fn step_10ms_cg_25(bencher: Bencher, name: &str) {
    step(bencher, STEPS[0], name, budget(0.0, 25));
}

#[divan::bench(args = SHEETS, sample_count = 200, max_time = 0.7)]
fn step_10ms_to_1e_6(bencher: Bencher, name: &str) {
    step(bencher, STEPS[0], name, budget(1e-6, 10_000));
}

#[divan::bench(args = SHEETS, sample_count = 200, max_time = 0.7)]
fn step_1ms_cg_25(bencher: Bencher, name: &str) {
    step(bencher, STEPS[1], name, budget(0.0, 25));
}

#[divan::bench(args = SHEETS, sample_count = 200, max_time = 0.7)]
fn step_1ms_to_1e_6(bencher: Bencher, name: &str) {
    step(bencher, STEPS[1], name, budget(1e-6, 10_000));
}

#[divan::bench(args = SHEETS, sample_count = 200, max_time = 0.7)]
fn assemble(bencher: Bencher, name: &str) {
    let mut sheet = named(name, STEPS[0]).sheet.clone();
    bencher.bench_local(|| black_box(&mut sheet).assemble());
}

#[divan::bench(args = SHEETS, sample_count = 500, max_time = 0.7)]
fn one_product(bencher: Bencher, name: &str) {
    let sheet = &named(name, STEPS[0]).sheet;
    let x: Vec<Vec3> = sheet.velocities().collect();
    let mut y = vec![Vec3::zeros(); x.len()];
    bencher.bench_local(|| product(black_box(sheet), black_box(&x), black_box(&mut y)));
}

#[divan::bench(args = SHEETS, sample_count = 200, max_time = 0.7)]
fn condense_six_columns(bencher: Bencher, name: &str) {
    let sheet = &named(name, STEPS[0]).sheet;
    let mut condenser = Condenser::new(sheet).expect("it can be condensed");
    bencher.bench_local(|| condenser.condense(black_box(sheet), STEPS[0]).is_ok());
}
