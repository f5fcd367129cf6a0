//! `palpate stress scene`: a scene under all kinds of hands, rates and faults.

use super::{CommandError, Common, progress_bar, show};
use crate::scene::Scene;
use crate::study::stress::jobs::{self, Header};
use crate::study::stress::scene::summary::{Band, Row, row};
use crate::study::stress::scene::{CellResult, SCHEMES, Study};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Arguments of `palpate stress scene`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct SceneArguments {
    /// Scene file (TOML)
    scene: PathBuf,
    /// How many worlds are drawn; each is run under every scheme
    #[arg(long, value_name = "N")]
    runs: Option<u64>,
    #[command(flatten)]
    common: Common,
}

/// Cells unless told: ten for each rate and kind of trouble, and one for each of every other.
const RUNS: u64 = 420;
const QUICK: u64 = 14;

pub(super) fn run(arguments: &SceneArguments) -> Result<(), CommandError> {
    let common = &arguments.common;
    let loaded = Scene::load(&arguments.scene)?;
    let header = Header {
        study: "scene".to_owned(),
        schema: 1,
        seed: common.seed,
        cells: arguments
            .runs
            .unwrap_or(if common.quick { QUICK } else { RUNS }),
        settings: serde_json::json!({
            "scene": loaded.source.text,
            "schemes": SCHEMES.map(|(_, name)| name),
        }),
    };
    let study = Study::new(loaded, common.seed)?;
    let bar = progress_bar();
    let work = |cell| study.cell(cell, &SCHEMES);
    let cells = jobs::run(&header, &common.options(), work, |at| show(&bar, at));
    bar.finish_and_clear();
    print_tables(&cells?);
    Ok(())
}

fn print_tables(cells: &BTreeMap<u64, CellResult>) {
    println!(
        "| Hz | scheme | runs | bounded % | net energy mJ: 99 %, most (cell) | ripple N: median, most (cell) | \
         error %: median, 90 % | without faults | under 10 % | stiffness error % |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for band in Band::all() {
        for (_, scheme) in SCHEMES {
            if let Some(row) = row(cells.iter(), scheme, band) {
                print_row(&format!("{:.0}", band.rates[0]), &row);
            }
        }
    }
}

fn print_row(first: &str, row: &Row) {
    let two = |[a, b]: [f64; 2], scale: f64| format!("{:.1}, {:.1}", scale * a, scale * b);
    println!(
        "| {first} | {} | {} | {:.1} | {:.2}, {:.2} ({}) | {:.3}, {:.2} ({}) | {} | {} | {:.0} % | {} |",
        row.scheme,
        row.runs,
        100.0 * row.bounded,
        1e3 * row.net_energy[0],
        1e3 * row.net_energy[1],
        row.worst[0],
        row.ripple[0],
        row.ripple[1],
        row.worst[1],
        two(row.error, 100.0),
        two(row.untroubled, 100.0),
        100.0 * row.unnoticed,
        two(row.stiffness, 100.0),
    );
}
