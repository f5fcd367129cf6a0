//! The tables and the pictures of the study.

use super::TearingStudy;
use super::edits::Mesh;
use super::energy::Account;
use super::kinks::Kink;
use super::meshes::{MeshStudy, Tear};
use super::notches::Notch;
use super::running::{self, Run};
use super::smooth::Smooth;
use super::strength::Strip;
use super::trousers::Trousers;
use crate::Results;
use host::plot::{self, Marker, Picture, Role, Series};

impl Results for TearingStudy {
    fn tables(&self) -> String {
        let mut all = String::new();
        let text = &mut all;
        if let Some(mesh) = &self.mesh {
            put_mesh(text, mesh);
        }
        if let Some(runs) = &self.running {
            put_running(text, runs);
        }
        if let Some(cloths) = &self.smooth {
            put_smooth(text, cloths);
        }
        if let Some(kinks) = &self.path {
            put_path(text, kinks);
        }
        if let Some(trousers) = &self.trousers {
            put_trousers(text, trousers);
        }
        if let Some(notches) = &self.notches {
            put_notches(text, notches);
        }
        if let Some(strips) = &self.strength {
            put_strength(text, strips);
        }
        if let Some(accounts) = &self.energy {
            put_energy(text, accounts);
        }
        if let Some(meshes) = &self.meshes {
            put_meshes(text, meshes);
        }
        all
    }

    fn picture(&self) -> Option<Picture> {
        let mesh = self.mesh.as_ref().map(|mesh| chart(&mesh.tears));
        let running = || self.running.as_deref().map(running_chart);
        let smooth = || self.smooth.as_deref().map(smooth_chart);
        mesh.or_else(running).or_else(smooth)
    }
}

fn put_mesh(text: &mut String, found: &MeshStudy) {
    put!(
        text,
        "Mesh independence: a notched cloth in two hands; its toughness is {} J/m²\n",
        found.toughness
    );
    put!(
        text,
        "| law | pattern | triangles | peak N | mean force N | tear mm | energy J/m² | off the line, edges |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|");
    for tear in &found.tears {
        put!(
            text,
            "| `{}` | {} | {} | {:.3} | {:.3} | {:.1} | {:.0} | {:.2} |",
            tear.law,
            tear.pattern,
            tear.triangles,
            tear.peak,
            tear.plateau,
            1e3 * tear.length,
            tear.energy,
            tear.strayed
        );
    }
    put!(text, "\nLargest deviation from the mean over all meshes\n");
    put!(text, "| law | mean force | energy |");
    put!(text, "|---|---|---|");
    for spread in &found.spreads {
        put!(
            text,
            "| `{}` | {:.1} % | {:.1} % |",
            spread.law,
            100.0 * spread.plateau,
            100.0 * spread.energy
        );
    }
    put!(
        text,
        "\nLong clamped strips: the strain at which the tear starts\n"
    );
    put!(text, "| pattern | triangles | exact | found | error |");
    put!(text, "|---|---|---|---|---|");
    for start in &found.starts {
        put!(
            text,
            "| {} | {} | {:.4} | {:.4} | {:+.1} % |",
            start.pattern,
            start.triangles,
            start.exact,
            start.found,
            100.0 * start.error()
        );
    }
    put!(text);
}

fn put_trousers(text: &mut String, trousers: &[Trousers]) {
    put!(
        text,
        "Trousers: the force of a hand over the formula, its ripple over its mean, and the drift of the tear\n"
    );
    put!(
        text,
        "| mesh | triangles | thickness mm | force | ripple | drift mm |"
    );
    put!(text, "|---|---|---|---|---|---|");
    for test in trousers {
        let force = test.relative().map_or_else(
            || "rests | ".to_owned(),
            |[force, ripple]| format!("{force:.3} | {:.1} %", 100.0 * ripple),
        );
        put!(
            text,
            "| {} | {} | {} | {force} | {:.1} |",
            test.pattern,
            test.triangles,
            1e3 * test.thickness,
            1e3 * test.drift
        );
    }
    put!(text);
}

/// The smallest and the largest of some values.
fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold(
        [f64::INFINITY, f64::NEG_INFINITY],
        |[least, most], value| [least.min(value), most.max(value)],
    )
}

