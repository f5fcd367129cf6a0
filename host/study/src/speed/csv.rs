//! The results as CSV, a line for each scene and path.

use super::Speed;
use std::fmt::Write;

/// The names of the columns. Times are in microseconds, the step in seconds, the force in newtons. Errors are
/// relative to the largest force.
const HEAD: &str = "scene,elements,unknowns,step_s,path,steps,median_us,p99_us,p999_us,worst_us,\
    mean_iterations,most_iterations,residual,force_n,solver_error,step_error,jnd";

/// The lines of the file, with a head.
pub fn rows(found: &Speed) -> String {
    let mut text = HEAD.to_owned() + "\n";
    for row in found.cube.iter().chain(&found.sheets) {
        let times = row.times;
        let [median, p99, p999, worst] =
            [times.median, times.p99, times.p999, times.worst].map(|time| 1e6 * time);
        let step_error = row
            .step_error
            .map_or(String::new(), |error| format!("{error:e}"));
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{median:.2},{p99:.2},{p999:.2},{worst:.2},{:.2},{},{:e},{},{:e},{step_error},{:e}",
            row.scene,
            row.elements,
            row.unknowns,
            row.step,
            row.path,
            times.count,
            row.mean_iterations,
            row.most_iterations,
            row.residual,
            row.force,
            row.solver_error,
            row.noticeable(),
        );
    }
    text
}
