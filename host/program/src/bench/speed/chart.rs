//! Error against processor time, one chart for each quantity that is varied.

use host::plot::{self, Marker, Series};
use study::speed::{Speed, Varied};

/// The names of the pictures.
const NAMES: [&str; 3] = ["speed-solver", "speed-mesh", "speed-time-step"];
/// The formats of each picture.
pub(super) const ENDINGS: [&str; 2] = ["svg", "png"];

/// Whether `file` is one of the files.
pub(super) fn writes(file: &str) -> bool {
    let parts = file.rsplit_once('.');
    parts.is_some_and(|(name, ending)| NAMES.contains(&name) && ENDINGS.contains(&ending))
}

/// The pictures with their names.
pub(super) fn all(found: &Speed) -> [(&'static str, String); 3] {
    let step = "processor time of a step (ms)";
    [
        (
            NAMES[0],
            chart(
                found,
                Varied::Solver,
                "Solver: force error under tremor",
                step,
            ),
        ),
        (
            NAMES[1],
            chart(
                found,
                Varied::Mesh,
                "Mesh: force error of a pressed cube",
                step,
            ),
        ),
        (
            NAMES[2],
            chart(
                found,
                Varied::TimeStep,
                "Time step: force error of a swung cube",
                "processor time of a simulated second (ms)",
            ),
        ),
    ]
}

fn chart(found: &Speed, varied: Varied, title: &str, x_label: &str) -> String {
    let curves = found
        .precision
        .iter()
        .filter(|curve| curve.varied == varied);
    let drawn: Vec<_> = curves
        .map(|curve| Series {
            name: curve.name.to_owned(),
            points: curve
                .settings
                .iter()
                .map(|setting| (1e3 * setting.cpu, setting.error))
                .collect(),
            marker: Marker::Circle,
        })
        .collect();
    plot::line_chart_svg(
        title,
        x_label,
        "error over the largest force",
        true,
        true,
        &drawn,
    )
}
