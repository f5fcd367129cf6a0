//! The tables and the picture of whole runs.

use super::TearingRuns;
use super::feel::Feel;
use super::figure::{Course, Sample};
use super::table::Row;
use crate::Results;
use host::plot::{self, Panel, Picture, Role, Series};

impl Results for TearingRuns {
    fn tables(&self) -> String {
        let mut text = String::new();
        if let Some(course) = &self.figure {
            put_figure(&mut text, course);
        }
        if let Some(rows) = &self.table {
            put_table(&mut text, rows);
        }
        if let Some(feel) = &self.feel {
            put_feel(&mut text, feel);
        }
        text
    }

    fn picture(&self) -> Option<Picture> {
        self.figure.as_ref().map(chart)
    }
}

fn put_figure(text: &mut String, course: &Course) {
    put!(
        text,
        "Force over a tear: {}; {} edits, {:.0} mm² torn, {} faults\n",
        course.scene,
        course.edits,
        1e6 * course.area,
        course.faults
    );
    put!(
        text,
        "| hand | rise N/m | onset mm | peak N | plateau N | deviation N | plateau / peak |"
    );
    put!(text, "|---|---|---|---|---|---|---|");
    for (hand, fraction) in course.fractions().into_iter().enumerate() {
        put!(
            text,
            "| {} | {:.0} | {:.1} | {:.3} | {:.3} | {:.3} | {:.2} |",
            hand + 1,
            course.rise[hand],
            1e3 * course.onset[hand],
            course.peak[hand],
            course.plateau[hand],
            course.spread[hand],
            fraction
        );
    }
    put!(text);
}

/// The thesis's times of the finite elements, and of the tears before and after the first edit (ms; table 4.1), by the
/// shipped scene.
const THESIS: [(&str, &str, usize, [f64; 3]); 2] = [
    ("tear_cloth", "cloth", 1400, [8.7, 3.6, 2.2]),
    ("banknote", "banknote", 1900, [11.0, 4.5, 2.3]),
];

fn put_table(text: &mut String, rows: &[Row]) {
    put!(
        text,
        "Median time of a step (ms): thesis, table 4.1, and here, on one thread\n"
    );
    put!(
        text,
        "| scene | triangles | collision | FEM | tearing, before/after | local model | total, before/after |"
    );
    put!(text, "|---|---|---|---|---|---|---|");
    for row in rows {
        for (_, name, triangles, [fem, before, after]) in THESIS.iter().filter(|t| t.0 == row.scene)
        {
            put!(
                text,
                "| thesis, {name} | {triangles} | | {fem} | {before}/{after} | | {:.1}/{:.1} |",
                fem + before,
                fem + after
            );
        }
        put!(
            text,
            "| {} | {} | | {:.3} | {:.3}/{:.3} | {:.3} | {:.3} |",
            row.scene,
            row.triangles,
            1e3 * row.fem.median,
            1e3 * row.tear_before.median,
            1e3 * row.tear_after.median,
            1e3 * row.model.median,
            1e3 * row.total.median
        );
    }
    put!(
        text,
        "\nProcessor time of whole steps, edits included (ms)\n"
    );
    put!(
        text,
        "| scene | median | 99 % | 99.9 % | worst | under 1 ms | tearing | local models | edits | step with an edit, median, worst |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|---|---|");
    for row in rows {
        put!(
            text,
            "| {} | {:.3} | {:.3} | {:.3} | {:.3} | {:.2} % | {:.1} % | {:.1} % | {} | {:.3}, {:.3} |",
            row.scene,
            1e3 * row.total.median,
            1e3 * row.total.p99,
            1e3 * row.total.p999,
            1e3 * row.total.worst,
            100.0 * row.in_time,
            100.0 * row.tear_share,
            100.0 * row.model_share,
            row.torn,
            1e3 * row.total_edit.median,
            1e3 * row.total_edit.worst
        );
    }
    put!(text, "\nEach part (ms): median, 99 %, worst\n");
    put!(
        text,
        "| scene | FEM | tears before | tears after | tears with an edit | local model |"
    );
    put!(text, "|---|---|---|---|---|---|");
    for row in rows {
        let cell = |times: &crate::speed::Times| {
            format!(
                "{:.3}, {:.3}, {:.3}",
                1e3 * times.median,
                1e3 * times.p99,
                1e3 * times.worst
            )
        };
        put!(
            text,
            "| {} | {} | {} | {} | {} | {} |",
            row.scene,
            cell(&row.fem),
            cell(&row.tear_before),
            cell(&row.tear_after),
            cell(&row.tear_edit),
            cell(&row.model)
        );
    }
    put!(text, "\nIterations of a step: mean, most\n");
    put!(
        text,
        "| scene | before the tear | in the step after an edit | in other steps | new factors | faults |"
    );
    put!(text, "|---|---|---|---|---|---|");
    for row in rows {
        let cells = row.iterations.map(|i| format!("{:.2}, {}", i.mean, i.most));
        put!(
            text,
            "| {} | {} | {} | {} |",
            row.scene,
            cells.join(" | "),
            row.renewed,
            row.faults
        );
    }
    put!(text);
}

fn put_feel(text: &mut String, feel: &Feel) {
    put!(
        text,
        "Force of a running tear under slow hosts: {}; plateau {:.3} N, from {:.2} to {:.2} s\n",
        feel.scene,
        feel.plateau,
        feel.window[0],
        feel.window[1]
    );
    put!(
        text,
        "| steps Hz | publications Hz | tear limit | median error | RMS | 95 % | worst N | ripple 20-400 Hz N | of the error N | edits | torn area | faults |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|---|---|---|---|");
    for cell in &feel.cells {
        put!(
            text,
            "| {} | {} | {} | {:.2} % | {:.2} % | {:.2} % | {:.3} | {:.4} | {:.4} | {} | {:.3} | {} |",
            cell.step_rate,
            cell.publish_rate,
            if cell.limited { "yes" } else { "no" },
            100.0 * cell.median,
            100.0 * cell.rms,
            100.0 * cell.p95,
            cell.worst,
            cell.ripple,
            cell.error_ripple,
            cell.torn,
            cell.area,
            cell.faults
        );
    }
    put!(text);
}

/// Force over the displacement of the hands, and over time.
fn chart(course: &Course) -> Picture {
    let hands = ["first hand", "second hand"];
    let lines = |x: fn(&Sample, usize) -> f64| -> Vec<Series> {
        let lines = hands.iter().enumerate().map(|(hand, name)| Series {
            name: (*name).to_owned(),
            points: course
                .samples
                .iter()
                .step_by(4)
                .map(|sample| (x(sample, hand), sample.force[hand]))
                .collect(),
            role: Role::Number(hand),
            ..Series::default()
        });
        lines.collect()
    };
    let panel = |x_label: &str, series: Vec<Series>| Panel {
        x_label: x_label.to_owned(),
        y_label: "Force on the hand (N)".to_owned(),
        series,
        ..Panel::default()
    };
    let panels = [
        panel(
            "Displacement of the hand (mm)",
            lines(|sample, hand| 1e3 * sample.moved[hand]),
        ),
        panel("Time (s)", lines(|sample, _| sample.time)),
    ];
    let [first, second] = course.fractions();
    let subtitle = format!(
        "{}: peak {:.2} and {:.2} N, plateau at {first:.2} and {second:.2} of the peak",
        course.scene, course.peak[0], course.peak[1]
    );
    plot::panels("Force during a tear", &subtitle, 2, &panels)
}
