//! Detects the slips of a proxy against its hand. A hold that no hand had paid for has become true again at another pose
//! (`rt_core`, module `slip`), and a person who reads the force against the pose of the hand must know of the slip.

use rt_core::record::DeviceTelemetry;

/// A slip that is never larger is not reported (m). A hand that holds a body wavers by as much.
const NOTICED: f64 = 1e-4;
/// The lever (m) by which turns compare with displacements, as in the tick.
const LEVER: f64 = 0.05;

/// The slip of one proxy, from its first tick to its last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Slip {
    /// Start (s).
    pub(super) from: f64,
    /// End (s).
    pub(super) to: f64,
    /// The largest displacement (m).
    pub(super) most: f64,
    /// The largest angle (rad).
    angle: f64,
    /// The last displacement (m).
    left: f64,
}

impl Slip {
    /// A description for people.
    pub(super) fn description(&self) -> String {
        let turned = if self.angle > 1e-3 {
            format!(" and {:.1} degrees", self.angle.to_degrees())
        } else {
            String::new()
        };
        let left = if self.left > NOTICED {
            format!(", {:.2} mm of it at the end", self.left * 1e3)
        } else {
            String::new()
        };
        format!(
            "the proxy slipped by up to {:.2} mm{turned} along its force{left}: the hand had paid for less energy than the \
             body stored, and now feels the force of the body at the pose of the proxy",
            self.most * 1e3
        )
    }
}

/// Detects the slips of one device.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Watch {
    open: Option<Slip>,
}

impl Watch {
    /// Takes the telemetry of the tick at `time` (s). Returns a slip that has ended, if it was noticeable.
    pub(super) fn take(&mut self, time: f64, device: &DeviceTelemetry) -> Option<Slip> {
        let (length, angle) = (device.slip.norm(), device.slip_angle);
        if length == 0.0 && angle == 0.0 {
            return self.open.take().and_then(noticed);
        }
        let open = self.open.get_or_insert(Slip {
            from: time,
            to: time,
            most: 0.0,
            angle: 0.0,
            left: 0.0,
        });
        open.to = time;
        open.most = open.most.max(length);
        open.angle = open.angle.max(angle);
        open.left = length;
        None
    }

    /// The slip that is left at the end, if it was noticeable.
    pub(super) fn finish(self) -> Option<Slip> {
        self.open.and_then(noticed)
    }
}

fn noticed(slip: Slip) -> Option<Slip> {
    (slip.most > NOTICED || slip.angle * LEVER > NOTICED).then_some(slip)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::{Telemetry, Vec3};

    /// The slips in a second of ticks in which the proxy has slipped by `length` (m) at each time (s).
    fn slips(length: impl Fn(f64) -> f64) -> Vec<Slip> {
        let [mut device, ..] = Telemetry::empty().devices;
        let mut watch = Watch::default();
        let mut found = Vec::new();
        for tick in 0..1000 {
            let time = f64::from(tick) * 1e-3;
            device.slip = Vec3::new(0.0, -length(time), 0.0);
            found.extend(watch.take(time, &device));
        }
        found.extend(watch.finish());
        found
    }

    #[test]
    fn a_slip_is_told_from_its_first_tick_to_its_last_with_its_largest_extent() {
        let found = slips(|t| {
            if (0.2..0.6).contains(&t) {
                0.01 * (0.6 - t)
            } else {
                0.0
            }
        });
        assert_eq!(found.len(), 1);
        let [slip] = found[..] else { unreachable!() };
        // A tick on either side.
        assert!((slip.from - 0.2).abs() < 1.1e-3 && (slip.to - 0.6).abs() < 1.1e-3);
        assert!((slip.most - 4e-3).abs() < 1.1e-5);
        let words = slip.description();
        assert!(words.contains("up to 4.00 mm along its force: "), "{words}");
    }

    #[test]
    fn a_slip_that_lasts_to_the_end_says_how_much_is_left_and_a_small_one_is_not_told() {
        let found = slips(|t| if t > 0.5 { 2e-3 } else { 0.0 });
        let words = found[0].description();
        assert!(
            words.contains("up to 2.00 mm along its force, 2.00 mm of it at the end"),
            "{words}"
        );
        assert_eq!(slips(|_| 0.9 * NOTICED), []);
        assert_eq!(
            slips(|t| f64::from(u8::from(t > 0.5)) * 1.1 * NOTICED).len(),
            1
        );
    }
}
