//! The tables and the picture of the study.

use super::{Accuracy, LocalModels, Prediction};
use crate::Results;
use host::plot::{self, Marker, Picture, Role, Series};

impl Results for Accuracy {
    fn tables(&self) -> String {
        let mut text = String::new();
        put_series(&mut text, self);
        put_local_models(&mut text, &self.local_models);
        text
    }

    fn picture(&self) -> Option<Picture> {
        Some(chart(&self.series))
    }
}

fn put_series(text: &mut String, found: &Accuracy) {
    put!(
        text,
        "| benchmark | mesh | ours | other program | reference | error | order |"
    );
    put!(text, "|---|---|---|---|---|---|---|");
    for series in &found.series {
        for point in &series.points {
            let ours = value(point.ours);
            let other = point.independent.map_or(String::new(), value);
            let reference = series.reference.map_or(String::new(), value);
            let error = match series.reference {
                Some(_) => format!("{:+.4} %", 100.0 * point.error),
                None => format!("{:.3e}", point.error),
            };
            let order = point.order.map_or(String::new(), |o| format!("{o:.2}"));
            put!(
                text,
                "| {} | {} | {ours} | {other} | {reference} | {error} | {order} |",
                series.title,
                point.mesh
            );
        }
    }
    put!(text);
    for series in &found.series {
        put!(text, "- {}: {}", series.title, series.source);
    }
}

/// A value with six decimals, or with an exponent if the value is small.
fn value(value: f64) -> String {
    if value.abs() < 1e-2 {
        format!("{value:.4e}")
    } else {
        format!("{value:.6}")
    }
}

fn put_local_models(text: &mut String, found: &LocalModels) {
    put!(
        text,
        "\nLocal model of a solid: error of the predicted change of force, relative to the change, after a \
         time (steps of {:.3} ms; a held force has the error 1)\n",
        1e3 * found.step
    );
    let rows: Vec<&[Prediction]> = found
        .predictions
        .chunk_by(|a, b| (a.motion, a.damping) == (b.motion, b.damping))
        .collect();
    // Every row has the same periods.
    let first = rows.first().copied().unwrap_or_default();
    let heads: Vec<_> = first
        .iter()
        .map(|cell| format!("{:.0} ms", 1e3 * cell.period))
        .collect();
    put!(text, "| motion | damping (s) | {} |", heads.join(" | "));
    put!(text, "|---|---|{}", "---|".repeat(heads.len()));
    let mut put_row = |motion: &str, row: &[Prediction], error: fn(&Prediction) -> f64| {
        let cells: Vec<_> = row
            .iter()
            .map(|cell| format!("{:.4}", error(cell)))
            .collect();
        let damping = row.first().map_or(0.0, |cell| cell.damping);
        put!(text, "| {motion} | {damping} | {} |", cells.join(" | "));
    };
    for row in rows {
        if row.first().is_some_and(|cell| cell.motion == "steady") {
            put_row("steady", row, |cell| cell.error);
            put_row("steady, without drift", row, |cell| {
                cell.error_without_drift
            });
            put_row("steady, exact tangent", row, |cell| {
                cell.error_exact_tangent
            });
        } else {
            put_row("from rest", row, |cell| cell.error);
        }
    }
    put!(
        text,
        "\nError over one linearized step, with inertia added: {:.1e}",
        found.exactness
    );
}

/// The series that are drawn, with their names in the legend.
const DRAWN: [(&str, &str); 6] = [
    ("manufactured_linear", "manufactured, linear"),
    ("manufactured_quadratic", "manufactured, quadratic"),
    ("cook_sheet", "Cook's membrane, sheet"),
    (
        "cook_incompressible_linear",
        "Cook's, nearly incompressible, linear",
    ),
    ("plate", "bent plate, diagonals alike"),
    ("plate_alternating", "bent plate, diagonals alternating"),
];

fn chart(all: &[super::Series]) -> Picture {
    let mut drawn = Vec::new();
    for (place, (name, label)) in DRAWN.into_iter().enumerate() {
        let Some(series) = all.iter().find(|series| series.name == name) else {
            continue;
        };
        let points = series.points.iter().map(|p| (p.size, p.error.abs()));
        let order = series.finest().and_then(|point| point.order);
        drawn.push(Series {
            name: order.map_or(label.to_owned(), |o| format!("{label}: order {o:.1}")),
            points: points.collect(),
            marker: Marker::by_place(place),
            role: Role::Number(place),
            ..Series::default()
        });
    }
    plot::line_chart(
        "Error against element size",
        "Element size over the length of the problem",
        "Relative error",
        true,
        true,
        &drawn,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::Point;

    #[test]
    fn the_chart_names_every_problem_with_its_order_and_nothing_collides() {
        let point = |size: f64| Point {
            mesh: String::new(),
            size,
            ours: 1.0,
            independent: None,
            error: -size * size,
            order: Some(2.0),
        };
        let all = DRAWN.map(|(name, _)| crate::accuracy::Series {
            name,
            title: String::new(),
            unit: "1",
            reference: None,
            source: "",
            points: [0.25, 0.125, 0.03].map(point).to_vec(),
        });
        let picture = chart(&all);
        let svg = picture.svg();
        assert_eq!(plot::collisions(&picture), [""; 0]);
        let named =
            |label: &str| svg.contains(&format!("{}: order 2.0", label.replace('\'', "&apos;")));
        assert!(DRAWN.iter().all(|(_, label)| named(label)));
    }
}
