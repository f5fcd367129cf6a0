//! Tools on devices, through the controller: their stiffness, their independence, the age of their patches, and the energy that no
//! patch can give away.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    clippy::disallowed_types
)]

use nalgebra::UnitQuaternion;
use proptest::prelude::*;
use rt_core::controller::DeviceConfig;
use rt_core::coupling::{CouplingConfig, HostState};
use rt_core::device_frame::DeviceFrame;
use rt_core::hull::Hull;
use rt_core::safety::SafetyConfig;
use rt_core::tool::{
    Patch, PatchFault, Site, ToolConfig, ToolCounters, ToolCouplingConfig, Triangle,
};
use rt_core::{
    Controller, ControllerConfig, DeviceError, DeviceState, Freedom, LocalModel, MAX_DEVICES,
    PassivityConfig, Pose, Scheme, Telemetry, Twist, Vec3, Wrench,
};

const PERIOD: f64 = 1e-3;
const TICK_NS: u64 = 1_000_000;
/// The stiffest spring of the device (N/m), and the radius of the ball (m).
const STIFFEST: f64 = 1000.0;
const RADIUS: f64 = 5e-3;

fn tool() -> ToolCouplingConfig {
    ToolCouplingConfig {
        tool: ToolConfig {
            hull: Hull::POINT,
            turns: false,
            radius: RADIUS,
            period: PERIOD,
            stiffest: STIFFEST,
            most_damping: 10.0,
            parting: 0.02,
        },
        age_limit: 0.1,
        decay: 0.1,
        recovery: 0.05,
        hold_damping: 1.0,
        take_buttons: 0,
        passivity: PassivityConfig::new(PERIOD),
    }
}

/// Devices without limits, of which those of these indices have a tool.
fn config(devices: usize, with_tool: &[usize]) -> ControllerConfig {
    let mut config = ControllerConfig::default();
    for _ in 0..devices {
        let device = DeviceConfig {
            frame: DeviceFrame::at(Vec3::zeros()),
            safety: SafetyConfig {
                actuated: Freedom::Three,
                ..SafetyConfig::unlimited(PERIOD)
            },
        };
        config.devices.push(device).unwrap();
    }
    for device in with_tool {
        config.tools[*device] = Some(tool());
    }
    config
}

/// A floor at this height (m), whose sites together have this stiffness (N/m), each alone a third of it.
fn floor(height: f64, stiffness: f64, number: u64) -> Patch {
    let mut patch = Patch::empty();
    (patch.head.sequence, patch.head.time_ns) = (number, number * TICK_NS);
    (patch.head.site_count, patch.head.triangle_count) = (3, 1);
    patch.head.period = 0.016;
    patch.head.triangles[0] = Triangle {
        corners: [0, 1, 2],
        friction: 0.2,
    };
    for (site, place) in patch
        .sites
        .iter_mut()
        .zip([[-0.1, -0.1], [0.1, -0.1], [0.0, 0.2]])
    {
        site.place = Vec3::new(place[0], place[1], height);
    }
    // All sites move together, as a plate on a spring does.
    for row in patch.compliance.iter_mut().take(3) {
        for block in row.iter_mut().take(3) {
            block.fill_diagonal(1.0 / stiffness);
        }
    }
    patch.head.stiffness = stiffness;
    let more = (1.0 / STIFFEST - 1.0 / stiffness).max(0.0);
    patch.head.floor.fill_diagonal(more);
    patch
}

struct Run {
    controller: Controller,
    number: u64,
    /// The rotation vector of the hands (rad).
    turn: Vec3,
}

impl Run {
    fn new(config: &ControllerConfig) -> Self {
        let controller = Controller::new(config);
        Self {
            controller,
            number: 0,
            turn: Vec3::zeros(),
        }
    }

    /// A tick with hands at these places and velocities.
    fn tick(&mut self, hands: &[(Vec3, Vec3)]) -> ([Wrench; MAX_DEVICES], Telemetry) {
        let mut readings = [const { Err(DeviceError::NoReport) }; MAX_DEVICES];
        for (reading, (place, velocity)) in readings.iter_mut().zip(hands) {
            *reading = Ok(DeviceState {
                pose: self.pose(*place),
                twist: Twist {
                    linear: *velocity,
                    angular: Vec3::zeros(),
                },
                ..DeviceState::resting()
            });
        }
        self.number += 1;
        self.controller.tick(self.number * TICK_NS, &readings)
    }

    /// A hand at a place.
    fn pose(&self, place: Vec3) -> Pose {
        Pose {
            rotation: UnitQuaternion::from_scaled_axis(self.turn),
            ..Pose::at(place)
        }
    }

