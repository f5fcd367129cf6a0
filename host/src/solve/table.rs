//! The steps of a solution as a table: a row for each step, and the columns of all bodies beside each other.

use super::result::{Extreme, PairRow, PairSolution, Row, Solution};
use crate::scene::spec::Analysis;
use crate::table::{Columns, Line};

impl Solution {
    /// The table of the steps as CSV. A body that was not solved to the end has `NaN` in the rows that it lacks.
    pub fn csv(&self) -> String {
        let mut text = self.columns().header();
        let mut line = Line::default();
        let steps = self.bodies.iter().map(|body| body.steps.len()).max();
        for step in 0..steps.unwrap_or(0) {
            let row = self.bodies.iter().find_map(|body| body.steps.get(step));
            let Some(row) = row else { break };
            line.clear();
            line.whole(step as u64 + 1);
            if self.analysis == Analysis::Dynamic {
                line.number(row.at);
            }
            line.number(row.fraction);
            for body in &self.bodies {
                write_body(&mut line, body.steps.get(step), &body.driven);
            }
            for pair in &self.contacts {
                write_pair(&mut line, pair.steps.get(step));
            }
            text.push_str(line.end());
        }
        text
    }

    fn columns(&self) -> Columns {
        let mut columns = Columns::default();
        columns.add("", "step");
        if self.analysis == Analysis::Dynamic {
            columns.add("", "time_s");
        }
        columns.add("", "fraction");
        for body in &self.bodies {
            for reaction in &body.reactions {
                let name = format!("{}_{}", body.name, reaction.name);
                columns.vector(&name, "displacement", "m");
                columns.vector(&name, "force", "N");
                columns.vector(&name, "moment", "Nm");
            }
            for quantity in [
                "elastic_energy_J",
                "kinetic_energy_J",
                "largest_displacement_m",
                "largest_displacement_vertex",
                "largest_von_mises_Pa",
                "largest_von_mises_element",
                "iterations",
                "residual",
            ] {
                columns.add(&body.name, quantity);
            }
        }
        for PairSolution { between, .. } in &self.contacts {
            let name = format!("{}_{}_contact", between[0], between[1]);
            for quantity in ["count", "normal_N", "friction_N", "depth_m"] {
                columns.add(&name, quantity);
            }
            columns.vector(&name, "force", "N");
        }
        columns
    }
}

/// The columns of the contacts of a pair.
fn write_pair(line: &mut Line, row: Option<&PairRow>) {
    let Some(row) = row else {
        return line.numbers([f64::NAN; 7]);
    };
    line.whole(row.count as u64);
    line.numbers([row.normal, row.friction, row.depth]);
    line.numbers(row.force);
}

/// The columns of one body. `driven`: the displacement of each part that gives a reaction, at the end (m).
fn write_body(line: &mut Line, row: Option<&Row>, driven: &[[f64; 3]]) {
    const NONE: [f64; 3] = [f64::NAN; 3];
    for (index, displacement) in driven.iter().enumerate() {
        let vectors = match row {
            Some(row) => [
                displacement.map(|along| along * row.fraction),
                row.forces.get(index).copied().unwrap_or(NONE),
                row.moments.get(index).copied().flatten().unwrap_or(NONE),
            ],
            None => [NONE; 3],
        };
        line.numbers(vectors.into_iter().flatten());
    }
    let Some(row) = row else {
        return line.numbers([f64::NAN; 8]);
    };
    line.number(row.elastic_energy);
    line.number(row.kinetic_energy);
    for Extreme { value, at } in [row.displacement, row.von_mises] {
        line.number(value);
        line.whole(at as u64);
    }
    line.whole(row.iterations as u64);
    line.number(row.residual);
}
