//! `palpate bench accuracy`: the error of sheets and solids against exact solutions and independent programs.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::super::written::Written;
use super::{level, with_bar};
use host::atomic_file::write_json;
use host::plot::{self, Marker, Role, Series};
use std::path::PathBuf;
use study::accuracy::{self, Accuracy, LocalModels, Prediction};

/// Arguments of `palpate bench accuracy`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct AccuracyArguments {
    /// Write the tables as JSON as well
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw error against element size (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Use only the coarse meshes, in seconds instead of minutes
    #[arg(long)]
    quick: bool,
}

pub(super) fn run(arguments: &AccuracyArguments) -> Result<(), CommandError> {
    let _held = Declared::default()
        .file("--json", arguments.json.as_ref(), Format::Json)
        .file("--plot", arguments.plot.as_ref(), Format::Picture)
        .check()?;
    let level = level(arguments.quick);
    let found = with_bar(|progress| accuracy::run(level, &mut |done| progress(done)))?;
    print_series(&found);
    print_local_models(&found.local_models);
    let mut written = Written::default();
    written.write(arguments.json.as_ref(), |path| write_json(path, &found));
    written.write(arguments.plot.as_ref(), |path| {
        plot::write_picture(path, &chart(&found.series))
    });
    written.end()?;
    Ok(())
}

fn print_series(found: &Accuracy) {
    outln!("| benchmark | mesh | ours | other program | reference | error | order |");
    outln!("|---|---|---|---|---|---|---|");
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
            outln!(
                "| {} | {} | {ours} | {other} | {reference} | {error} | {order} |",
                series.title,
                point.mesh
            );
        }
    }
    outln!();
    for series in &found.series {
        outln!("- {}: {}", series.title, series.source);
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

fn print_local_models(found: &LocalModels) {
    outln!(
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
    outln!("| motion | damping (s) | {} |", heads.join(" | "));
    outln!("|---|---|{}", "---|".repeat(heads.len()));
    let print = |motion: &str, row: &[Prediction], error: fn(&Prediction) -> f64| {
        let cells: Vec<_> = row
            .iter()
            .map(|cell| format!("{:.4}", error(cell)))
            .collect();
        let damping = row.first().map_or(0.0, |cell| cell.damping);
        outln!("| {motion} | {damping} | {} |", cells.join(" | "));
    };
    for row in rows {
        if row.first().is_some_and(|cell| cell.motion == "steady") {
            print("steady", row, |cell| cell.error);
            print("steady, without drift", row, |cell| {
                cell.error_without_drift
            });
            print("steady, exact tangent", row, |cell| {
                cell.error_exact_tangent
            });
        } else {
            print("from rest", row, |cell| cell.error);
        }
    }
    outln!(
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

fn chart(all: &[accuracy::Series]) -> String {
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
    plot::line_chart_svg(
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
    use study::accuracy::Point;

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
        let all = DRAWN.map(|(name, _)| accuracy::Series {
            name,
            title: String::new(),
            unit: "1",
            reference: None,
            source: "",
            points: [0.25, 0.125, 0.03].map(point).to_vec(),
        });
        let svg = chart(&all);
        assert_eq!(plot::collisions(&svg), [""; 0]);
        let named =
            |label: &str| svg.contains(&format!("{}: order 2.0", label.replace('\'', "&apos;")));
        assert!(DRAWN.iter().all(|(_, label)| named(label)));
    }
}
