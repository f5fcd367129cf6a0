//! Detects that the cap withholds force of a body or a tool for long. A hand notices a force that is too small for half a
//! second.

use rt_core::Withheld;

/// Duration above which a stretch is reported (s).
const LASTING: f64 = 0.5;
/// Longest gap within a stretch (s). A cap that acts in most ticks feels like a cap that acts in all.
const GAP: f64 = 0.1;

/// A stretch of time in which force was withheld.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    /// Start (s).
    pub(super) from: f64,
    /// End (s).
    pub(super) to: f64,
    /// The largest force withheld.
    pub(super) most: Withheld,
}

impl Stretch {
    /// A description for people.
    pub(super) fn description(&self) -> String {
        let Withheld { force, of } = self.most;
        let percent = 100.0 * force / of;
        format!(
            "the cap holds back up to {force:.2} N of {of:.2} N ({percent:.0} %): more energy is stored than the hands have \
             supplied"
        )
    }
}

/// Detects the stretches of one body or one tool.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Watch {
    open: Option<Stretch>,
}

impl Watch {
    /// Takes the force withheld at `time` (s). Returns a stretch that has ended, if it lasted long enough.
    pub(super) fn take(&mut self, time: f64, withheld: Withheld) -> Option<Stretch> {
        let acts = withheld.is_noticeable();
        match &mut self.open {
            Some(open) if acts && time - open.to <= GAP => {
                open.to = time;
                if withheld.force > open.most.force {
                    open.most = withheld;
                }
                None
            }
            Some(open) if time - open.to > GAP => {
                let ended = *open;
                self.open = acts.then(|| Stretch::begun(time, withheld));
                lasting(ended)
            }
            Some(_) => None,
            None => {
                self.open = acts.then(|| Stretch::begun(time, withheld));
                None
            }
        }
    }

    /// The stretch that is open at the end, if it lasted long enough.
    pub(super) fn finish(self) -> Option<Stretch> {
        self.open.and_then(lasting)
    }
}

impl Stretch {
    fn begun(time: f64, most: Withheld) -> Self {
        Self {
            from: time,
            to: time,
            most,
        }
    }
}

fn lasting(stretch: Stretch) -> Option<Stretch> {
    (stretch.to - stretch.from > LASTING).then_some(stretch)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The stretches in two seconds of ticks. At each time (s), `force` (N) is withheld of 2 N.
    fn stretches(force: impl Fn(f64) -> f64) -> Vec<Stretch> {
        let mut watch = Watch::default();
        let mut found: Vec<_> = (0..2000)
            .map(|tick| f64::from(tick) * 1e-3)
            .filter_map(|t| {
                watch.take(
                    t,
                    Withheld {
                        force: force(t),
                        of: 2.0,
                    },
                )
            })
            .collect();
        found.extend(watch.finish());
        found
    }

    #[test]
    fn a_lasting_difference_is_reported_with_its_size_and_a_short_or_small_one_is_not() {
        let within = |a: f64, b: f64, t: f64| (a..b).contains(&t);
        assert_eq!(stretches(|_| 0.015), []);
        assert_eq!(
            stretches(|t| if within(0.2, 0.6, t) { 1.0 } else { 0.0 }),
            []
        );
        let long = stretches(|t| if within(0.2, 0.9, t) { t } else { 0.0 });
        assert_eq!(long.len(), 1);
        // The bound is one tick on either side.
        assert!((long[0].from - 0.2).abs() < 1.1e-3 && (long[0].to - 0.9).abs() < 1.1e-3);
        assert!((long[0].most.force - 0.9).abs() < 1.1e-3);
        assert!(
            long[0].description().contains("0.90 N of 2.00 N (45 %)"),
            "{}",
            long[0].description()
        );
        // The cap acts in six ticks of seven, to the end.
        let flickering = stretches(|t| {
            if t > 1.0 && !((t * 1e3) as u64).is_multiple_of(7) {
                0.5
            } else {
                0.0
            }
        });
        assert_eq!(flickering.len(), 1);
        assert!(flickering[0].to > 1.99);
    }
}