fn put_path(text: &mut String, kinks: &[Kink]) {
    put!(
        text,
        "Start and kink of a crack, by the angle between crack and pull: the load at the first edge over that of the largest \
         hoop stress; directions at the two tips (degrees)\n"
    );
    put!(
        text,
        "| mesh | edges of the crack | load | start | exact kink | by intensities | first edges | exact behind the kink | \
         second edges |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|---|");
    let both = |[left, right]: [f64; 2]| format!("{left:.1}, {right:.1}");
    for kink in kinks {
        put!(
            text,
            "| {} | {} | {} | {:.3} | {:.1} | {} | {} | {:.1} | {} |",
            kink.pattern,
            kink.edges,
            kink.load,
            kink.start,
            kink.exact[0],
            both(kink.found),
            both(kink.first),
            kink.exact[1],
            both(kink.second)
        );
    }
    put!(
        text,
        "\nThe worst by the edges of the crack: start, and errors of the directions (degrees)\n"
    );
    put!(
        text,
        "| mesh | edges of the crack | start | by intensities | first edges | second edges |"
    );
    put!(text, "|---|---|---|---|---|---|");
    for same in kinks.chunk_by(|a, b| (&a.pattern, a.edges) == (&b.pattern, b.edges)) {
        let Some(first) = same.first() else {
            continue;
        };
        let [least, most] = extent(same.iter().map(|kink| kink.start));
        let errors = [0, 1, 2].map(|place| extent(same.iter().map(|kink| kink.errors()[place]))[1]);
        put!(
            text,
            "| {} | {} | {least:.3} to {most:.3} | {:.1} | {:.1} | {:.1} |",
            first.pattern,
            first.edges,
            errors[0],
            errors[1],
            errors[2]
        );
    }
    put!(text);
}

fn put_notches(text: &mut String, notches: &[Notch]) {
    put!(
        text,
        "Error of the load at which a tear starts, by the length of its notch or slit in edges\n"
    );
    let mut lengths: Vec<u32> = notches.iter().map(|notch| notch.edges).collect();
    lengths.sort_unstable();
    lengths.dedup();
    let heads: Vec<String> = lengths.iter().map(u32::to_string).collect();
    put!(text, "| mesh | kind | {} |", heads.join(" | "));
    put!(text, "|---|---|{}", "---|".repeat(lengths.len()));
    let mut rows: Vec<(&str, &str)> = Vec::new();
    for notch in notches {
        let row = (&*notch.mesh, notch.kind);
        if rows.contains(&row) {
            continue;
        }
        rows.push(row);
        let cells = lengths.iter().map(|&edges| {
            let mut all = notches.iter();
            let found = all.find(|n| (&*n.mesh, n.kind) == row && n.edges == edges);
            found.map_or_else(String::new, |n| format!("{:+.1} %", 100.0 * n.error()))
        });
        put!(
            text,
            "| {} | {} | {} |",
            row.0,
            row.1,
            cells.collect::<Vec<_>>().join(" | ")
        );
    }
    put!(text);
}

fn put_strength(text: &mut String, strips: &[Strip]) {
    put!(
        text,
        "Strips without a notch: the largest force over strength times section\n"
    );
    put!(
        text,
        "| mesh | Poisson's ratio | width mm | toughness J/m² | largest force | parted | tears | torn area in sections |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|");
    for strip in strips {
        put!(
            text,
            "| {} | {} | {} | {} | {:.3} | {} | {} | {:.2} |",
            strip.pattern,
            strip.poisson,
            1e3 * strip.width,
            strip.toughness,
            strip.peak,
            if strip.parted { "yes" } else { "no" },
            strip.tears,
            strip.torn
        );
    }
    let [least, most] = extent(strips.iter().map(|strip| strip.peak));
    let parted = strips.iter().filter(|strip| strip.parted).count();
    put!(
        text,
        "\n{} strips: largest force {least:.3} to {most:.3}; {parted} parted\n",
        strips.len()
    );
}

