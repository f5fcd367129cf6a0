//! The counted passages of a model through the link: the host publishes the model, for the tick and for the log; the
//! tick takes the model from the ring and hands it to the control law.

use palpate_tests::law::{HANDLES, Limits, MODEL_NS, law, model};
use rt_core::{Controller, LocalModel, Scheme};
use runner::link::{HostEnd, LinkConfig, LogEnd, TickEnd, link};
use std::hint::black_box;

/// Period of the published models (s).
const PERIOD: f64 = 1.0 / 60.0;

/// One end of the passage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// The host publishes.
    Publish,
    /// The tick takes the newest model, of two that wait.
    Take,
}

/// The passages of the table: the cost of both grows with the number of handles.
pub(crate) const GATE: [Passage; 2] = [
    Passage {
        side: Side::Publish,
        handles: 8,
    },
    Passage {
        side: Side::Take,
        handles: 8,
    },
];

/// One counted passage.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passage {
    pub(crate) side: Side,
    pub(crate) handles: usize,
}

impl Passage {
    /// The passages of the table, or all.
    pub(crate) fn chosen(all: bool) -> Vec<Self> {
        if !all {
            return GATE.into();
        }
        [Side::Publish, Side::Take]
            .into_iter()
            .flat_map(|side| HANDLES.map(|handles| Self { side, handles }))
            .collect()
    }

    /// The name in the table.
    pub(crate) fn name(&self) -> String {
        let side = match self.side {
            Side::Publish => "publish",
            Side::Take => "take",
        };
        format!("link, {}, {side}", self.handles)
    }

    /// The state just before the passage.
    pub(crate) fn prepare(&self) -> Ready {
        let (tick, host, log) = link(&LinkConfig::new(1000.0, 1.0 / PERIOD));
        let mut ready = Ready {
            side: self.side,
            tick,
            host,
            log,
            law: law(Scheme::Linear, self.handles, Limits::WIDE),
            model: model(self.handles, PERIOD),
        };
        ready.again();
        ready
    }
}

/// A passage that is prepared to run.
pub(crate) struct Ready {
    side: Side,
    tick: TickEnd,
    host: HostEnd,
    log: LogEnd,
    law: Box<Controller>,
    model: LocalModel,
}

impl Ready {
    /// Prepares the next passage: the rings are empty, or two models wait.
    pub(crate) fn again(&mut self) {
        self.tick.take_models(|_, _| {});
        self.log.drain(|_| {});
        if self.side == Side::Take {
            for _ in 0..2 {
                self.renew();
                pass(Side::Publish, self);
            }
        } else {
            self.renew();
        }
    }

    fn renew(&mut self) {
        self.model.head.sequence += 1;
        self.model.head.time_ns += MODEL_NS;
    }

    /// The passage. Returns whether the model went through.
    pub(crate) fn run(&mut self) -> bool {
        measured_passage(black_box(self.side), black_box(self))
    }
}

/// The name of [`measured_passage`] in valgrind.
pub(crate) const MEASURED: &str = "instructions::rings::measured_passage";

/// The counted function.
#[inline(never)]
fn measured_passage(side: Side, ready: &mut Ready) -> bool {
    pass(side, ready)
}

fn pass(side: Side, ready: &mut Ready) -> bool {
    match side {
        Side::Publish => ready.host.publish(0, &ready.model).is_ok(),
        Side::Take => {
            let (mut taken, law) = (false, &mut ready.law);
            ready
                .tick
                .take_models(|body, model| taken = law.accept(body, model).is_ok());
            taken
        }
    }
}
