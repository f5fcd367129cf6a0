//! Bodies that touch each other pass credit on: the hand on one body feels the energy that a hand on another one supplied,
//! and all hands together get no more than they supplied.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use proptest::prelude::*;
use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::SafetyConfig;
use rt_core::{
    Controller, ControllerConfig, DeviceError, DeviceState, EnergyAccount, Freedom, LocalModel,
    MAX_DEVICES, PassivityConfig, Pose, Scheme, Vec3,
};

const PERIOD: f64 = 1e-3;
const MS: u64 = 1_000_000;
/// The stiffness of each body against its hand (N/m).
const STIFFNESS: f64 = 300.0;

/// Bodies, each in the hand of the device of the same number.
struct Rig {
    controller: Controller,
    tick: u64,
    count: usize,
    /// Where each hand is along x (m).
    hands: [f64; MAX_DEVICES],
}

impl Rig {
    fn new(count: usize) -> Self {
        let mut config = ControllerConfig::default();
        for _ in 0..count {
            let device = DeviceConfig {
                frame: DeviceFrame::at(Vec3::zeros()),
                safety: SafetyConfig {
                    actuated: Freedom::Three,
                    max_force: 100.0,
                    ..SafetyConfig::unlimited(PERIOD)
                },
            };
            let body = CouplingConfig {
                scheme: Scheme::Capped,
                period: PERIOD,
                blend: 0.5,
                age_limit: 1e3,
                decay: 0.1,
                recovery: PERIOD,
                hold_damping: [0.0; MAX_DEVICES],
                passivity: PassivityConfig::new(PERIOD),
            };
            config.devices.push(device).expect("room");
            config.bodies.push(body).expect("room");
        }
        Self {
            controller: Controller::new(&config),
            tick: 0,
            count,
            hands: [0.0; MAX_DEVICES],
        }
    }

    /// Hands over a model of `body`: `force` (N) on its hand at the present place, `energy` and `received` (J).
    fn model(&mut self, body: usize, force: f64, energy: f64, received: f64) {
        let mut model = LocalModel::empty();
        (model.head.sequence, model.head.time_ns) = (self.tick + 1, self.tick * MS);
        (model.head.period, model.head.horizon) = (8.0 * PERIOD, 10.0 * PERIOD);
        model.head.handle_count = 1;
        (model.head.energy, model.head.received) = (energy, received);
        let handle = &mut model.handles[0];
        handle.device = body as u8;
        handle.pose = Pose::at(Vec3::x() * self.hands[body]);
        handle.wrench.force.x = force;
        model.stiffness[0][0][(0, 0)] = STIFFNESS;
        self.controller.accept(body, &model).expect("a sound model");
    }

    /// A tick. Returns the force on each hand (N).
    fn tick(&mut self) -> [f64; MAX_DEVICES] {
        let mut readings = [Err(DeviceError::NoReport); MAX_DEVICES];
        for (reading, x) in readings.iter_mut().zip(self.hands).take(self.count) {
            *reading = Ok(DeviceState {
                pose: Pose::at(Vec3::x() * x),
                ..DeviceState::resting()
            });
        }
        let (commands, _) = self.controller.tick(self.tick * MS, &readings);
        self.tick += 1;
        commands.map(|command| command.force.x)
    }

    fn accounts(&self) -> Vec<EnergyAccount> {
        self.controller.energy().collect()
    }
}

/// How far the hand presses (m).
const PRESSED: f64 = 0.01;

/// The part of the energy that the body of the first hand stores.
const OWN: f64 = 0.25;

