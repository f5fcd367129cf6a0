//! `palpate stress wall`: maps over stiffness and damping, with the boundary in theory and the measured one.

use super::{CommandError, Common, Declared, Shown, Written, declare_devices, devices};
use host::plot::{self, Map, MapCell, MapLine, MapPanel};
use std::collections::BTreeMap;
use study::stress::devices::StudyDevice;
use study::stress::jobs::Cells;
use study::stress::wall::{self, Gain, Outcome, Panel, SCHEMES, Setting, Study, passive};

/// Arguments of `palpate stress wall`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct WallArguments {
    /// Devices to study: device files (TOML) or names of built-in devices. Each is measured at its own rate and at four
    /// times its rate. Default: the built-in devices, at 1 and 4 kHz
    #[arg(value_name = "DEVICE")]
    devices: Vec<String>,
    #[command(flatten)]
    common: Common,
    /// Rate of the map (Hz). Default: the rate of each device
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u32).range(100..=20_000))]
    rate: Option<u32>,
    /// Output delay of the map (ticks)
    #[arg(long, value_name = "TICKS", default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..=3))]
    delay: u8,
}

type Outcomes = BTreeMap<u64, Outcome>;

pub(super) fn run(arguments: &WallArguments) -> Result<(), CommandError> {
    let common = &arguments.common;
    let named = devices(&arguments.devices)?;
    named.iter().try_for_each(wall::check)?;
    let study = Study {
        devices: StudyDevice::chosen(&named)?,
        quick: common.quick,
        seed: common.cells.seed,
        map_rate: arguments.rate,
        map_delay: usize::from(arguments.delay),
    };
    let declared = declare_devices(Declared::default(), &named);
    let _held = common.declare(declared).check()?;
    let shown = Shown::new();
    let cells = study.run(&common.cells.options(), &mut |at| shown.show(at));
    let Cells { cells, unwritten } = shown.end(cells)?;
    let of = study.header().cells;
    if (cells.len() as u64) < of {
        outln!(
            "{} of {of} cells: merge the files of all shards for the rest\n",
            cells.len()
        );
    }
    print_boundaries(&cells);
    print_whole(&cells);
    print_gains(&cells, &study.devices());
    let mut written = Written::default();
    written.write(common.plot.as_ref(), |path| {
        plot::write_picture(path, &plot::map_svg(&map(&cells)))
    });
    written.and(unwritten).end()
}

/// The worst of several comparisons with theory.
#[derive(Default)]
struct Worst {
    plain: Option<[f64; 2]>,
    error: f64,
    at: f64,
    count: usize,
}

impl Worst {
    fn add(&mut self, setting: &Setting, theory: f64, measured: f64) {
        let error = measured / theory - 1.0;
        if setting.damping == 0.0 {
            self.plain = Some([theory, measured]);
        }
        if error.abs() >= self.error.abs() {
            (self.error, self.at) = (error, setting.damping / setting.device_damping);
        }
        self.count += 1;
    }

    fn columns(&self) -> String {
        let plain = self.plain.map_or(" |  | ".to_owned(), |[t, m]| {
            let [theory, measured] =
                [t, m].map(|k| format!("{k:.4}").chars().take(7).collect::<String>());
            format!("{theory} | {measured} | {:+.1}", 100.0 * (m / t - 1.0))
        });
        format!("{plain} | {:+.1} at {:.1} b", 100.0 * self.error, self.at)
    }
}

fn print_boundaries(cells: &Outcomes) {
    outln!(
        "Largest stiffness (N/m) of a plain wall, without friction and quantization; error in %."
    );
    outln!("Passive: for a stiff hand and any motion. Stable: for a typical hand.\n");
    outln!(
        "| device | rate (Hz) | delay | passive at B = 0, theory | measured | error | worst over B \
         | stable at B = 0, theory | measured | error | worst over B |"
    );
    outln!("|---|---|---|---|---|---|---|---|---|---|---|");
    let mut rows: Vec<(Setting, [Worst; 2])> = Vec::new();
    for outcome in cells.values() {
        let (setting, kind, theory, measured) = match outcome {
            Outcome::Passive {
                setting,
                theory,
                measured: Some(measured),
                ..
            } if !setting.whole => (setting, 0, theory, measured),
            Outcome::Stable {
                setting,
                theory,
                measured,
            } => (setting, 1, theory, measured),
            _ => continue,
        };
        let same = |(row, _): &(Setting, _)| {
            row.device == setting.device && (row.rate, row.delay) == (setting.rate, setting.delay)
        };
        let at = rows.iter().position(same).unwrap_or_else(|| {
            rows.push((setting.clone(), Default::default()));
            rows.len() - 1
        });
        rows[at].1[kind].add(setting, *theory, *measured);
    }
    for (setting, [passive, stable]) in &rows {
        outln!(
            "| {} | {} | {} | {} | {} |",
            setting.device,
            setting.rate,
            setting.delay,
            passive.columns(),
            stable.columns()
        );
    }
}

