//! The printed result: the machine and the rows of the longest parts as they are measured, then a table for each other part
//! of the study.

use super::{kernels, parts};
use study::elsewhere::{SPEED, Steps};
use study::speed::{Machine, Row, Size, Speed, Told, Varied};

/// Prints what is measured, a row at a time.
#[derive(Debug, Default)]
pub(super) struct Live {
    /// The title of the table whose rows are printed.
    title: &'static str,
}

impl Live {
    /// Prints what the study tells.
    pub(super) fn print(&mut self, told: Told<'_>) {
        match told {
            Told::Fraction(_) => {}
            Told::Machine(machine) => print_machine(machine),
            Told::Cube(row) => {
                self.begin("Cube of 10 cm, 20 kPa, bonded to two plates:", SCENES);
                print_row(row);
            }
            Told::Sheet(row) => {
                self.begin("Sheets of 20 cm, 1 MPa, 1 mm, with bending:", SCENES);
                print_row(row);
            }
            Told::Size(path, size) => {
                self.begin("Larger cubes, pressed with steps of 10 ms:", SIZES);
                print_size(path, size);
            }
        }
    }

    /// Prints the head of a table before its first row.
    fn begin(&mut self, title: &'static str, head: &str) {
        if std::mem::replace(&mut self.title, title) != title {
            let columns = head.matches('|').count() - 1;
            outln!("\n{title}\n\n{head}\n|{}", "---|".repeat(columns));
        }
    }
}

/// Prints the parts of which [`Live`] has printed nothing.
pub(super) fn print(found: &Speed) {
    print_times(found);
    print_elsewhere_all(found);
    print_scaling(found);
    print_skips(found);
    print_precision(found);
    parts::print(&found.parts);
    kernels::print(&found.kernels);
}

fn print_times(found: &Speed) {
    if !(found.cube.is_empty() && found.sheets.is_empty()) {
        outln!(
            "\nTimes: processor time of one thread for a whole step. Errors: the largest error of the force over the \
             motion, relative to the largest force. The solver error is against the same equation solved to 1e-12, the \
             step error against implicit Euler by Newton's method. JND: the larger of the two errors, in just-noticeable \
             differences of 10 %."
        );
    }
}

fn print_elsewhere_all(found: &Speed) {
    if !found.cube.is_empty() {
        outln!("\nOther programs, the cube pressed with steps of 10 ms:\n");
        print_elsewhere(&found.machine, &SPEED.cube, &found.cube, "press");
    }
    if !found.sheets.is_empty() {
        outln!("\nOther programs, sheets:\n");
        print_elsewhere(&found.machine, &SPEED.sheets, &found.sheets, "sheet_pull");
    }
    if !(found.cube.is_empty() && found.sheets.is_empty()) {
        outln!(
            "\nScaled: multiplied by the ratio of the small kernel's times, {:.2}. The ratios on the right are the scaled \
             time of the other program over the time of palpate.",
            found.machine.scaled(1.0)
        );
    }
}

fn print_machine(machine: &Machine) {
    outln!(
        "{}, {} cores; built for {}, found {}",
        machine.processor,
        machine.cores,
        machine.built_for.join(" "),
        machine.found.join(" ")
    );
    outln!(
        "Small kernel: {:.2} us on this machine, {:.2} us on the machine that measured the other programs",
        1e6 * machine.calibration,
        1e6 * machine.calibration_elsewhere
    );
}

const SCENES: &str = "| scene | elements | path | median us | 99 % | 99.9 % | iterations | most | residual | force N | solver error | step error | JND |";

fn print_row(row: &Row) {
    let [median, p99, p999] =
        [row.times.median, row.times.p99, row.times.p999].map(|time| 1e6 * time);
    let step_error = row
        .step_error
        .map_or(String::new(), |error| format!("{error:.1e}"));
    outln!(
        "| {} | {} | {} | {median:.0} | {p99:.0} | {p999:.0} | {:.1} | {} | {:.1e} | {:.4} | {:.1e} | {step_error} | {:.1e} |",
        row.title,
        row.elements,
        row.path,
        row.mean_iterations,
        row.most_iterations,
        row.residual,
        row.force,
        row.solver_error,
        row.noticeable(),
    );
}

