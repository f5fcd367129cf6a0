//! The counted ticks: every scheme, number of handles and situation, of which [`GATE`] has one for each mechanism.

use palpate_tests::law::{
    AGE_LIMIT_NS, HANDLES, Limits, MODEL_NS, PATIENCE, SCHEMES, law, model, reading, scheme,
};
use rt_core::Reading;
use rt_core::coupling::HostState;
use rt_core::safety::SafetyState;
use rt_core::{
    Controller, DeviceError, DeviceState, LocalModel, MAX_DEVICES, Telemetry, Vec3, Wrench,
};
use std::hint::black_box;

/// Time between two ticks while a model ages (ns).
const STEP_NS: usize = 5_000_000;
/// Ticks until every smooth start has ended.
const SETTLE: usize = 300;
/// A period so long that the blend of its model does not end during the count (s).
const ENDLESS: f64 = 1e9;
/// An energy that no hand has paid for (J).
const UNPAID: f64 = 1e6;
/// The period of a model that has blended in long before [`SETTLE`] ticks (s).
const BRIEF: f64 = 0.004;

/// The situation in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Situation {
    /// The cheapest tick: a model that has blended in, and hands at its reference.
    AtRest,
    /// Hands that move and turn.
    Moving,
    /// Moving hands that have not paid for the energy of the body, so that their proxies slip. Under `capped` alone.
    Slipping,
    /// Moving hands, in the middle of a blend.
    Blending,
    /// The devices give numbers that are not finite; the last states are used. In a blend.
    NotANumber,
    /// The devices have been silent for a long time. In a blend.
    Silent,
    /// The devices move too fast. In a blend.
    TooFast,
    /// The model is too old, in a blend, and the force is beyond the limits.
    Fading,
    /// A model arrives whose last used number is not finite, in a blend, beyond the limits.
    Refused,
    /// A sound model arrives in the middle of a blend, beyond the limits.
    NewModel,
}

impl Situation {
    pub(crate) const ALL: [Self; 10] = [
        Self::AtRest,
        Self::Moving,
        Self::Slipping,
        Self::Blending,
        Self::NotANumber,
        Self::Silent,
        Self::TooFast,
        Self::Fading,
        Self::Refused,
        Self::NewModel,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::AtRest => "at rest",
            Self::Moving => "moving",
            Self::Slipping => "slipping",
            Self::Blending => "blending",
            Self::NotANumber => "not a number",
            Self::Silent => "silent",
            Self::TooFast => "too fast",
            Self::Fading => "fading",
            Self::Refused => "refused",
            Self::NewModel => "new model",
        }
    }

    fn limits(self) -> Limits {
        match self {
            Self::Fading | Self::Refused | Self::NewModel => Limits::NARROW,
            _ => Limits::WIDE,
        }
    }
}

/// The ticks of the table, in the order of schemes and handles. `hold`, `thesis` and `proxy` compute what `linear`
/// computes.
pub(crate) const GATE: [Case; 10] = [
    // The least of a tick.
    Case::new("linear", 1, Situation::AtRest),
    // Logarithms of rotations, and the linear model of two handles.
    Case::new("linear", 2, Situation::Moving),
    // The stage of safety, in a blend of two models.
    Case::new("linear", 2, Situation::TooFast),
    // The fading of a model that is too old, and the limits of force.
    Case::new("linear", 2, Situation::Fading),
    // The checks of a model.
    Case::new("linear", 2, Situation::Refused),
    // The loops over pairs of handles, at their largest number.
    Case::new("linear", 8, Situation::NewModel),
    // The account of energy at its cheapest and its most expensive, and the slip of proxies.
    Case::new("capped", 2, Situation::Slipping),
    Case::new("capped", 8, Situation::AtRest),
    Case::new("capped", 8, Situation::NewModel),
    // Observer and controller of passivity.
    Case::new("classic", 2, Situation::NewModel),
];

/// One counted tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Case {
    pub(crate) scheme: &'static str,
    pub(crate) handles: usize,
    pub(crate) situation: Situation,
}

impl Case {
    const fn new(scheme: &'static str, handles: usize, situation: Situation) -> Self {
        Self {
            scheme,
            handles,
            situation,
        }
    }

    /// The cases of the table, or all.
    pub(crate) fn chosen(all: bool) -> Vec<Self> {
        if !all {
            return GATE.into();
        }
        let each = SCHEMES.into_iter().flat_map(|scheme| {
            HANDLES.into_iter().flat_map(move |handles| {
                Situation::ALL
                    .into_iter()
                    .map(move |situation| Self::new(scheme, handles, situation))
            })
        });
        each.filter(|case| case.situation != Situation::Slipping || case.scheme == "capped")
            .collect()
    }

    /// The name in the table.
    pub(crate) fn name(&self) -> String {
        format!(
            "{}, {}, {}",
            self.scheme,
            self.handles,
            self.situation.name()
        )
    }

