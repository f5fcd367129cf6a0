//! The identified numbers as a device's file.

use super::{Estimate, Identified, axis_name};
use crate::DeviceFile;
use core::fmt::Write;
use std::collections::BTreeMap;

impl Identified {
    /// The text of the device's file `base` with the identified numbers in place of its own. `[sources]` names their
    /// intervals and the date, and they are no longer estimates. The count stays that of `base`: on a mechanism whose
    /// joints count, the smallest change of a coordinate is no count. The text is TOML that [`DeviceFile::parse`] reads.
    pub fn profile(&self, base: &DeviceFile, date: &str) -> String {
        let mut model = base.model;
        let mut sources: BTreeMap<&str, String> = BTreeMap::new();
        for (name, source) in &base.sources {
            sources.insert(name, source.clone());
        }
        for (name, field, estimate, unit) in [
            ("mass", &mut model.mass, &self.mass, "kg"),
            ("damping", &mut model.damping, &self.damping, "N s/m"),
            ("friction", &mut model.friction, &self.friction, "N"),
        ] {
            *field = rounded(estimate.value);
            sources.insert(name, self.source(name, estimate, unit, date));
        }
        if let Some(delay) = self.delay_periods {
            model.output_delay = rounded(delay * self.period);
            let source = format!(
                "identified by guided motion on {date}: {delay:.2} periods of {:?} s, with the delay of the readings",
                self.period
            );
            sources.insert("output_delay", source);
        }
        let mut text = String::new();
        let mut line = |line: String| {
            text.push_str(&line);
            text.push('\n');
        };
        line(format!("name = {}", quoted(&base.name)));
        if let Some(protocol) = &base.protocol {
            line(format!("protocol = {}", quoted(protocol)));
        }
        if let Some(axes) = model.axes {
            let free = axes.free().into_iter().enumerate();
            let names = free
                .filter(|(_, free)| *free)
                .map(|(axis, _)| quoted(axis_name(axis)));
            line(format!("axes = [{}]", names.collect::<Vec<_>>().join(", ")));
        }
        line(format!("rate = {}  # Hz", model.rate_hz));
        for (name, value, unit) in [
            ("mass", model.mass, "kg"),
            ("damping", model.damping, "N s/m"),
            ("friction", model.friction, "N"),
            ("position_step", model.position_step, "m"),
            ("max_force", model.max_force, "N"),
            ("workspace_radius", model.workspace_radius, "m"),
            ("output_delay", model.output_delay, "s"),
            ("driver_stiffness", model.driver_stiffness, "N/m"),
            ("driver_damping", model.driver_damping, "N s/m"),
        ] {
            line(format!("{name} = {value:?}  # {unit}"));
        }
        let found = ["mass", "damping", "friction"];
        let estimated = base
            .estimated
            .iter()
            .filter(|name| !found.contains(&name.as_str()));
        let estimated: Vec<_> = estimated.map(|name| quoted(name)).collect();
        line(format!("estimated = [{}]", estimated.join(", ")));
        if let Some(rotation) = &model.rotation {
            line("\n[rotation]".to_owned());
            for (name, value, unit) in [
                ("inertia", rotation.inertia, "kg m^2"),
                ("damping", rotation.damping, "N m s/rad"),
                ("friction", rotation.friction, "N m"),
                ("step", rotation.step, "rad"),
                ("max_moment", rotation.max_moment, "N m"),
                ("driver_stiffness", rotation.driver_stiffness, "N m/rad"),
                ("driver_damping", rotation.driver_damping, "N m s/rad"),
            ] {
                line(format!("{name} = {value:?}  # {unit}"));
            }
        }
        line("\n[sources]".to_owned());
        for (name, source) in &sources {
            line(format!("{name} = {}", quoted(source)));
        }
        text
    }

    /// The source of an identified number: its interval, its values along the axes, and the date.
    fn source(&self, name: &str, all: &Estimate, unit: &str, date: &str) -> String {
        let mut text = format!(
            "identified by guided motion on {date}: 95 % interval {:?} to {:?} {unit}",
            rounded(all.low),
            rounded(all.high)
        );
        for (k, axis) in self.axes.iter().enumerate() {
            let value = match name {
                "mass" => axis.mass.value,
                "damping" => axis.damping.value,
                _ => axis.friction.value,
            };
            let before = if k == 0 { "; " } else { ", " };
            // Writing to a string cannot fail.
            let _ = write!(
                text,
                "{before}{} {:?}",
                axis_name(axis.axis),
                rounded(value)
            );
        }
        text
    }
}

/// The number with four significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// A text as a basic string of TOML, without control characters.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars().filter(|c| !c.is_control()) {
        if matches!(c, '"' | '\\') {
            quoted.push('\\');
        }
        quoted.push(c);
    }
    quoted.push('"');
    quoted
}
