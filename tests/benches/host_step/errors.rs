//! The table of times with residuals and force errors.

use crate::budget;
use crate::common::{Spread, timed};
use crate::stages::product_time;
use crate::stretch::{
    BEGIN, BENDING, CELLS, Case, DAMPING, MATERIAL, PULL, PULLS_PER_SECOND, STEPS, TREMOR, case,
};
use physics::{Body, Budget, HandlePose, Material, SolveReport, Vec3};

/// Measured steps.
const COUNT: usize = 100;
/// A number of iterations that no solve reaches.
const ENDLESS: usize = 10_000;

/// A stopping criterion of the solver, and its results.
struct Row {
    name: &'static str,
    budget: Budget,
    /// Times of steps from the state of the reference, so that all rows start from the same state.
    times: Vec<f64>,
    iterations: Vec<f64>,
    residuals: Vec<f64>,
    /// Largest force error of one such step (N).
    step_error: f64,
    /// The body after the row's own steps: each step starts from the state after the one before.
    own: Body,
    /// Largest force error of the own steps (N).
    run_error: f64,
}

fn forces(sheet: &Body) -> [Vec3; 2] {
    let force =
        |hand| (sheet.handle_report(hand)).map_or(Vec3::zeros(), |r| r.wrench_on_hand.force);
    [force(0), force(1)]
}

fn difference(a: &[Vec3; 2], b: &[Vec3; 2]) -> f64 {
    (a[0] - b[0]).norm().max((a[1] - b[1]).norm())
}

fn step(sheet: &mut Body, dt: f64, poses: &[HandlePose]) -> SolveReport {
    sheet.step(dt, poses).expect("it steps")
}

/// Runs all rows over the same motion. Returns the rows, the largest force (N), and the time of a product (s).
fn run(bending: f64, dt: f64) -> (Vec<Row>, f64, f64) {
    let Case { sheet, hands, .. } = case(bending, dt);
    let mut tight = with_budget(sheet, budget(1e-12, ENDLESS));
    let settings = [
        ("25 iterations", budget(0.0, 25)),
        ("residual 1e-3", budget(1e-3, ENDLESS)),
        ("residual 1e-6", budget(1e-6, ENDLESS)),
    ];
    let mut rows: Vec<Row> = settings
        .into_iter()
        .map(|(name, budget)| Row {
            name,
            budget,
            times: Vec::new(),
            iterations: Vec::new(),
            residuals: Vec::new(),
            step_error: 0.0,
            own: with_budget(&tight, budget),
            run_error: 0.0,
        })
        .collect();
    let mut largest = 0.0_f64;
    for k in 1..=COUNT {
        let poses = hands.at(BEGIN + dt * k as f64);
        let before = tight.clone();
        step(&mut tight, dt, &poses);
        let reference = forces(&tight);
        largest = reference.iter().map(Vec3::norm).fold(largest, f64::max);
        for row in &mut rows {
            let mut from_reference = with_budget(&before, row.budget);
            let (time, report) = timed(|| step(&mut from_reference, dt, &poses));
            row.times.push(time);
            row.iterations.push(report.iterations as f64);
            row.residuals.push(report.relative_residual());
            let error = difference(&forces(&from_reference), &reference);
            row.step_error = row.step_error.max(error);
            step(&mut row.own, dt, &poses);
            row.run_error = row.run_error.max(difference(&forces(&row.own), &reference));
        }
    }
    (rows, largest, product_time(&tight).median)
}

fn with_budget(sheet: &Body, budget: Budget) -> Body {
    let mut sheet = sheet.clone();
    sheet.set_budget(budget).expect("a budget");
    sheet
}

/// Measures and prints the table.
pub(crate) fn print() {
    let [nx, ny] = CELLS;
    let Material {
        young,
        poisson,
        thickness,
        density,
    } = MATERIAL;
    println!(
        "One host step (assemble and solve): a sheet of {nx} x {ny} cells, {} triangles, and two hands.
E {:.0} MPa, nu {poisson}, {:.0} mm, {density:.0} kg/m^3, Rayleigh damping {} /s by mass and {} s by stiffness,
no gravity. Each hand pulls {:.0} mm at {PULLS_PER_SECOND} Hz, with {} mm of tremor; {COUNT} steps.

Conjugate gradients from the previous velocity, 3 x 3 block Jacobi. ms: thread CPU time, median (10th
to 90th percentile). Residual: relative to the guess's, median. Force error: the largest against a
solution to 1e-12, relative to the largest force; of one step from the reference's state, and over
the whole run of the setting's own steps. Products: fraction of the time in matrix products, estimated
from the time of one product alone.

For reference only: SOFA v26.06, 1,404 triangles, 25 iterations, not converged, no bending: 0.85 ms a
step on a machine where one product of its calibration kernel takes 29.45 us.
",
        2 * nx * ny,
        young * 1e-6,
        thickness * 1e3,
        DAMPING[0],
        DAMPING[1],
        PULL * 1e3,
        TREMOR * 1e3,
    );
    println!(
        "| dt | bending | stop | ms | iterations | residual | force error, step | over the run | products |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let mut notes = Vec::new();
    for dt in STEPS {
        let mut without = f64::NAN;
        for bending in BENDING {
            let (rows, largest, one) = run(bending, dt);
            let mut step_time = f64::NAN;
            let mut last_iterations = f64::NAN;
            for row in rows {
                let time = Spread::of(row.times);
                let iterations = Spread::of(row.iterations).median;
                step_time = time.median;
                last_iterations = iterations;
                println!(
                    "| {:.0} ms | {} | {} | {:.2} | {iterations} | {:.0e} | {:.0e} | {:.0e} | {:.0} % |",
                    dt * 1e3,
                    if bending > 0.0 { "yes" } else { "no" },
                    row.name,
                    time.times(1e3),
                    Spread::of(row.residuals).median,
                    row.step_error / largest,
                    row.run_error / largest,
                    100.0 * iterations * one / step_time,
                );
            }
            if bending > 0.0 {
                notes.push(format!(
                    "dt {:.0} ms: largest force {largest:.1} N. One product takes {:.1} us without bending's
blocks and {:.1} us with: they are {:.0} % of a step to 1e-6.",
                    dt * 1e3,
                    without * 1e6,
                    one * 1e6,
                    100.0 * last_iterations * (one - without) / step_time,
                ));
            }
            without = one;
        }
    }
    println!();
    for note in notes {
        println!("{note}");
    }
    println!();
}
