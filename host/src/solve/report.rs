//! A solution as text for people.

use super::result::{BodySolution, PairSolution, Reaction, Solution};
use crate::scene::spec::Analysis;
use crate::scene::spec::body::LawName;
use crate::scene::spec::solve::TimeScheme;
use crate::world::Kind;
use std::fmt;

impl fmt::Display for Solution {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let analysis = match (self.analysis, self.scheme) {
            (Analysis::Static, _) => "equilibrium",
            (Analysis::Dynamic, Some(TimeScheme::ImplicitEuler)) => "motion, implicit Euler",
            (Analysis::Dynamic, _) => "motion, TR-BDF2",
        };
        writeln!(to, "{}: {analysis}", self.scene)?;
        for body in &self.bodies {
            write_body(to, body, self.analysis)?;
        }
        for PairSolution { between, steps } in &self.contacts {
            let Some(last) = steps.last().filter(|last| last.count > 0) else {
                continue;
            };
            writeln!(
                to,
                "  {:<10} {} and {}: {} contacts, normal forces {}, friction {}, force {} N on {}, at most {} deep",
                "contact",
                between[0],
                between[1],
                last.count,
                si(last.normal, "N"),
                si(last.friction, "N"),
                vector(last.force, 1e-9 * last.normal),
                between[0],
                si(last.depth, "m"),
            )?;
        }
        for failure in &self.failures {
            writeln!(to, "  not solved {failure}")?;
        }
        Ok(())
    }
}

fn write_body(to: &mut fmt::Formatter<'_>, body: &BodySolution, analysis: Analysis) -> fmt::Result {
    write_mesh(to, body)?;
    write_steps(to, body, analysis)?;
    write_forces(to, body)?;
    write_extremes(to, body, analysis)
}

/// The kind and number of the elements, the law, the unknowns, the mass.
fn write_mesh(to: &mut fmt::Formatter<'_>, body: &BodySolution) -> fmt::Result {
    let elements = match (body.kind, body.vertices_of_element) {
        (Kind::Sheet, _) => "triangles",
        (Kind::Woven, _) => "woven triangles",
        (Kind::Solid, 10) => "quadratic tetrahedra",
        (Kind::Solid, _) => "tetrahedra",
        (Kind::Thread, _) => "bars",
    };
    let law = match body.law {
        LawName::Linear => "linear",
        LawName::Corotational => "corotational",
        LawName::StVenantKirchhoff => "St. Venant-Kirchhoff",
        LawName::StableNeoHookean => "stable neo-Hookean",
    };
    writeln!(
        to,
        "  {:<10} {} {elements}, {law}; {} vertices, {} unknowns, {}",
        body.name,
        body.elements,
        body.vertices,
        body.unknowns,
        si(body.mass * 1e3, "g"),
    )
}

/// The steps and iterations of the solver, and its residual.
fn write_steps(
    to: &mut fmt::Formatter<'_>,
    body: &BodySolution,
    analysis: Analysis,
) -> fmt::Result {
    let settled = body.steps.iter().any(|row| row.stage.is_some());
    let steps = body.steps.len() - usize::from(settled);
    let sum = |pick: fn(&super::Row) -> usize| body.steps.iter().map(pick).sum::<usize>();
    let residual = body.steps.iter().map(|row| row.residual);
    writeln!(
        to,
        "    {:<10} {}{}, {} substeps, {} refused; {} iterations; {}",
        "solve",
        if settled { "weight first, then " } else { "" },
        match (analysis, steps) {
            (Analysis::Static, 1) => "1 load step".to_owned(),
            (Analysis::Static, _) => format!("{steps} load steps"),
            (Analysis::Dynamic, 1) => "1 time step".to_owned(),
            (Analysis::Dynamic, _) => format!("{steps} time steps"),
        },
        sum(|row| row.substeps),
        sum(|row| row.refused),
        sum(|row| row.iterations),
        match residual.fold(0.0, f64::max) {
            0.0 => "no residual above rounding".to_owned(),
            most => format!("residual at most {most:.1e} of the forces"),
        },
    )?;
    let snaps = || body.steps.iter().filter(|row| row.snapped.is_some());
    if let Some((row, at)) = snaps().find_map(|row| row.snapped.map(|at| (row, at))) {
        let place = match row.stage {
            // Rest is at -1, and the settled state is at 0.
            Some(_) => format!("{:.4} of its weight alone", at + 1.0),
            None => format!("{at:.4} of the loads"),
        };
        let more = match snaps().count() {
            1 => String::new(),
            count => format!(", and in {} later steps", count - 1),
        };
        writeln!(
            to,
            "    {:<10} the body snapped to another balance before {place}{more}: the way of the body there is a motion, \
             and another balance may be found with other steps",
            "snapped"
        )?;
    }
    let open = body.steps.iter().filter_map(|row| row.open);
    let open = open.fold(0.0, f64::max);
    if open > 0.0 {
        writeln!(
            to,
            "    {:<10} limited by rounding: {open:.1e} m of the motion are undetermined",
            "digits"
        )?;
    }
    Ok(())
}

