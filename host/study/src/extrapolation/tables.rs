//! The tables and the picture of the study.

use super::{BLENDS, Extrapolation, Motion, RATES, SCHEMES};
use crate::Results;
use host::plot::{self, Marker, Panel, Picture, Role, Scale, Series};

impl Results for Extrapolation {
    fn tables(&self) -> String {
        let mut text = String::new();
        put_tables(&mut text, self);
        text
    }

    fn picture(&self) -> Option<Picture> {
        Some(chart(self))
    }
}

fn put_tables(text: &mut String, found: &Extrapolation) {
    put!(
        text,
        "RMS force error between publications (N); 1 ms physics steps, reference published every step"
    );
    put!(
        text,
        "peak force {:.2} N pulling apart, {:.2} N moving together; thesis: k = {:.0} N/m, k_v = {:.2} N s/m",
        found.peak[0],
        found.peak[1],
        found.thesis_gains[0],
        found.thesis_gains[1]
    );
    let resisted = found.rigid_stiffness.iter();
    let resisted: Vec<_> = resisted
        .map(|(rate, k)| format!("{k:.1} at {rate} Hz"))
        .collect();
    put!(
        text,
        "published stiffness against hands that move together (N/m): {}",
        resisted.join(", ")
    );
    for blend in BLENDS {
        let over = if blend > 0.0 {
            "half a period (the default)"
        } else {
            "two ticks"
        };
        put!(text, "\nBlend into a new model over {over}:\n");
        let heads = |motion| {
            SCHEMES
                .map(|scheme| format!("{scheme}, {motion}"))
                .join(" | ")
        };
        put!(text, "| Hz | {} | {} |", heads("apart"), heads("together"));
        put!(text, "|---|{}", "---|".repeat(2 * SCHEMES.len()));
        for rate in RATES {
            put_part!(text, "| {rate} ");
            for motion in [Motion::Apart, Motion::Together] {
                for scheme in SCHEMES {
                    let rms = found.rms(motion, rate, scheme, blend).unwrap_or(f64::NAN);
                    put_part!(text, "| {rms:.4} ");
                }
            }
            put!(text, "|");
        }
    }
}

/// The mark of each scheme. A ring shows the mark below it, if errors coincide.
const MARKERS: [Marker; SCHEMES.len()] = [
    Marker::Circle,
    Marker::Square,
    Marker::Triangle,
    Marker::Ring,
];

fn chart(found: &Extrapolation) -> Picture {
    let errors = found.cells.iter().filter(|cell| cell.blend == BLENDS[0]);
    let errors: Vec<f64> = errors.map(|cell| cell.rms).collect();
    let panel = |(motion, title): (Motion, &str)| {
        let series = SCHEMES.iter().zip(MARKERS).map(|(scheme, marker)| {
            let rms = |rate: f64| found.rms(motion, rate, scheme, BLENDS[0]);
            Series {
                name: (*scheme).to_owned(),
                points: RATES
                    .iter()
                    .filter_map(|rate| Some((*rate, rms(*rate)?)))
                    .collect(),
                marker,
                role: Role::Scheme(scheme),
                ..Series::default()
            }
        });
        Panel {
            title: title.to_owned(),
            x_label: "Publication rate (Hz)".to_owned(),
            y_label: "RMS error of the force (N)".to_owned(),
            x_scale: Scale::Logarithmic,
            y_scale: Scale::Logarithmic,
            y_covers: errors.clone(),
            series: series.collect(),
            ..Panel::default()
        }
    };
    let panels = [
        (Motion::Apart, "Hands pull apart"),
        (Motion::Together, "Hands move together"),
    ]
    .map(panel);
    let subtitle = format!(
        "peak force {:.2} N and {:.2} N; each model blends in over half a period",
        found.peak[0], found.peak[1]
    );
    plot::panels("Force error between publications", &subtitle, 2, &panels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extrapolation::Cell;

    #[test]
    fn the_chart_has_every_scheme_and_no_collision() {
        let mut cells = Vec::new();
        for motion in [Motion::Apart, Motion::Together] {
            for rate in RATES {
                for (k, scheme) in SCHEMES.into_iter().enumerate() {
                    let rms = 10.0 / rate / 10_f64.powi(2 * k as i32);
                    cells.push(Cell {
                        motion,
                        rate,
                        scheme,
                        blend: BLENDS[0],
                        rms,
                        worst: rms,
                    });
                }
            }
        }
        let picture = chart(&Extrapolation {
            schema: "palpate.extrapolation/1",
            peak: [4.5, 1.9],
            thesis_gains: [187.0, 1.9],
            rigid_stiffness: Vec::new(),
            worst_clip: 0.0,
            cells,
        });
        let svg = picture.svg();
        assert_eq!(plot::collisions(&picture), [""; 0]);
        assert!(SCHEMES.iter().all(|scheme| svg.contains(scheme)));
    }
}
