//! `palpate stress hold`: presses, holds, slow rubs and tremors on bodies of every kind.

use super::scene::{cell, log, write_scene};
use super::{CommandError, Common, Declared, Format, Values, Written, judged, number, scheme_of};
use crate::{build, progress_bar};
use host::atomic_file::write_atomically;
use host::plot::write_picture;
use host::scene::spec::SchemeName;
use std::collections::BTreeMap;
use std::path::PathBuf;
use study::stress::hold::verdict::{Failure, failures};
use study::stress::hold::{Holds, SCHEMES, Study, holds, judge};
use study::stress::scene::picture;

/// Arguments of `palpate stress hold`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct HoldArguments {
    /// Judge this scene file (TOML) with its own hands, instead of the cells of the study
    #[arg(conflicts_with_all = ["runs", "cell", "quick", "seed", "shard", "json", "plot"])]
    file: Option<PathBuf>,
    #[command(flatten)]
    values: Values,
    /// Number of cells: the fixed cases first, then random draws. Each cell is run under linear and capped
    #[arg(long, value_name = "N", value_parser = super::cells)]
    runs: Option<u64>,
    /// Run one cell again and print its outcome: --plot draws the cell, --log writes every tick, --write writes its
    /// scene file
    #[arg(long, value_name = "N", conflicts_with_all = ["runs", "quick", "shard", "json"])]
    cell: Option<u64>,
    /// Scheme of the cell: linear or capped. Default: capped
    #[arg(long, value_name = "NAME", requires = "cell", value_parser = scheme)]
    scheme: Option<SchemeName>,
    /// Write every tick of the cell (CSV)
    #[arg(long, value_name = "FILE", requires = "cell")]
    log: Option<PathBuf>,
    /// Write the scene of the cell, which `palpate run` repeats (TOML)
    #[arg(long, value_name = "FILE", requires = "cell")]
    write: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

/// Default number of cells, and that of a quick study: the cases, and each specimen on each device.
const RUNS: [u64; 2] = [2000, 84];

fn scheme(text: &str) -> Result<SchemeName, String> {
    scheme_of(text, &SCHEMES)
}

pub(super) fn run(arguments: &HoldArguments) -> Result<(), CommandError> {
    let common = &arguments.common;
    if let Some(path) = &arguments.file {
        let loaded = arguments.values.load(Some(path), Vec::new())?;
        // This prints the warnings of the meshes.
        build(&loaded, &progress_bar())?;
        let cell = judge(loaded)?;
        if cell.moves {
            outln!("a hand moves in the last second; the hold is not judged");
        }
        let cells = BTreeMap::from([(0, cell)]);
        out!("{}", holds::listed(&cells));
        return judged(&holds::verdict(&cells), cells.len());
    }
    let declared = Declared::default()
        .file("--log", arguments.log.as_ref(), Format::Csv)
        .file("--write", arguments.write.as_ref(), Format::Toml);
    let _held = common.declare(declared).check()?;
    let study = Study::new(common.cells.seed);
    if let Some(cell) = arguments.cell {
        return show_cell(arguments, study, cell);
    }
    common.run(&Holds {
        study,
        cells: number(arguments.runs, common.quick, RUNS),
    })
}

/// Runs one cell under one scheme and prints its outcome.
fn show_cell(arguments: &HoldArguments, study: Study, cell: u64) -> Result<(), CommandError> {
    let wanted = arguments.scheme.unwrap_or(SchemeName::Capped);
    if let Some(path) = &arguments.write {
        write_scene(path, &study.written(cell, wanted)?)?;
    }
    // The verdict compares with `linear`.
    let mut schemes: Vec<_> = SCHEMES.into_iter().collect();
    schemes.retain(|(name, _)| *name == wanted || *name == SchemeName::Linear);
    schemes.sort_by_key(|(name, _)| *name != wanted);
    let names: Vec<_> = schemes.iter().map(|(scheme, _)| *scheme).collect();
    let traces = study.traces(cell, &names)?;
    let result = study.result(cell, &traces, &schemes);
    let title = match (&result.draw, &result.case) {
        (Some(draw), _) => {
            cell::print_specimen(cell, arguments.common.cells.seed, draw);
            format!(
                "Cell {cell}: {}, {}",
                draw.kind.name(),
                draw.hands[0].device
            )
        }
        (None, case) => {
            let title = format!("Cell {cell}: {}", case.as_deref().unwrap_or_default());
            outln!("{title}");
            title
        }
    };
    if let (Some(run), Some((_, scheme))) = (traces.runs.first(), schemes.first()) {
        let outcome = &result.schemes[*scheme];
        let failed: Vec<_> = failures(&result, scheme)
            .into_iter()
            .map(Failure::name)
            .collect();
        let verdict = if failed.is_empty() {
            "within all limits".to_owned()
        } else {
            format!("beyond the limits of {}", failed.join(", "))
        };
        cell::print_outcome(&format!("{scheme}: {verdict}"), outcome, &traces.reference);
        outln!("  one count  changes the force by {:.3} N", traces.count);
        let mut written = Written::default();
        written.write(arguments.common.plot.as_ref(), |path| {
            let subtitle = format!(
                "\"{scheme}\": hold error {:.1} %, run error {:.1} % of the peak, ripple {:.3} N, capped {:.1} %",
                100.0 * outcome.force_errors.hold_error,
                100.0 * outcome.force_errors.run_error,
                outcome.force_errors.worst_ripple,
                100.0 * outcome.capped
            );
            let svg = picture::cell(&title, &subtitle, run, &traces.reference);
            write_picture(path, &svg)
        });
        written.write(arguments.log.as_ref(), |path| {
            write_atomically(path, log(run, &traces.reference).as_bytes())
        });
        written.end()?;
    }
    Ok(())
}