    /// Hands over a floor that is as old as this number of ticks.
    fn patch(&mut self, device: usize, height: f64, stiffness: f64) {
        let patch = floor(height, stiffness, self.number + 1);
        self.controller.accept_patch(device, &patch).unwrap();
    }
}

/// A hand that goes down from 2 mm above contact to this depth below it (m) at 0.05 m/s, and stays there.
fn pressing(number: u64, depth: f64) -> (Vec3, Vec3) {
    let way = 0.05 * PERIOD * number as f64;
    let moves = way < 2e-3 + depth;
    let z = RADIUS + (2e-3 - way).max(-depth);
    let speed = if moves { -0.05 } else { 0.0 };
    (Vec3::z() * z, Vec3::z() * speed)
}

#[test]
fn the_felt_stiffness_is_the_lesser_one_of_surface_and_device() {
    for stiffness in [300.0, 900.0, 5000.0, 1e9] {
        let mut run = Run::new(&config(1, &[0]));
        let mut force = Vec3::zeros();
        for number in 0..300 {
            if number % 16 == 0 {
                run.patch(0, 0.0, stiffness);
            }
            force = run.tick(&[pressing(number, 1e-3)]).0[0].force;
        }
        let felt = force.z / 1e-3;
        let expected = stiffness.min(STIFFEST);
        // The patches tell a host that has not solved the contact: the offsets of its messages fade to no force.
        assert!(
            (felt / expected - 1.0).abs() < 1e-6,
            "{felt} {expected} {force}"
        );
        assert!(force.xy().norm() < 1e-9);
        let tool = run.controller.tools().next().unwrap();
        // `K d^2 / 2`, and the steps of 50 um by which the hand comes: 3 mN over 1 mm.
        let account = tool.energy();
        assert!((account.supplied / (0.5 * expected * 1e-6) - 1.0).abs() < 0.06);
        assert!((account.stored / (0.5 * expected * 1e-6) - 1.0).abs() < 1e-3);
        assert_eq!((tool.state(), account.capped), (HostState::Live, 0));
    }
}

#[test]
fn two_tools_do_not_feel_each_other() {
    // Each presses on a floor of its own; the other one is silent, moves, or loses its device.
    let alone = |device: usize| {
        let mut run = Run::new(&config(2, &[device]));
        forces(&mut run, &[device], device)
    };
    for device in [0, 1] {
        let mut both = Run::new(&config(2, &[0, 1]));
        assert_eq!(forces(&mut both, &[0, 1], device), alone(device));
    }
}

/// The forces on a device while these tools have patches.
fn forces(run: &mut Run, tools: &[usize], device: usize) -> Vec<Vec3> {
    let stiffness = [400.0, 800.0];
    let mut all = Vec::new();
    for number in 0..400 {
        for tool in tools {
            if number % 16 == 3 * *tool as u64 {
                run.patch(*tool, 1e-3 * *tool as f64, stiffness[*tool]);
            }
        }
        let wave = Vec3::x() * (1e-3 * (0.05 * number as f64).sin());
        let hands = [1e-3, 2e-3].map(|depth| {
            let (place, velocity) = pressing(number, depth);
            (place + wave, velocity)
        });
        all.push(run.tick(&hands).0[device].force);
    }
    assert!(all.iter().any(|force| force.z > 0.3));
    all
}

#[test]
fn a_patch_that_ages_fades_the_force_and_a_new_one_brings_it_back_without_a_jump() {
    let mut run = Run::new(&config(1, &[0]));
    let (mut last, mut states, mut most) = (0.0, Vec::new(), 0.0_f64);
    for number in 0..900 {
        // No patch from 0.3 s to 0.6 s.
        if number % 16 == 0 && !(300..600).contains(&number) {
            run.patch(0, 0.0, 500.0);
        }
        let (commands, telemetry) = run.tick(&[pressing(number, 2e-3)]);
        let force = commands[0].force.z;
        if number > 150 {
            most = most.max((force - last).abs());
        }
        last = force;
        let record = telemetry.tools().next().unwrap();
        if states.last() != Some(&record.state) {
            states.push(record.state);
        }
        match number {
            250 | 880 => assert!((force - 1.0).abs() < 1e-6, "{number}: {force}"),
            // The law goes on: only what is rendered has faded.
            550 => {
                assert_eq!((force, record.trust), (0.0, 0.0));
                assert!((record.wrench.force.z - 1.0).abs() < 1e-6);
            }
            _ => {}
        }
    }
    let expected = [HostState::Live, HostState::Fading, HostState::Held];
    assert_eq!(states[..3], expected);
    assert_eq!(states[3..], [HostState::Live]);
    // The steepest tick of the smooth step over 50 ms.
    assert!(most < 1.5 * PERIOD / 0.05 * 1.001, "{most}");
    let tool = run.controller.tools().next().unwrap();
    assert_eq!(tool.counters().faded, 1);
    assert!(tool.held_back().aged.most > 0.99);
}

