//! The sums of a gatherer at a tick, from which another gatherer continues. A player thus knows the totals at any moment
//! of a log without the ticks before it.

use super::{Event, Folded, Gatherer, TickView};
use crate::record::totals::DeviceTotals;
use serde::{Deserialize, Serialize};

/// The sums over the ticks up to some tick. They have no histograms.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Ticks with a record.
    pub ticks: u64,
    /// Deadlines missed.
    pub missed: u64,
    /// Most deadlines missed in a row.
    pub longest_miss: u64,
    /// Ticks whose record did not arrive.
    pub lost: u64,
    /// Trips of the last stage.
    pub trips: u64,
    /// Times that the newest model became too old.
    pub stale: u64,
    /// By device.
    pub hands: Vec<HandSums>,
}

/// The sums of one hand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HandSums {
    /// Largest force (N).
    pub peak_force: f64,
    /// Work done on the hand (J).
    pub work: f64,
    /// Largest distance from the first position (m).
    pub reach: f64,
    /// The first position (m).
    pub start: [f64; 3],
    /// The last position of the device (m, device axes).
    #[serde(default)]
    pub place: Option<[f64; 3]>,
}

impl Gatherer {
    /// The sums so far.
    pub fn checkpoint(&self) -> Checkpoint {
        let counts = &self.counts;
        let hands = self.sums.iter().map(|sum| {
            let totals = sum.totals();
            HandSums {
                peak_force: totals.peak_force,
                work: totals.work,
                reach: totals.reach,
                start: sum.start().unwrap_or_default().into(),
                place: sum.place().map(Into::into),
            }
        });
        Checkpoint {
            ticks: counts.ticks,
            missed: counts.missed,
            longest_miss: counts.longest_miss,
            lost: counts.lost,
            trips: counts.trips,
            stale: counts.stale,
            hands: hands.collect(),
        }
    }

    /// Continues from a moment of a log: the gatherer, which has taken no tick, gets the sums of `checkpoint` and the state
    /// of the tick `last`, as if it had taken all ticks until then. Its histograms stay empty.
    #[must_use]
    pub fn resume(mut self, checkpoint: &Checkpoint, last: &TickView<'_>) -> Self {
        self.counts.ticks = checkpoint.ticks;
        self.counts.missed = checkpoint.missed;
        self.counts.longest_miss = checkpoint.longest_miss;
        self.counts.lost = checkpoint.lost;
        self.counts.trips = checkpoint.trips;
        self.counts.stale = checkpoint.stale;
        let devices = last.devices.iter().zip(&checkpoint.hands);
        for (sum, (device, hand)) in self.sums.iter_mut().zip(devices) {
            let totals = DeviceTotals {
                peak_force: hand.peak_force,
                work: hand.work,
                reach: hand.reach,
                ..DeviceTotals::default()
            };
            let place = hand.place.map(Into::into);
            sum.resume(totals, device.wrench.force, place, hand.start.into());
        }
        let _ = self.watch.take(last);
        self.last.tick = Some((last.tick, last.time_ns));
        last.devices.clone_into(&mut self.last.devices);
        last.bodies.clone_into(&mut self.last.bodies);
        self
    }

    /// The ticks since the last call or frame, folded, without a frame.
    pub fn folded(&mut self) -> Folded {
        std::mem::take(&mut self.folded)
    }

    /// The events since the last call or frame, without a frame, and the number of those that are left out.
    pub fn events(&mut self) -> (Vec<Event>, u64) {
        (
            std::mem::take(&mut self.events),
            std::mem::take(&mut self.more_events),
        )
    }
}
