//! The stages of a step and of a publication, in thread CPU time.

use crate::common::{Spread, timed};
use crate::product;
use crate::stretch::{BENDING, STEPS, case};
use divan::black_box;
use physics::{Body, Condenser, Vec3};

const REPEATS: usize = 100;

/// Processor time of one product (s).
pub(crate) fn product_time(sheet: &Body) -> Spread {
    const BATCH: u32 = 50;
    let x: Vec<Vec3> = sheet.velocities().collect();
    let mut y = vec![Vec3::zeros(); x.len()];
    let mut batch = || {
        for _ in 0..BATCH {
            product(black_box(sheet), black_box(&x), black_box(&mut y));
        }
    };
    let times = (0..REPEATS).map(|_| timed(&mut batch).0 / f64::from(BATCH));
    Spread::of(times.collect())
}

fn assemble_time(sheet: &mut Body) -> Spread {
    let times = (0..REPEATS).map(|_| timed(|| black_box(&mut *sheet).assemble()).0);
    Spread::of(times.collect())
}

fn condense_time(sheet: &Body) -> Spread {
    let mut condenser = Condenser::new(sheet).expect("it can be condensed");
    let mut condense = || condenser.condense(black_box(sheet), STEPS[0]).is_ok();
    let times = (0..REPEATS).map(|_| timed(&mut condense).0);
    Spread::of(times.collect())
}

/// Measures and prints the table.
pub(crate) fn print() {
    let mut sheets = BENDING.map(|bending| case(bending, STEPS[0]).sheet.clone());
    let [plain, bent] = [&sheets[0], &sheets[1]].map(|sheet| sheet.stiffness().block_count());
    println!(
        "Stages, thread CPU time in us. The matrix has {plain} blocks without bending, {bent} with.\n"
    );
    println!("| | without bending | with bending |");
    println!("|---|---|---|");
    let row = |name: &str, [a, b]: [Spread; 2]| {
        println!("| {name} | {:.1} | {:.1} |", a.times(1e6), b.times(1e6));
    };
    row("assemble", sheets.each_mut().map(assemble_time));
    row("one product", sheets.each_ref().map(product_time));
    row("condense six columns", sheets.each_ref().map(condense_time));
    println!();
}
