//! The tables of the study.

use super::{Gain, Outcome, RENDERED, SAFE, SCHEMES, Setting, passive};
use crate::stress::devices::StudyDevice;
use std::collections::BTreeMap;

type Outcomes = BTreeMap<u64, Outcome>;

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

/// The boundaries of passivity and stability without friction and counts.
pub(super) fn boundaries(text: &mut String, cells: &Outcomes) {
    put!(
        text,
        "Largest stiffness (N/m) of a plain wall, without friction and quantization; error in %."
    );
    put!(
        text,
        "Passive: for a stiff hand and any motion. Stable: for a typical hand.\n"
    );
    put!(
        text,
        "| device | rate (Hz) | delay | passive at B = 0, theory | measured | error | worst over B \
         | stable at B = 0, theory | measured | error | worst over B |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|---|---|---|");
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
        put!(
            text,
            "| {} | {} | {} | {} | {} |",
            setting.device,
            setting.rate,
            setting.delay,
            passive.columns(),
            stable.columns()
        );
    }
}

/// The boundaries of passivity with friction and counts.
pub(super) fn whole(text: &mut String, cells: &Outcomes) {
    put!(
        text,
        "\nLargest passive stiffness (N/m) with friction, quantization and the driver's velocity, B = 0, hands up to {} \
         m/s:\n",
        passive::SPEED
    );
    put!(
        text,
        "| device | rate (Hz) | Abbott and Okamura, any speed | theory at this speed | measured | error |"
    );
    put!(text, "|---|---|---|---|---|---|");
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
            put!(
                text,
                "| {} | {} | {any_speed:.0} | {theory:.0} | {measured:.0} | {:+.1} |",
                setting.device,
                setting.rate,
                100.0 * (measured / theory - 1.0)
            );
        }
    }
}

/// The stiffest walls under each scheme.
pub(super) fn gains(text: &mut String, cells: &Outcomes, devices: &[StudyDevice]) {
    put!(
        text,
        "\nLargest stiffness, as a multiple of the plain bound 2 b / T (with delay: over 2 d + 1), at which the adversary \
         extracts\nat most {:.0} mJ and the wall renders at least {:.0} % of the static stiffness. In brackets: the \
         largest energy found (mJ)\nup to ten times the bound. No scheme can exceed the column \"bound\" against a \
         hand that rests and leaves at once:\n",
        1e3 * SAFE,
        100.0 * RENDERED
    );
    let names = SCHEMES.map(|scheme| scheme.name());
    put!(
        text,
        "| device | rate (Hz) | delay | friction, counts | motion | bound | {} |",
        names.join(" | ")
    );
    put!(
        text,
        "|---|---|---|---|---|---|{}",
        "---|".repeat(names.len())
    );
    let gains = super::gains(cells);
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
        put!(
            text,
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