#[test]
fn a_pause_of_the_device_leaves_no_jump() {
    let mut run = Run::new(&config(1, &[0]));
    let mut last = 0.0;
    for number in 0..500_u64 {
        if number % 16 == 0 {
            run.patch(0, 0.0, 500.0);
        }
        let hand = [pressing(number, 2e-3)];
        let hands = if (200..300).contains(&number) {
            &hand[..0]
        } else {
            &hand[..]
        };
        let force = run.tick(hands).0[0].force.z;
        assert!(number < 301 || (force - last).abs() < 0.1, "{number}");
        last = force;
    }
    assert!((last - 1.0).abs() < 1e-6, "{last}");
}

#[test]
fn patches_that_cannot_be_used_are_refused_by_reason() {
    let mut run = Run::new(&config(2, &[1]));
    run.tick(&[]);
    let good = floor(0.0, 500.0, 1);
    assert_eq!(
        run.controller.accept_patch(0, &good),
        Err(PatchFault::NoTool)
    );
    assert_eq!(run.controller.accept_patch(1, &good), Ok(()));
    let mut bad = floor(0.0, 500.0, 2);
    bad.sites[1].force.y = f64::NAN;
    assert_eq!(
        run.controller.accept_patch(1, &bad),
        Err(PatchFault::NotFinite)
    );
    bad = floor(0.0, 500.0, 2);
    bad.head.triangles[0].corners[2] = 3;
    assert_eq!(run.controller.accept_patch(1, &bad), Err(PatchFault::Sites));
    assert_eq!(
        run.controller.accept_patch(1, &good),
        Err(PatchFault::Outdated)
    );
    // Newer by its number, and no newer by its time.
    bad = good.clone();
    bad.head.sequence = 2;
    assert_eq!(
        run.controller.accept_patch(1, &bad),
        Err(PatchFault::Outdated)
    );
    // Farther ahead than the age limit.
    bad.head.time_ns = 200 * TICK_NS;
    assert_eq!(
        run.controller.accept_patch(1, &bad),
        Err(PatchFault::ToCome)
    );
    assert_eq!(
        run.controller.accept_patch(1, &floor(0.0, 500.0, 2)),
        Ok(())
    );
    let counted = ToolCounters {
        accepted: 2,
        not_finite: 1,
        wrong_sites: 1,
        outdated: 2,
        to_come: 1,
        faded: 0,
    };
    let tool = run.controller.tools().next().unwrap();
    assert_eq!((tool.device(), tool.counters()), (1, counted));
    assert_eq!(run.controller.stray_patches(), 1);
}

/// A spring of 200 N/m for the first device.
fn spring(time_ns: u64) -> LocalModel {
    let mut model = LocalModel::empty();
    (model.head.sequence, model.head.time_ns) = (time_ns, time_ns);
    (model.head.period, model.head.horizon) = (0.016, 0.016);
    model.head.handle_count = 1;
    for axis in 0..3 {
        model.stiffness[0][0][(axis, axis)] = 200.0;
    }
    model
}

fn held(config: &mut ControllerConfig) {
    let body = CouplingConfig {
        scheme: Scheme::Capped,
        period: PERIOD,
        blend: 0.5,
        age_limit: 10.0,
        decay: 0.1,
        recovery: 0.1,
        hold_damping: [1.0; MAX_DEVICES],
        passivity: PassivityConfig::new(PERIOD),
    };
    config.bodies.push(body).unwrap();
}

#[test]
fn a_tool_far_from_everything_changes_no_command() {
    let run = |tools: &[usize]| {
        let mut config = config(2, tools);
        held(&mut config);
        let mut run = Run::new(&config);
        run.controller.accept(0, &spring(1)).unwrap();
        let mut all = Vec::new();
        for number in 0..300 {
            if number % 16 == 0 {
                for device in tools {
                    run.patch(*device, -0.5, 500.0);
                }
            }
            let hand = pressing(number, 3e-3);
            all.push(run.tick(&[hand, hand]).0);
        }
        all
    };
    let (none, both) = (run(&[]), run(&[0, 1]));
    let bits = |commands: &[Wrench; MAX_DEVICES]| {
        commands.map(|wrench| {
            let stacked = wrench.stacked();
            stacked.map(f64::to_bits)
        })
    };
    assert!(none.iter().map(bits).eq(both.iter().map(bits)));
    assert!(none.iter().any(|commands| commands[0].force.norm() > 0.5));
}