fn put_smooth(text: &mut String, cloths: &[Smooth]) {
    put!(
        text,
        "Force of a hand that tears a cloth from a tenth to nine tenths of its way: mean, and ripple\n"
    );
    put!(
        text,
        "| mesh | edges mm | Hz | damping ms | mean force N | ripple |"
    );
    put!(text, "|---|---|---|---|---|---|");
    let percent = |ripple: f64| format!("{:.2} %", 100.0 * ripple);
    let rests = || "rests".to_owned();
    for cloth in cloths {
        put!(
            text,
            "| {} | {} | {} | {} | {} | {} |",
            cloth.mesh,
            1e3 * cloth.edge,
            cloth.rate,
            1e3 * cloth.damping,
            cloth
                .plateau
                .map_or_else(rests, |force| format!("{force:.3}")),
            cloth.ripple.map_or_else(rests, percent)
        );
    }
    put!(text);
    for cloths in cloths.chunk_by(|a, b| (&a.mesh, a.edge) == (&b.mesh, b.edge)) {
        let Some(first) = cloths.first() else {
            continue;
        };
        let [least, most] = extent(cloths.iter().filter_map(|cloth| cloth.plateau));
        let [_, ripple] = extent(cloths.iter().filter_map(|cloth| cloth.ripple));
        put!(
            text,
            "{}, edges of {} mm: {} cloths, mean force {least:.3} to {most:.3} N ({:.1} %), ripple up to {}",
            first.mesh,
            1e3 * first.edge,
            cloths.len(),
            200.0 * (most - least) / (most + least),
            percent(ripple)
        );
    }
    put!(text);
}

/// The force over the displacement: a line for each damping on each mesh, at the smallest number of steps a second that
/// all meshes have.
fn smooth_chart(cloths: &[Smooth]) -> Picture {
    let rate = cloths.last().map_or(0.0, |last| {
        let same = cloths.iter().filter(|cloth| cloth.mesh == last.mesh);
        same.map(|cloth| cloth.rate).fold(f64::INFINITY, f64::min)
    });
    let drawn = cloths.iter().filter(|cloth| cloth.rate == rate);
    let lines = drawn.enumerate().map(|(place, cloth)| {
        // There are six looks of lines. Marks tell the lines of a third mesh from those of the first.
        let (marker, every) = match place {
            ..6 => (Marker::None, 1),
            _ => (Marker::by_place(place), 8),
        };
        Series {
            name: format!(
                "{}, {} mm, damping {} ms",
                cloth.mesh,
                1e3 * cloth.edge,
                1e3 * cloth.damping
            ),
            points: (cloth.course.iter().step_by(every))
                .map(|[opening, force]| (1e3 * opening, *force))
                .collect(),
            marker,
            role: Role::Number(place),
            ..Series::default()
        }
    });
    plot::line_chart(
        "Two hands tear a cloth",
        "Hands apart (mm)",
        "Force of a hand (N)",
        false,
        false,
        &lines.collect::<Vec<_>>(),
    )
}

fn put_running(text: &mut String, runs: &[Run]) {
    put!(
        text,
        "Displacement of a clamped strip over the exact one, at the first edge and where parts of the strip are torn\n"
    );
    let parts: Vec<String> = running::TORN
        .iter()
        .map(|part| format!("{:.0} %", 100.0 * part))
        .collect();
    put!(
        text,
        "| mesh | edges across | Hz | damping ms | toughness J/m² | first edge | {} | work / (G_c t A) |",
        parts.join(" | ")
    );
    put!(
        text,
        "|---|---|---|---|---|---|{}---|",
        "---|".repeat(parts.len())
    );
    let value = |value: Option<f64>| {
        value.map_or_else(|| "rests".to_owned(), |value| format!("{value:.3}"))
    };
    for run in runs {
        let torn: Vec<String> = run.displacement.iter().copied().map(value).collect();
        put!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            run.mesh,
            run.across,
            run.rate,
            1e3 * run.damping,
            run.toughness,
            value(run.start),
            torn.join(" | "),
            value(run.work)
        );
    }
    let all = || runs.iter().flat_map(|run| run.displacement);
    let rests = all().filter(Option::is_none).count();
    let [least, most] =
        [f64::min, f64::max].map(|of: fn(f64, f64) -> f64| all().flatten().reduce(of));
    let [less, more] = [f64::min, f64::max]
        .map(|of: fn(f64, f64) -> f64| runs.iter().filter_map(|run| run.work).reduce(of));
    put!(
        text,
        "\n{} strips: displacement {} to {}, work {} to {}; {rests} rest\n",
        runs.len(),
        value(least),
        value(most),
        value(less),
        value(more)
    );
}

/// Most lines of a chart.
const MOST_LINES: usize = 9;