/// Prints the times of the other programs, with the ratio to each path that was run on the same number of elements.
fn print_elsewhere(machine: &Machine, figures: &[Steps], rows: &[Row], scene: &str) {
    let mut paths: Vec<&str> = Vec::new();
    for row in rows.iter().filter(|row| row.scene == scene) {
        if !paths.contains(&row.path) {
            paths.push(row.path);
        }
    }
    outln!(
        "| program and setting | elements | ms there | ms scaled | {} |",
        paths.join(" | ")
    );
    outln!("|---|---|---|---|{}", "---|".repeat(paths.len()));
    let each = figures
        .iter()
        .flat_map(|figure| figure.times().map(move |time| (figure, time)));
    for (figure, (elements, step)) in each {
        let scaled = figure.scalable.then(|| machine.scaled(step));
        let ratio = |path: &&str| {
            let same =
                |row: &&Row| row.scene == scene && row.elements == elements && row.path == *path;
            let ours = rows.iter().find(same).map(|row| {
                if figure.p99 {
                    row.times.p99
                } else {
                    row.times.median
                }
            });
            scaled.zip(ours).map_or(String::new(), |(scaled, ours)| {
                format!("{:.2}", scaled / ours)
            })
        };
        let ratios: Vec<_> = paths.iter().map(ratio).collect();
        outln!(
            "| {} | {} | {:.2} | {} | {} |",
            figure.setting,
            elements,
            1e3 * step,
            scaled.map_or(String::new(), |scaled| format!("{:.2}", 1e3 * scaled)),
            ratios.join(" | ")
        );
    }
}

const SIZES: &str = "| path | tetrahedra | unknowns | median ms | iterations | ns per tetrahedron and iteration | bytes per tetrahedron | set-up ms | new factor ms |";

fn print_size(path: &str, size: &Size) {
    let beside = size.set_up.map_or(" | | ".to_owned(), |set_up| {
        format!(
            "{:.0} | {:.0} | {:.1}",
            set_up.bytes as f64 / size.elements as f64,
            1e3 * set_up.time,
            1e3 * set_up.refresh
        )
    });
    outln!(
        "| {path} | {} | {} | {:.2} | {:.1} | {:.1} | {beside} |",
        size.elements,
        size.unknowns,
        1e3 * size.median,
        size.iterations,
        1e9 * size.per_element_and_iteration,
    );
}

fn print_scaling(found: &Speed) {
    if found.scaling.is_empty() {
        return;
    }
    outln!();
    for scaling in &found.scaling {
        outln!(
            "- {}: the time of a step grows with the power {:.2} of the number of tetrahedra, the time of an iteration with {:.2}",
            scaling.path,
            scaling.exponent,
            scaling.exponent_of_iteration
        );
    }
}

fn print_skips(found: &Speed) {
    if found.skips.is_empty() {
        return;
    }
    outln!(
        "\nWork skipped on purpose (relative error of the published stiffness, or of the force):\n"
    );
    outln!("| work | elements | full us | reduced us | error |");
    outln!("|---|---|---|---|---|");
    for skip in &found.skips {
        outln!(
            "| {} | {} | {:.1} | {:.1} | {:.1e} |",
            skip.description,
            skip.elements,
            1e6 * skip.whole,
            1e6 * skip.skipped,
            skip.error
        );
    }
}

fn print_precision(found: &Speed) {
    if found.precision.is_empty() {
        return;
    }
    outln!("\nError of the force against processor time:\n");
    outln!("| varied | kind | setting | ms | error |");
    outln!("|---|---|---|---|---|");
    for curve in &found.precision {
        let varied = match curve.varied {
            Varied::Solver => "solver (a step)",
            Varied::Mesh => "mesh (a step)",
            Varied::TimeStep => "time step (a simulated second)",
        };
        for setting in &curve.settings {
            outln!(
                "| {varied} | {} | {} | {:.3} | {:.1e} |",
                curve.name,
                setting.name,
                1e3 * setting.cpu,
                setting.error
            );
        }
    }
}
