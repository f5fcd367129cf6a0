//! `palpate stress wall`: maps over stiffness and damping, with the theory's line beside what was measured.

use super::{CommandError, Common, progress_bar, show};
use crate::study::stress::jobs::{self, Header};
use crate::study::stress::wall;
use serde::{Deserialize, Serialize};
use sim::DeviceModel;

/// Arguments of `palpate stress wall`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct WallArguments {
    #[command(flatten)]
    common: Common,
}

#[derive(Serialize, Deserialize)]
struct Bound {
    bound: f64,
}

pub(super) fn run(arguments: &WallArguments) -> Result<(), CommandError> {
    let common = &arguments.common;
    let models: Vec<_> = DeviceModel::all().collect();
    let header = Header {
        study: "wall".to_owned(),
        schema: 1,
        seed: common.seed,
        cells: models.len() as u64,
        settings: serde_json::json!({"quick": common.quick}),
    };
    let work = |cell: u64| {
        let (_, model) = models[cell as usize];
        Bound {
            bound: wall::plain_bound(model.damping, 1.0 / f64::from(model.rate_hz)),
        }
    };
    let bar = progress_bar();
    let cells = jobs::run(&header, &common.options(), work, |at| show(&bar, at));
    bar.finish_and_clear();
    println!("| device | rate (Hz) | 2 b / T (N/m) |");
    println!("|---|---|---|");
    for (cell, Bound { bound }) in cells? {
        let (name, model) = models[cell as usize];
        println!("| {name} | {} | {bound:.0} |", model.rate_hz);
    }
    Ok(())
}