/// The displacement over the torn part: a line for each strip of three meshes with the most edges up to 10 and steps
/// of a millisecond.
fn running_chart(runs: &[Run]) -> Picture {
    let drawn = runs.iter().filter(|run| {
        let is_drawn = ["0°", "scattered", "Frontal"].contains(&&*run.mesh);
        is_drawn && run.across <= 10 && run.rate >= 1000.0
    });
    let skipped = drawn.clone().count().saturating_sub(MOST_LINES);
    let lines = drawn.skip(skipped).enumerate().map(|(place, run)| {
        let start = run.start.map(|start| (0.0, start));
        let torn = running::TORN.iter().zip(run.displacement);
        Series {
            name: format!("{}, damping {} ms", run.mesh, 1e3 * run.damping),
            points: (start.into_iter())
                .chain(torn.filter_map(|(part, at)| Some((100.0 * part, at?))))
                .collect(),
            marker: Marker::by_place(place),
            role: Role::Number(place),
            ..Series::default()
        }
    });
    plot::line_chart(
        "A tear through a clamped strip",
        "Torn part (%)",
        "Displacement over the exact one",
        false,
        false,
        &lines.collect::<Vec<_>>(),
    )
}

fn put_energy(text: &mut String, accounts: &[Account]) {
    type Term = (&'static str, fn(&Account) -> f64);
    let terms: [Term; 13] = [
        ("supplied", |a| a.supplied),
        ("stored: kinetic, elastic, weight", |a| a.stored),
        ("damping", |a| a.damping),
        ("toughness times torn area", |a| a.due),
        ("of it, still to be taken", |a| a.pending),
        ("of it, into motion and damping at the tip", |a| a.slackened),
        ("taken by letting go", |a| a.released),
        ("edits (source)", |a| a.edits),
        ("implicit Euler", |a| a.integrator),
        ("linearization", |a| a.linearization),
        ("guard (source)", |a| a.guard),
        ("solver (source)", |a| a.solver),
        ("missing", |a| a.missing() * a.supplied),
    ];
    put!(text, "Energy of a whole tear (mJ)\n");
    let heads: Vec<String> = accounts
        .iter()
        .map(|a| format!("{}, {} triangles", a.pattern, a.triangles))
        .collect();
    put!(text, "| term | {} |", heads.join(" | "));
    put!(text, "|---|{}", "---|".repeat(accounts.len()));
    for (name, term) in terms {
        let cells: Vec<String> = accounts
            .iter()
            .map(|a| format!("{:.4}", 1e3 * term(a)))
            .collect();
        put!(text, "| {name} | {} |", cells.join(" | "));
    }
    let cells: Vec<String> = accounts
        .iter()
        .map(|a| format!("{:+.3} %", 100.0 * a.missing()))
        .collect();
    put!(text, "| missing of supplied | {} |", cells.join(" | "));
    let cells: Vec<String> = accounts
        .iter()
        .map(|a| format!("{:.0e}", a.rounding()))
        .collect();
    put!(
        text,
        "| the same with what letting go took | {} |\n",
        cells.join(" | ")
    );
}

fn put_meshes(text: &mut String, meshes: &[Mesh]) {
    put!(
        text,
        "Meshes: what a tear adds, by the largest snap (as a fraction of an edge)\n"
    );
    put!(
        text,
        "| pattern | snapping | triangles | added | opened | cut | snapped | smallest angle before, after | off the line, \
         edges | mass | area | momentum | inverted |"
    );
    put!(
        text,
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|"
    );
    for mesh in meshes {
        let [opened, cut, snapped] = mesh.counts;
        put!(
            text,
            "| {} | {} | {} | {} | {opened} | {cut} | {snapped} | {:.1}°, {:.1}° | {:.2} | {:.0e} | {:.0e} | {:.0e} | {} |",
            mesh.pattern,
            mesh.snapping,
            mesh.triangles[0],
            mesh.triangles[1],
            mesh.angles[0],
            mesh.angles[1],
            mesh.strayed,
            mesh.errors.mass,
            mesh.errors.area,
            mesh.errors.momentum,
            mesh.errors.inverted
        );
    }
    put!(text);
}

/// The mean force against the number of triangles: a line for each law and pattern.
fn chart(tears: &[Tear]) -> Picture {
    let mut drawn: Vec<Series> = Vec::new();
    let lines = tears.chunk_by(|a, b| (a.law, &a.pattern) == (b.law, &b.pattern));
    for (place, line) in lines.enumerate() {
        let Some(first) = line.first() else {
            continue;
        };
        drawn.push(Series {
            name: format!("{}, {}", first.law, first.pattern),
            points: line
                .iter()
                .map(|tear| (tear.triangles as f64, tear.plateau))
                .collect(),
            marker: Marker::by_place(place),
            role: Role::Number(place),
            ..Series::default()
        });
    }
    plot::line_chart(
        "Mean force of a tear",
        "Triangles",
        "Force of a hand (N)",
        true,
        false,
        &drawn,
    )
}
