//! `palpate bench extrapolation`: the force error of each scheme between publications.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::super::written::Written;
use super::with_bar;
use host::atomic_file::write_json;
use host::plot::{self, Marker, Series};
use std::path::PathBuf;
use study::extrapolation::{self, Extrapolation, Motion, RATES};

/// Arguments of `palpate bench extrapolation`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ExtrapolationArguments {
    /// Write the table as JSON as well
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the error against the publication rate (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

/// The blends that are compared: the default and the shortest.
const BLENDS: [f64; 2] = [0.5, 0.0];
/// Duration of the measured motion (s).
const DURATION: f64 = 6.0;

pub(super) fn run(arguments: &ExtrapolationArguments) -> Result<(), CommandError> {
    let _held = Declared::default()
        .file("--json", arguments.json.as_ref(), Format::Json)
        .file("--plot", arguments.plot.as_ref(), Format::Picture)
        .check()?;
    let found = with_bar(|progress| extrapolation::run(DURATION, &RATES, &BLENDS, progress))?;
    print_tables(&found);
    let mut written = Written::default();
    written.write(arguments.json.as_ref(), |path| write_json(path, &found));
    written.write(arguments.plot.as_ref(), |path| {
        plot::write_picture(path, &chart(&found))
    });
    written.end()?;
    Ok(())
}

fn print_tables(found: &Extrapolation) {
    outln!(
        "RMS force error between publications (N); 1 ms physics steps, reference published every step"
    );
    outln!(
        "peak force {:.2} N pulling apart, {:.2} N moving together; thesis: k = {:.0} N/m, k_v = {:.2} N s/m",
        found.peak[0],
        found.peak[1],
        found.thesis_gains[0],
        found.thesis_gains[1]
    );
    let resisted = found.rigid_stiffness.iter();
    let resisted: Vec<_> = resisted
        .map(|(rate, k)| format!("{k:.1} at {rate} Hz"))
        .collect();
    outln!(
        "published stiffness against hands that move together (N/m): {}",
        resisted.join(", ")
    );
    for blend in BLENDS {
        let over = if blend > 0.0 {
            "half a period (the default)"
        } else {
            "two ticks"
        };
        outln!("\nBlend into a new model over {over}:\n");
        outln!(
            "| Hz | hold, apart | thesis, apart | linear, apart | hold, together | thesis, together | linear, together |"
        );
        outln!("|---|---|---|---|---|---|---|");
        for rate in RATES {
            out!("| {rate} ");
            for motion in [Motion::Apart, Motion::Together] {
                for scheme in ["hold", "thesis", "linear"] {
                    let rms = found.rms(motion, rate, scheme, blend).unwrap_or(f64::NAN);
                    out!("| {rms:.4} ");
                }
            }
            outln!("|");
        }
    }
}

fn chart(found: &Extrapolation) -> String {
    let mut series = Vec::new();
    for motion in [Motion::Apart, Motion::Together] {
        for scheme in ["hold", "thesis", "linear"] {
            let name = match motion {
                Motion::Apart => format!("{scheme}, pulling apart"),
                Motion::Together => format!("{scheme}, moving together"),
            };
            let rms = |rate: f64| found.rms(motion, rate, scheme, BLENDS[0]);
            let points = RATES
                .iter()
                .filter_map(|r| rms(*r).map(|e| (*r, e)))
                .collect();
            series.push(Series {
                name,
                points,
                marker: Marker::Circle,
            });
        }
    }
    plot::line_chart_svg(
        "Force error between publications",
        "publication rate (Hz)",
        "RMS error (N)",
        true,
        true,
        &series,
    )
}