/// The reactions of handles and supports, and the applied force.
fn write_forces(to: &mut fmt::Formatter<'_>, body: &BodySolution) -> fmt::Result {
    // Rounding errors of forces of this size, and of their moments about points one metre away.
    let forces = body.reactions.iter().map(|reaction| reaction.force);
    let forces = forces.chain([body.applied]).flatten();
    let noise = 1e-9 * forces.fold(0.0, |most: f64, x| most.max(x.abs()));
    for Reaction {
        name,
        by,
        force,
        moment,
    } in &body.reactions
    {
        write!(to, "    {name:<10} {by}: force {} N", vector(*force, noise))?;
        if let Some(moment) = moment {
            write!(to, ", moment {} N m", vector(*moment, noise))?;
        }
        writeln!(to)?;
    }
    writeln!(
        to,
        "    {:<10} force {} N, weight and loads",
        "applied",
        vector(body.applied, noise)
    )
}

/// The largest displacement and stress, the energy, the inverted elements.
fn write_extremes(
    to: &mut fmt::Formatter<'_>,
    body: &BodySolution,
    analysis: Analysis,
) -> fmt::Result {
    writeln!(
        to,
        "    {:<10} displacement at most {} (vertex {}); von Mises stress at most {} (element {})",
        "extremes",
        si(body.displacement.value, "m"),
        body.displacement.at,
        si(body.von_mises.value, "Pa"),
        body.von_mises.at,
    )?;
    write!(
        to,
        "    {:<10} {} elastic",
        "energy",
        si(body.elastic_energy, "J")
    )?;
    if analysis == Analysis::Dynamic {
        write!(to, ", {} kinetic", si(body.kinetic_energy, "J"))?;
    }
    writeln!(to)?;
    if body.inverted > 0 {
        let count = body.inverted;
        writeln!(to, "    {:<10} {count} elements", "inverted")?;
    }
    Ok(())
}

/// A vector as text. An entry below a millionth of the largest entry is printed as zero, and so is a vector below
/// `noise`: such numbers are rounding errors. The JSON output contains them.
fn vector(v: [f64; 3], noise: f64) -> String {
    let most = v.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let part = |x: f64| {
        let x = if x.abs() < 1e-6 * most { 0.0 } else { x };
        let digits = (4.0 - most.log10().floor()).clamp(0.0, 12.0) as usize;
        format!("{x:.digits$}")
    };
    if most <= noise {
        return "(0, 0, 0)".to_owned();
    }
    format!("({}, {}, {})", part(v[0]), part(v[1]), part(v[2]))
}

/// A value with four digits and an SI prefix.
pub(crate) fn si(value: f64, unit: &str) -> String {
    const PREFIXES: [(f64, &str); 8] = [
        (1e9, "G"),
        (1e6, "M"),
        (1e3, "k"),
        (1.0, ""),
        (1e-3, "m"),
        (1e-6, "u"),
        (1e-9, "n"),
        (1e-12, "p"),
    ];
    let size = value.abs();
    let fits = PREFIXES.iter().find(|(scale, _)| size >= 0.99995 * scale);
    match fits {
        Some((scale, prefix)) => {
            let value = value / scale;
            let digits = (3.0 - value.abs().max(1.0).log10().floor()).clamp(0.0, 3.0) as usize;
            format!("{value:.digits$} {prefix}{unit}")
        }
        None => format!("0 {unit}"),
    }
}
