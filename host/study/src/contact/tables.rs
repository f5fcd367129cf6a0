//! The tables and the picture of the study.

use super::aim::Side;
use super::{ContactStudy, Cost, HandCell, Measured, Share, ToolCell};
use crate::Results;
use host::plot::{self, Marker, Panel, Picture, Scale, Series};

/// The stages of the picture, each with its mark.
const STAGES: [(&str, Marker); 3] = [
    ("lists and rows", Marker::Circle),
    ("solve", Marker::Square),
    ("certificate", Marker::Triangle),
];

impl Results for ContactStudy {
    fn tables(&self) -> String {
        let mut text = String::new();
        if !self.aims.is_empty() {
            put!(text, "| aim | unit | ask | ours | reached |");
            put!(text, "|---|---|---|---|---|");
            for aim in &self.aims {
                let reached = if aim.is_reached { "yes" } else { "no" };
                put!(
                    text,
                    "| {} | {} | {} {} | {} | {reached} |",
                    aim.name,
                    aim.unit,
                    match aim.side {
                        Side::AtMost => "at most",
                        Side::AtLeast => "at least",
                    },
                    short(aim.ask),
                    short(aim.ours)
                );
            }
        }
        if !self.measures.is_empty() {
            put_measures(&mut text, &self.measures);
        }
        if !self.hands.is_empty() {
            put!(text);
            put_hands(&mut text, &self.hands);
        }
        if !self.tools.is_empty() {
            put!(text);
            put_tools(&mut text, &self.tools);
        }
        if let Some(machine) = &self.machine {
            if !text.is_empty() {
                put!(text);
            }
            put!(
                text,
                "{}, {} cores; small kernel {:.2} us\n",
                machine.processor,
                machine.cores,
                1e6 * machine.calibration
            );
            put_costs(&mut text, &self.costs);
        }
        text
    }

    fn picture(&self) -> Option<Picture> {
        (!self.costs.is_empty()).then(|| chart(&self.costs))
    }
}

fn put_measures(text: &mut String, rows: &[Measured]) {
    put!(text, "\nWhen clusters are searched again, by measure\n");
    put!(
        text,
        "| scene | triangles | measure | threshold mm | searches a step | pairs | missed | deepest um |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|");
    for row in rows {
        let threshold = row.threshold.map_or_else(String::new, |m| short(1e3 * m));
        put!(
            text,
            "| {} | {} | {} | {threshold} | {} | {} | {} | {} |",
            row.scene,
            row.triangles,
            row.measure,
            short(row.searches),
            row.near,
            row.missed,
            short(1e6 * row.deepest)
        );
    }
}

fn put_hands(text: &mut String, cells: &[HandCell]) {
    put!(
        text,
        "Force at the hand, against a host that steps in every tick\n"
    );
    put!(
        text,
        "| pressed | steps Hz | models Hz | rows | peak N | largest error % | at s | RMS % | hold % | jump mN | tick mN | faults |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|---|---|---|---|");
    for cell in cells {
        let rows = cell.rows;
        put!(
            text,
            "| {} | {:.0} | {:.1} | {rows} | {:.2} | {:.2} | {:.3} | {:.2} | {:.2} | {:.1} | {:.1} | {} |",
            cell.pressed,
            cell.step_rate,
            cell.publish_rate,
            cell.peak,
            1e2 * cell.worst,
            cell.time,
            1e2 * cell.rms,
            1e2 * cell.hold,
            1e3 * cell.jump,
            1e3 * cell.tick,
            cell.faults
        );
    }
}

fn put_tools(text: &mut String, cells: &[ToolCell]) {
    put!(
        text,
        "Force of a tool, against a host that steps in every tick\n"
    );
    put!(
        text,
        "| body | motion | Hz | latency ms | peak N | RMS % | jump N | ripple N | held RMS % | plane RMS % |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|---|---|");
    for cell in cells {
        put!(
            text,
            "| {} | {} | {:.0} | {:.0} | {:.3} | {:.2} | {:.3} | {:.3} | {:.2} | {:.2} |",
            cell.body,
            cell.task,
            cell.rate,
            1e3 * cell.latency,
            cell.peak,
            1e2 * cell.rms,
            cell.jump,
            cell.ripple,
            1e2 * cell.held,
            1e2 * cell.plane
        );
    }
}

fn put_costs(text: &mut String, costs: &[Cost]) {
    put!(text, "Processor time of a step, by stage\n");
    put!(
        text,
        "| scene | triangles | rows | stage | median ms | 99.9 % ms | ns by vertex | 99.9 % | ns by row | 99.9 % |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|---|---|");
    let share = |share: Share| {
        [share.median, share.p999]
            .map(|t| short(1e9 * t))
            .join(" | ")
    };
    for cost in costs {
        let by_row = cost.by_row.map_or_else(|| " | ".to_owned(), share);
        put!(
            text,
            "| {} | {} | {} | {} | {:.3} | {:.3} | {} | {by_row} |",
            cost.scene,
            cost.triangles,
            cost.rows,
            cost.stage,
            1e3 * cost.time.median,
            1e3 * cost.time.p999,
            share(cost.by_vertex)
        );
    }
}

/// A number in three digits; counts as they are.
fn short(x: f64) -> String {
    let size = x.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        format!("{x:.1e}")
    } else if x.fract() == 0.0 || size >= 100.0 {
        format!("{x:.0}")
    } else if size >= 1.0 {
        format!("{x:.1}")
    } else {
        format!("{x:.4}")
    }
}

fn chart(costs: &[Cost]) -> Picture {
    let series = STAGES.map(|(stage, marker)| Series {
        name: stage.to_owned(),
        points: costs
            .iter()
            .filter(|cost| cost.stage == stage)
            .map(|cost| (cost.triangles as f64, 1e3 * cost.time.median))
            .collect(),
        marker,
        ..Series::default()
    });
    let panel = Panel {
        title: "Two sheets land on a plane".to_owned(),
        x_label: "Triangles".to_owned(),
        y_label: "Processor time of a step (ms)".to_owned(),
        x_scale: Scale::Logarithmic,
        y_scale: Scale::Logarithmic,
        series: series.into(),
        ..Panel::default()
    };
    plot::panels("Time of contact", "medians", 1, &[panel])
}