    /// The state just before the tick.
    pub(crate) fn prepare(&self) -> Prepared {
        let situation = self.situation;
        let mut law = law(scheme(self.scheme), self.handles, situation.limits());
        let at_rest = situation == Situation::AtRest;
        let readings = |k: usize| {
            if at_rest {
                [Ok(DeviceState::resting()); MAX_DEVICES]
            } else {
                reading(0.1 * k as f64)
            }
        };
        let mut first = model(self.handles, BRIEF);
        if at_rest {
            // The hands are exactly at the reference of the model, so that no logarithm of a rotation is computed.
            let (_, seen) = law.tick(MODEL_NS, &readings(0));
            for (handle, device) in first.handles.iter_mut().zip(seen.devices()) {
                handle.pose = device.pose;
            }
        }
        law.accept(0, &first).expect("the first model is sound");
        for k in 0..SETTLE {
            law.tick(MODEL_NS, &readings(k));
        }
        let mut last = first;
        if situation == Situation::Slipping {
            last.head.energy = UNPAID;
            last.head.time_ns += 1;
            law.accept(0, &last).expect("the second model is sound");
            for k in 0..SETTLE {
                law.tick(last.head.time_ns, &readings(SETTLE + k));
            }
        }
        let alone = [Situation::AtRest, Situation::Moving, Situation::Slipping];
        if !alone.contains(&situation) {
            last.head.period = ENDLESS;
            last.head.time_ns += 1;
            law.accept(0, &last).expect("the second model is sound");
            law.tick(last.head.time_ns, &readings(SETTLE));
        }
        let mut prepared = Prepared {
            law,
            model: None,
            now_ns: MODEL_NS,
            readings: readings(SETTLE),
        };
        prepared.meet(situation, &last);
        prepared
    }
}

/// A tick that is prepared to run.
#[derive(Clone)]
pub(crate) struct Prepared {
    law: Box<Controller>,
    model: Option<LocalModel>,
    now_ns: u64,
    readings: [Reading; MAX_DEVICES],
}

impl Prepared {
    fn meet(&mut self, situation: Situation, last: &LocalModel) {
        let mut newer = *last;
        newer.head.time_ns += 1;
        match situation {
            Situation::AtRest | Situation::Moving | Situation::Slipping | Situation::Blending => {}
            Situation::NotANumber => {
                for state in self.readings.iter_mut().flatten() {
                    state.twist.angular.z = f64::NAN;
                }
            }
            Situation::Silent => {
                self.readings = [Err(DeviceError::NoReport); MAX_DEVICES];
                for _ in 0..=PATIENCE {
                    self.law.tick(MODEL_NS, &self.readings);
                }
            }
            Situation::TooFast => {
                for state in self.readings.iter_mut().flatten() {
                    state.twist.linear *= 500.0;
                }
            }
            Situation::Fading => {
                // A longer gap would be a loop that stood still.
                let steps = (0..AGE_LIMIT_NS).step_by(STEP_NS);
                for age_ns in steps {
                    self.law.tick(MODEL_NS + age_ns, &self.readings);
                }
                self.now_ns = MODEL_NS + AGE_LIMIT_NS + 2_000_000;
            }
            Situation::Refused => {
                let mut spoilt = newer;
                let last = usize::from(spoilt.head.handle_count) - 1;
                spoilt.damping[last][last][(5, 5)] = f64::NAN;
                self.model = Some(spoilt);
            }
            Situation::NewModel => self.model = Some(newer),
        }
    }

    /// The tick.
    pub(crate) fn run(&mut self) -> Telemetry {
        let model = black_box(self.model.as_ref());
        let (wrenches, telemetry) = measured_tick(
            black_box(&mut self.law),
            model,
            black_box(self.now_ns),
            black_box(&self.readings),
        );
        black_box(wrenches);
        black_box(telemetry)
    }

    /// Whether the tick met its situation. Otherwise the count would be that of another situation.
    pub(crate) fn met(&self, situation: Situation, telemetry: &Telemetry) -> bool {
        let safety = telemetry.devices[0].safety;
        let host = telemetry.bodies[0].state;
        let fresh = telemetry.devices[0].fresh;
        let counters = self.law.coupling_counters().next().unwrap_or_default();
        match situation {
            Situation::AtRest | Situation::Moving | Situation::Blending => {
                fresh && safety == SafetyState::Normal && host == HostState::Live
            }
            Situation::Slipping => telemetry.devices[0].slip != Vec3::zeros(),
            Situation::NotANumber => !fresh && safety == SafetyState::Normal,
            Situation::Silent => safety == SafetyState::Silent,
            Situation::TooFast => safety == SafetyState::TooFast,
            Situation::Fading => safety == SafetyState::Limited && host == HostState::Fading,
            Situation::Refused => safety == SafetyState::Limited && counters.not_finite == 1,
            Situation::NewModel => safety == SafetyState::Limited && counters.accepted == 3,
        }
    }
}

/// The name of [`measured_tick`] in valgrind.
pub(crate) const MEASURED: &str = "instructions::cases::measured_tick";

/// The counted function. The model arrives as in the loop.
#[inline(never)]
fn measured_tick(
    law: &mut Controller,
    model: Option<&LocalModel>,
    now_ns: u64,
    readings: &[Reading; MAX_DEVICES],
) -> ([Wrench; MAX_DEVICES], Telemetry) {
    if let Some(model) = model {
        // Refusals are a part of the count.
        let _ = law.accept(0, model);
    }
    law.tick(now_ns, readings)
}