#[test]
fn the_force_of_a_tool_adds_to_that_of_a_held_body_and_a_limit_reduces_both() {
    for max_force in [f64::INFINITY, 0.5] {
        let mut config = config(1, &[0]);
        config.devices[0].safety.max_force = max_force;
        held(&mut config);
        let mut run = Run::new(&config);
        run.controller.accept(0, &spring(1)).unwrap();
        let mut last = ([Wrench::zero(); MAX_DEVICES], Telemetry::empty());
        for number in 0..400 {
            if number % 16 == 0 {
                run.patch(0, 0.0, 500.0);
            }
            last = run.tick(&[pressing(number, 2e-3)]);
        }
        // The spring pulls the hand from 3 mm down to zero by 0.6 N, the floor presses it up by 1 N.
        let force = last.0[0].force.z;
        let whole = 1.0 - 0.2 * (RADIUS - 2e-3) * 1e3;
        assert!((force - whole.min(max_force)).abs() < 1e-6, "{force}");
        assert_eq!(last.1.tool_count, 1);
        let record = last.1.tick_record();
        let place = record.tools[0].expect("the device has a tool");
        // The proxy is where the floor yields to: 2 mm deep.
        assert!(
            (place.position - Vec3::z() * (RADIUS - 2e-3)).norm() < 1e-6,
            "{place:?}"
        );
        assert_eq!(record.tools[1], None);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_patch_gives_the_hand_more_than_the_allowance(
        numbers in proptest::collection::vec(-1.0..1.0_f64, 40 * 8),
        rate in 0.5..30.0_f64,
        reach in 0.2e-3..8e-3_f64,
        softness in prop_oneof![Just(0.0), 1e-4..1e-2_f64],
        friction in 0.0..1.0_f64,
        turns in any::<bool>(),
    ) {
        let mut config = config(1, &[0]);
        if turns {
            config.devices[0].safety.actuated = Freedom::Six;
            let plate = [[0.02, 0.01], [-0.02, 0.01], [-0.02, -0.01], [0.02, -0.01]];
            let tool = &mut config.tools[0].as_mut().unwrap().tool;
            tool.hull = Hull::new(&plate.map(|[x, y]| Vec3::new(x, y, 0.0))).unwrap();
            tool.turns = true;
        }
        let mut run = Run::new(&config);
        let (mut supplied, mut last, mut wrench) = (0.0, None::<Pose>, Wrench::zero());
        for number in 0..640_u64 {
            if number % 16 == 0 {
                let at = number as usize / 16 * 8;
                let n = &numbers[at..at + 8];
                let mut patch = floor(2e-3 * n[0], 1e3, run.number + 1);
                patch.head.damping = 0.02 * n[1].abs();
                patch.head.triangles[0].friction = friction;
                patch.head.floor.fill_diagonal(n[2].abs() / STIFFEST);
                patch.head.turning_floor.fill_diagonal(n[3].abs() / 5.0);
                for (site, n) in patch.sites.iter_mut().zip(n.windows(3)) {
                    *site = Site {
                        vertex: u32::from(n[0] > 0.5),
                        place: site.place + Vec3::new(n[0], n[1], n[2]) * 2e-3,
                        velocity: Vec3::new(n[2], n[0], n[1]) * 0.1,
                        drift: Vec3::new(n[1], n[0], n[2]) * 0.1,
                        force: Vec3::new(n[1], n[2], n[0]) * 2.0,
                    };
                }
                for (i, row) in patch.compliance.iter_mut().enumerate().take(3) {
                    for (j, block) in row.iter_mut().enumerate().take(3) {
                        block.fill_diagonal(n[i + j] * softness);
                    }
                }
                run.controller.accept_patch(0, &patch).unwrap();
            }
            let time = number as f64 * PERIOD;
            let turn = 2.0 * core::f64::consts::PI * rate * time;
            let hand = Vec3::new(
                reach * (0.7 * turn).sin(),
                reach * (1.3 * turn).cos(),
                RADIUS + reach * turn.cos(),
            );
            if turns {
                run.turn = Vec3::new((0.9 * turn).sin(), (1.1 * turn).cos(), turn.sin()) * 0.2;
            }
            let pose = run.pose(hand);
            if let Some(last) = last.replace(pose) {
                supplied -= wrench.stacked().dot(&pose.displacement_from(&last));
            }
            let velocity = Vec3::z() * (-reach * turn.sin() * turn / time.max(PERIOD));
            let (commands, _) = run.tick(&[(hand, velocity)]);
            wrench = commands[0];
            prop_assert!(wrench.is_finite(), "{wrench:?}");
            prop_assert!(turns || wrench.moment == Vec3::zeros());
            prop_assert!(supplied > -1e-3, "{number}: {supplied:e}");
        }
        let tool = run.controller.tools().next().unwrap();
        prop_assert!(tool.energy().least > -1e-3, "{:?}", tool.energy());
        prop_assert_eq!(tool.counters().accepted, 40);
    }
}
