//! The tables: the machine and the rows of the longest parts as they are measured, then a table for each other part of the
//! study.

mod kernels;
mod parts;

use super::{Machine, Row, Size, Speed, Told, Varied};
use crate::Results;
use crate::elsewhere::{SPEED, Steps};

impl Results for Speed {
    /// The tables that [`Live`] has not put.
    fn tables(&self) -> String {
        let mut text = String::new();
        put_times(&mut text, self);
        put_elsewhere_all(&mut text, self);
        put_scaling(&mut text, self);
        put_skips(&mut text, self);
        put_precision(&mut text, self);
        parts::put(&mut text, &self.parts);
        kernels::put(&mut text, &self.kernels);
        text
    }
}

/// The rows that are measured, one at a time.
#[derive(Debug, Default)]
pub struct Live {
    /// The title of the table that has begun.
    title: &'static str,
}

impl Live {
    /// The lines for what the study tells.
    pub fn lines(&mut self, told: Told<'_>) -> String {
        let mut lines = String::new();
        let text = &mut lines;
        match told {
            Told::Fraction(_) => {}
            Told::Machine(machine) => put_machine(text, machine),
            Told::Cube(row) => {
                self.begin(text, "Cube of 10 cm, 20 kPa, bonded to two plates:", SCENES);
                put_row(text, row);
            }
            Told::Sheet(row) => {
                self.begin(text, "Sheets of 20 cm, 1 MPa, 1 mm, with bending:", SCENES);
                put_row(text, row);
            }
            Told::Size(path, size) => {
                self.begin(text, "Larger cubes, pressed with steps of 10 ms:", SIZES);
                put_size(text, path, size);
            }
        }
        lines
    }

    /// The head of a table before its first row.
    fn begin(&mut self, text: &mut String, title: &'static str, head: &str) {
        if std::mem::replace(&mut self.title, title) != title {
            let columns = head.matches('|').count() - 1;
            put!(text, "\n{title}\n\n{head}\n|{}", "---|".repeat(columns));
        }
    }
}

fn put_times(text: &mut String, found: &Speed) {
    if !(found.cube.is_empty() && found.sheets.is_empty()) {
        put!(
            text,
            "\nTimes: processor time of one thread for a whole step. Errors: the largest error of the force over the \
             motion, relative to the largest force. The solver error is against the same equation solved to 1e-12, the \
             step error against implicit Euler by Newton's method. JND: the larger of the two errors, in just-noticeable \
             differences of 10 %."
        );
    }
}

fn put_elsewhere_all(text: &mut String, found: &Speed) {
    if !found.cube.is_empty() {
        put!(
            text,
            "\nOther programs, the cube pressed with steps of 10 ms:\n"
        );
        put_elsewhere(text, &found.machine, &SPEED.cube, &found.cube, "press");
    }
    if !found.sheets.is_empty() {
        put!(text, "\nOther programs, sheets:\n");
        put_elsewhere(
            text,
            &found.machine,
            &SPEED.sheets,
            &found.sheets,
            "sheet_pull",
        );
    }
    if !(found.cube.is_empty() && found.sheets.is_empty()) {
        put!(
            text,
            "\nScaled: multiplied by the ratio of the small kernel's times, {:.2}. The ratios on the right are the scaled \
             time of the other program over the time of palpate.",
            found.machine.scaled(1.0)
        );
    }
}

fn put_machine(text: &mut String, machine: &Machine) {
    put!(
        text,
        "{}, {} cores; built for {}, found {}",
        machine.processor,
        machine.cores,
        machine.built_for.join(" "),
        machine.found.join(" ")
    );
    put!(
        text,
        "Small kernel: {:.2} us on this machine, {:.2} us on the machine that measured the other programs",
        1e6 * machine.calibration,
        1e6 * machine.calibration_elsewhere
    );
}

const SCENES: &str = "| scene | elements | path | median us | 99 % | 99.9 % | iterations | most | residual | force N | solver error | step error | JND |";

fn put_row(text: &mut String, row: &Row) {
    let [median, p99, p999] =
        [row.times.median, row.times.p99, row.times.p999].map(|time| 1e6 * time);
    let step_error = row
        .step_error
        .map_or(String::new(), |error| format!("{error:.1e}"));
    put!(
        text,
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
fn put_elsewhere(
    text: &mut String,
    machine: &Machine,
    figures: &[Steps],
    rows: &[Row],
    scene: &str,
) {
    let mut paths: Vec<&str> = Vec::new();
    for row in rows.iter().filter(|row| row.scene == scene) {
        if !paths.contains(&row.path) {
            paths.push(row.path);
        }
    }
    put!(
        text,
        "| program and setting | elements | ms there | ms scaled | {} |",
        paths.join(" | ")
    );
    put!(text, "|---|---|---|---|{}", "---|".repeat(paths.len()));
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
        put!(
            text,
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

fn put_size(text: &mut String, path: &str, size: &Size) {
    let beside = size.set_up.map_or(" | | ".to_owned(), |set_up| {
        format!(
            "{:.0} | {:.0} | {:.1}",
            set_up.bytes as f64 / size.elements as f64,
            1e3 * set_up.time,
            1e3 * set_up.refresh
        )
    });
    put!(
        text,
        "| {path} | {} | {} | {:.2} | {:.1} | {:.1} | {beside} |",
        size.elements,
        size.unknowns,
        1e3 * size.median,
        size.iterations,
        1e9 * size.per_element_and_iteration,
    );
}

fn put_scaling(text: &mut String, found: &Speed) {
    if found.scaling.is_empty() {
        return;
    }
    put!(text);
    for scaling in &found.scaling {
        put!(
            text,
            "- {}: the time of a step grows with the power {:.2} of the number of tetrahedra, the time of an iteration with {:.2}",
            scaling.path,
            scaling.exponent,
            scaling.exponent_of_iteration
        );
    }
}

fn put_skips(text: &mut String, found: &Speed) {
    if found.skips.is_empty() {
        return;
    }
    put!(
        text,
        "\nWork skipped on purpose (relative error of the published stiffness, or of the force):\n"
    );
    put!(text, "| work | elements | full us | reduced us | error |");
    put!(text, "|---|---|---|---|---|");
    for skip in &found.skips {
        put!(
            text,
            "| {} | {} | {:.1} | {:.1} | {:.1e} |",
            skip.description,
            skip.elements,
            1e6 * skip.whole,
            1e6 * skip.skipped,
            skip.error
        );
    }
}

fn put_precision(text: &mut String, found: &Speed) {
    if found.precision.is_empty() {
        return;
    }
    put!(text, "\nError of the force against processor time:\n");
    put!(text, "| varied | kind | setting | ms | error |");
    put!(text, "|---|---|---|---|---|");
    for curve in &found.precision {
        let varied = match curve.varied {
            Varied::Solver => "solver (a step)",
            Varied::Mesh => "mesh (a step)",
            Varied::TimeStep => "time step (a simulated second)",
        };
        for setting in &curve.settings {
            put!(
                text,
                "| {varied} | {} | {} | {:.3} | {:.1e} |",
                curve.name,
                setting.name,
                1e3 * setting.cpu,
                setting.error
            );
        }
    }
}