/// A hand presses its body on another one in the hand of the second device, holds, and goes back. Returns the least forces in the hold as fractions of the force of the bodies, and the accounts at the end. If
/// the host `tells`, its models state the work of the contacts.
fn pressed(bodies: usize, tells: bool) -> ([f64; 2], Vec<EnergyAccount>) {
    let mut rig = Rig::new(bodies);
    let mut least = [1.0_f64; 2];
    for step in 0..3000_u32 {
        let path = if step < 1000 {
            f64::from(step) / 1000.0
        } else {
            (f64::from(3000 - step) / 1000.0).min(1.0)
        };
        rig.hands[0] = PRESSED * path;
        let force = STIFFNESS * rig.hands[0];
        // The bodies are springs in series.
        let energy = 0.5 * force * rig.hands[0];
        let passed = (1.0 - OWN) * energy;
        if step % 8 == 0 {
            let received = if tells { passed } else { 0.0 };
            rig.model(0, -force, OWN * energy, -received);
            if bodies > 1 {
                rig.model(1, force, passed, received);
            }
        }
        let forces = rig.tick();
        if (1500..2000).contains(&step) {
            let shares = [-forces[0] / force, forces[1] / force];
            least = [0, 1].map(|hand| least[hand].min(shares[hand]));
        }
    }
    (least, rig.accounts())
}

#[test]
fn a_hand_feels_the_body_that_the_hand_of_another_body_presses() {
    let (forces, accounts) = pressed(2, true);
    for force in forces {
        assert!(force > 1.0 - 1e-6, "{forces:?}");
    }
    // The cap never withheld a force, and what the one body gave, the other one took, both ways.
    assert_eq!(accounts[0].capped + accounts[1].capped, 0);
    let sum = accounts[0].received + accounts[1].received;
    // The last model comes some ticks before the end of the way back.
    assert!(sum.abs() < 1e-6, "{sum}");
    // Without the work of contacts, the still hand feels less: it has supplied nothing.
    let (forces, accounts) = pressed(2, false);
    assert!(forces[1] < 0.9 && accounts[1].capped > 0, "{forces:?}");
    assert_eq!(accounts[0].received, 0.0);
}

#[test]
fn a_body_without_hands_gives_back_the_energy_with_which_it_was_pressed() {
    let (forces, accounts) = pressed(1, true);
    assert!(forces[0] > 1.0 - 1e-6, "{forces:?}");
    assert_eq!(accounts[0].capped, 0);
    assert!(accounts[0].received.abs() < 1e-6, "{:?}", accounts[0]);
    // The account forgets the energy that its own body does not store, if the host does not tell.
    let (_, accounts) = pressed(1, false);
    assert!(accounts[0].capped > 0);
}

proptest! {
    /// Whatever models claim of energies and of the work of contacts, all hands together get what they supplied, beside two
    /// allowances for each body.
    #[test]
    fn no_claim_makes_energy_for_the_hands_of_all_bodies(
        claims in prop::collection::vec((-3.0..3.0, 0.0..0.05, -0.05..0.05), 150),
        rates in prop::array::uniform3(0.5..8.0_f64),
        every in 1_usize..20,
    ) {
        let mut rig = Rig::new(3);
        let mut claims = claims.iter().cycle();
        let allowance = PassivityConfig::new(PERIOD).allowance;
        for step in 0..1000_usize {
            let time = step as f64 * PERIOD;
            for (x, rate) in rig.hands.iter_mut().zip(rates) {
                *x = 2e-3 * (1.0 - (rate * core::f64::consts::TAU * time).cos());
            }
            for body in 0..3 {
                if (step + body).is_multiple_of(every) {
                    let (force, energy, received) = *claims.next().expect("a cycle");
                    rig.model(body, force, energy, received);
                }
            }
            rig.tick();
            let accounts = rig.accounts();
            let supplied: f64 = accounts.iter().map(|account| account.supplied).sum();
            let received: f64 = accounts.iter().map(|account| account.received).sum();
            prop_assert!(received < 1e-15, "{received}");
            // The reach of a hand grows by a few percent in a tick while the hand speeds up.
            prop_assert!(supplied > -3.0 * 2.05 * allowance, "{supplied}");
        }
    }
}
