//! Detects that a tool goes beyond the surface that its patch in use has. There it may meet a surface that the tick does not know.

use crate::record::Touch;

/// Longest gap within a stretch (s). A tool that comes back with each patch and leaves again is told of once.
const GAP: f64 = 0.1;

/// A stretch of time in which a tool was beyond what its patches reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    /// Start (s).
    pub from: f64,
    /// End (s).
    pub to: f64,
    /// The tool where it was farthest beyond.
    farthest: Touch,
}

impl Stretch {
    /// A description for people.
    pub(super) fn description(&self) -> String {
        self.farthest.beyond().unwrap_or_default()
    }
}

/// Detects the stretches of one tool.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Watch {
    open: Option<Stretch>,
}

impl Watch {
    /// Takes the tool at `time` (s). Returns a stretch that has ended.
    pub(super) fn take(&mut self, time: f64, touch: &Touch) -> Option<Stretch> {
        let ended = self.open.take_if(|open| time - open.to > GAP);
        if touch.is_beyond() {
            let open = self.open.get_or_insert(Stretch {
                from: time,
                to: time,
                farthest: *touch,
            });
            open.to = time;
            if touch.way > open.farthest.way {
                open.farthest = *touch;
            }
        }
        ended
    }

    /// The stretch that is open at the end.
    pub(super) fn finish(self) -> Option<Stretch> {
        self.open
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::record::ToolTelemetry;

    /// The stretches in two seconds of ticks, in which the tool is at `way` (m) at each time (s) and each patch reaches 10 mm.
    fn stretches(way: impl Fn(f64) -> f64) -> Vec<Stretch> {
        let mut watch = Watch::default();
        let times = (0..2000).map(|tick| f64::from(tick) * 1e-3);
        let mut found: Vec<_> = times
            .filter_map(|time| {
                let tool = ToolTelemetry {
                    way: way(time),
                    reach: 0.01,
                    ..ToolTelemetry::empty()
                };
                watch.take(time, &Touch::from(&tool))
            })
            .collect();
        found.extend(watch.finish());
        found
    }

    #[test]
    fn a_stretch_is_told_with_the_largest_way() {
        // The way at both edges is the reach, which is not beyond it.
        let found = stretches(|t| {
            if (0.501..0.7).contains(&t) {
                0.02 * t
            } else {
                0.01
            }
        });
        let [stretch] = found[..] else {
            panic!("{found:?}");
        };
        // A tick on either side.
        assert!((stretch.from - 0.5).abs() < 2.1e-3 && (stretch.to - 0.7).abs() < 1.1e-3);
        let words = stretch.description();
        assert!(
            words.contains(": 14.0 mm from where its patch was made, which reaches 10.0 mm"),
            "{words}"
        );
    }

    #[test]
    fn a_tool_that_leaves_each_patch_is_told_of_once_and_until_the_end() {
        // A patch comes each 17 ms. In the last 3 ms of each, the tool is beyond it.
        let flickering = stretches(|t| {
            if (t * 1e3) as u64 % 17 > 13 {
                0.02
            } else {
                0.0
            }
        });
        let [stretch] = flickering[..] else {
            panic!("{flickering:?}");
        };
        assert!(stretch.from < 0.02 && stretch.to > 1.98, "{stretch:?}");
        assert_eq!(
            stretches(|t| if t > 1.0 && t < 1.3 { 0.0 } else { 0.02 }).len(),
            2
        );
        assert_eq!(stretches(|_| 0.01), []);
    }
}
