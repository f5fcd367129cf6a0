//! The map over stiffness and damping.

use super::{Outcome, Panel, Setting, panels};
use host::plot::{self, Map, MapCell, MapLine, MapPanel, Picture};
use std::collections::BTreeMap;

/// The map as a picture.
pub(super) fn map(cells: &BTreeMap<u64, Outcome>) -> Picture {
    plot::map(&page(panels(cells)))
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
            let picture = plot::map(&page(panels.collect()));
            let svg = picture.svg();
            assert_eq!(plot::collisions(&picture), [""; 0]);
            assert!(!svg.contains('…'), "a title is cut");
        }
    }
}