fn print_whole(cells: &Outcomes) {
    outln!(
        "\nLargest passive stiffness (N/m) with friction, quantization and the driver's velocity, B = 0, hands up to {} \
         m/s:\n",
        passive::SPEED
    );
    outln!(
        "| device | rate (Hz) | Abbott and Okamura, any speed | theory at this speed | measured | error |"
    );
    outln!("|---|---|---|---|---|---|");
    for outcome in cells.values() {
        if let Outcome::Passive {
            setting,
            theory,
            any_speed: Some(any_speed),
            measured,
            ..
        } = outcome
        {
            let measured = measured.unwrap_or(f64::INFINITY);
            outln!(
                "| {} | {} | {any_speed:.0} | {theory:.0} | {measured:.0} | {:+.1} |",
                setting.device,
                setting.rate,
                100.0 * (measured / theory - 1.0)
            );
        }
    }
}

fn print_gains(cells: &Outcomes, devices: &[StudyDevice]) {
    outln!(
        "\nLargest stiffness, as a multiple of the plain bound 2 b / T (with delay: over 2 d + 1), at which the adversary \
         extracts\nat most {:.0} mJ and the wall renders at least {:.0} % of the static stiffness. In brackets: the \
         largest energy found (mJ)\nup to ten times the bound. No scheme can exceed the column \"bound\" against a \
         hand that rests and leaves at once:\n",
        1e3 * wall::SAFE,
        100.0 * wall::RENDERED
    );
    let names = SCHEMES.map(|scheme| scheme.name());
    outln!(
        "| device | rate (Hz) | delay | friction, counts | motion | bound | {} |",
        names.join(" | ")
    );
    outln!("|---|---|---|---|---|---|{}", "---|".repeat(names.len()));
    let gains = wall::gains(cells);
    let key = |gain: &Gain| {
        (
            gain.device.clone(),
            gain.rate,
            gain.delay,
            gain.whole,
            gain.as_hand,
        )
    };
    let mut shown = Vec::new();
    for gain in &gains {
        let row = key(gain);
        if shown.contains(&row) {
            continue;
        }
        let columns = names.map(|name| {
            let found = gains.iter().find(|g| g.scheme == name && key(g) == row);
            found.map_or(String::new(), |gain| {
                let up_to_ten = gain.steps.iter().filter(|step| step.0 <= 10.0);
                let most = up_to_ten.fold(0.0, |most, step| f64::max(most, step.1));
                format!("{} ({:.2})", gain.times(), 1e3 * most)
            })
        });
        outln!(
            "| {} | {} | {} | {} | {} | {} | {} |",
            gain.device,
            gain.rate,
            gain.delay,
            if gain.whole { "on" } else { "off" },
            if gain.as_hand { "a hand's" } else { "any" },
            gain.of_any_scheme(devices)
                .map_or(String::new(), |most| format!("{most:.1}")),
            columns.join(" | ")
        );
        shown.push(row);
    }
}

fn map(cells: &Outcomes) -> Map {
    page(wall::panels(cells))
}

fn page(panels: Vec<Panel>) -> Map {
    let panels = panels.into_iter().map(panel).collect();
    Map {
        title: "A wall inside the tick: net energy at the port of the hand".to_owned(),
        subtitle:
            "plain sampled spring and damper; without friction and quantization; the largest net energy \
                   that the adversary found"
                .to_owned(),
        x_label: "Damping of the wall B (N s/m)".to_owned(),
        y_label: "Stiffness K (N/m)".to_owned(),
        scale_label: "Net energy (J)".to_owned(),
        below_label: "none".to_owned(),
        decades: [-7, 0],
        lines: [
            "passive: exact condition".to_owned(),
            "stable in a typical hand: eigenvalues".to_owned(),
        ],
        panels,
    }
}

fn panel(panel: Panel) -> MapPanel {
    let Setting {
        device,
        rate,
        delay,
        device_damping,
        ..
    } = &panel.setting;
    let late = match delay {
        0 => String::new(),
        1 => ", 1 tick late".to_owned(),
        d => format!(", {d} ticks late"),
    };
    let cell = |(x, y, value): &([f64; 2], [f64; 2], f64)| MapCell {
        x: *x,
        y: *y,
        value: *value,
    };
    MapPanel {
        title: format!(
            "{}, {} kHz",
            device.replace('_', " "),
            f64::from(*rate) / 1e3
        ),
        subtitle: format!("device: b = {device_damping} N s/m{late}"),
        cells: panel.cells.iter().map(cell).collect(),
        first: MapLine {
            line: panel.passive,
            points: panel.measured,
        },
        second: MapLine {
            line: panel.stable,
            points: panel.stable_measured,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::DeviceModel;

    #[test]
    fn the_titles_of_all_devices_fit() {
        for count in 1..=6 {
            let panels = DeviceModel::all().take(count).map(|(name, model)| Panel {
                setting: Setting {
                    device: name.to_owned(),
                    rate: 4000,
                    delay: 3,
                    damping: 0.0,
                    device_damping: model.damping,
                    whole: false,
                },
                cells: vec![(
                    [0.0, model.damping],
                    [0.1 * model.damping, 1e6 * model.damping],
                    1e-3,
                )],
                passive: vec![(0.0, 1e3)],
                measured: Vec::new(),
                stable: vec![(0.0, 1e4)],
                stable_measured: Vec::new(),
            });
            let svg = plot::map_svg(&page(panels.collect()));
            assert_eq!(plot::collisions(&svg), [""; 0]);
            assert!(!svg.contains('…'), "a title is cut");
        }
    }
}
