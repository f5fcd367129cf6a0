//! The trouble of a run: devices that are lost, stalls of the host, and messages that are late or lost.

use crate::chance::Chance;
use crate::stress::scene::draw::{Draw as Host, Span};
use sim::Fault;

/// What troubles a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Trouble {
    Nothing,
    Loss,
    Late,
    Dropped,
    All,
}

impl Trouble {
    const ALL: [Self; 5] = [
        Self::Nothing,
        Self::Loss,
        Self::Late,
        Self::Dropped,
        Self::All,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Loss => "loss of a device",
            Self::Late => "late host",
            Self::Dropped => "dropped messages",
            Self::All => "all",
        }
    }

    fn includes(self, other: Self) -> bool {
        self == other || self == Self::All
    }
}

/// The trouble of a run, and when it comes.
#[derive(Clone, Debug)]
pub(super) struct Troubles {
    pub(super) kind: Trouble,
    pub(super) stalls: Vec<Span>,
    /// The largest delay beyond the latency, as a fraction of latency and period; the fractions of models and of records that
    /// are lost.
    losses: [f64; 3],
    /// The device that is lost, how, and when.
    pub(super) loss: Option<(usize, Fault, Span)>,
}

impl Troubles {
    /// No trouble.
    pub(super) const NONE: Self = Self {
        kind: Trouble::Nothing,
        stalls: Vec::new(),
        losses: [0.0; 3],
        loss: None,
    };

    /// The trouble of a cell, in a run of `duration` (s) with this number of devices. The kinds follow the number of the cell in turn.
    pub(super) fn new(chance: Chance, cell: u64, duration: f64, devices: usize) -> Self {
        let unit = |name: &str| chance.of(name).unit(0);
        let kind = Trouble::ALL[(cell % Trouble::ALL.len() as u64) as usize];
        let is_lossy = kind.includes(Trouble::Dropped);
        let lost = |number| {
            if is_lossy {
                chance.of("losses").between(number, 0.0, 0.5)
            } else {
                0.0
            }
        };
        let span = |name: &str, number: u64, longest: f64| {
            let of = chance.of(name);
            Span {
                at: duration * of.between(2 * number, 0.1, 0.8),
                duration: of.between(2 * number + 1, 0.01, longest),
            }
        };
        let stalls = (0..2).map(|number| span("stall", number, 0.15));
        let kinds = [Fault::Vanished, Fault::Gone, Fault::LetsGo];
        Self {
            kind,
            stalls: stalls.filter(|_| kind.includes(Trouble::Late)).collect(),
            losses: [0, 1, 2].map(lost),
            loss: kind.includes(Trouble::Loss).then(|| {
                let device = (devices as f64 * unit("lost")) as usize;
                let how = kinds[(3.0 * unit("how")) as usize];
                (device, how, span("loss", 0, 0.4 * duration))
            }),
        }
    }

    /// Whether the host is late.
    pub(super) fn is_late(&self) -> bool {
        self.kind.includes(Trouble::Late)
    }

    /// The host of `rate` publications a second (Hz) and a latency (s), with the losses of its link.
    pub(super) fn host(&self, rate: f64, latency: f64) -> Host {
        let [jitter, models_lost, records_lost] = self.losses;
        Host {
            jitter,
            models_lost,
            records_lost,
            ..Host::untroubled(rate, latency)
        }
    }
}
