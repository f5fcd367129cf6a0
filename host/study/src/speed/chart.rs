//! Error against processor time, one chart for each quantity that is varied.

use super::{Curve, Varied};
use host::plot::{self, Marker, Picture, Role, Series};

/// The names of the pictures.
const NAMES: [&str; 3] = ["speed-solver", "speed-mesh", "speed-time-step"];
/// The formats of each picture.
pub const ENDINGS: [&str; 2] = ["svg", "png"];

/// Whether `file` is one of the files.
pub fn writes(file: &str) -> bool {
    let parts = file.rsplit_once('.');
    parts.is_some_and(|(name, ending)| NAMES.contains(&name) && ENDINGS.contains(&ending))
}

/// The pictures with their names.
pub fn all(curves: &[Curve]) -> [(&'static str, Picture); 3] {
    let step = "Processor time of a step (ms)";
    [
        (
            NAMES[0],
            chart(
                curves,
                Varied::Solver,
                "Solver, from coarse to fine: force error under tremor",
                step,
            ),
        ),
        (
            NAMES[1],
            chart(
                curves,
                Varied::Mesh,
                "Mesh, from coarse to fine: force error of a pressed cube",
                step,
            ),
        ),
        (
            NAMES[2],
            chart(
                curves,
                Varied::TimeStep,
                "Time step, from long to short: force error of a swung cube",
                "Processor time of a simulated second (ms)",
            ),
        ),
    ]
}

fn chart(curves: &[Curve], varied: Varied, title: &str, x_label: &str) -> Picture {
    let curves = curves.iter().filter(|curve| curve.varied == varied);
    let drawn: Vec<_> = curves
        .enumerate()
        .map(|(place, curve)| Series {
            name: curve.name.to_owned(),
            points: curve
                .settings
                .iter()
                .map(|setting| (1e3 * setting.cpu, setting.error))
                .collect(),
            marker: Marker::by_place(place),
            role: Role::Number(place),
            spread: curve
                .settings
                .iter()
                .map(|setting| setting.cpu_range.map(|time| 1e3 * time))
                .collect(),
        })
        .collect();
    plot::line_chart(
        title,
        x_label,
        "Error of the force over the largest force",
        true,
        true,
        &drawn,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::speed::Setting;

    #[test]
    fn each_chart_shows_its_curves_with_their_spread_in_the_order_of_the_settings() {
        // The finer setting takes less time, by the noise.
        let settings = [(0.2e-3, 1e-2), (0.19e-3, 1e-5), (0.4e-3, 1e-8)];
        let settings = settings.map(|(cpu, error)| Setting {
            name: String::new(),
            cpu,
            cpu_range: [0.9 * cpu, 1.2 * cpu],
            error,
        });
        let names = [
            "assembled, to a tolerance",
            "assembled, N iterations",
            "frozen, to a tolerance",
            "frozen, single precision, to a tolerance",
            "frozen, single precision, N iterations",
        ];
        let curves: Vec<_> = [Varied::Solver, Varied::Mesh, Varied::TimeStep]
            .into_iter()
            .flat_map(|varied| names.map(|name| (varied, name)))
            .map(|(varied, name)| Curve {
                varied,
                name,
                settings: settings.to_vec(),
            })
            .collect();
        for (file, picture) in all(&curves) {
            assert_eq!(plot::collisions(&picture), [""; 0], "{file}");
            let svg = picture.svg();
            assert!(names.iter().all(|name| svg.contains(name)), "{file}");
        }
        assert!(writes("speed-mesh.png") && writes("speed-mesh.svg"));
        assert!(!writes("speed-mesh") && !writes("other.svg"));
    }
}
