//! Identification of simulated devices, whose true numbers are known. Everything runs in virtual time.

use devices::DeviceFile;
use devices::identify::{Estimate, Guide, Identified, IdentifyError};
use rt_core::{Device, DeviceError, DeviceState, Vec3, Wrench};
use sim::{Arm, DeviceModel, Hand, SimDevice, Trajectory};

const MS: u64 = 1_000_000;

fn free(model: DeviceModel) -> SimDevice {
    SimDevice::new(model, None, 1e-3).unwrap()
}

/// The connection between the guide and the device. It may lose a reading, and may change a force on its way.
trait Between {
    fn reading(
        &mut self,
        _tick: u64,
        state: Result<DeviceState, DeviceError>,
    ) -> Result<DeviceState, DeviceError> {
        state
    }
    fn force(&mut self, force: Vec3) -> Vec3 {
        force
    }
    /// Time from the tick to the write (ns).
    fn late_ns(&self) -> u64 {
        0
    }
}

struct Nothing;
impl Between for Nothing {}

/// Runs the guide on a device to its end. Checks that the force keeps to its limit in every tick and is zero at the
/// end, and that a motion without an error keeps to the limits of position and speed, by the true motion.
fn run(mut device: SimDevice, between: &mut dyn Between) -> Result<Identified, IdentifyError> {
    let mut guide = Guide::new(&device.capabilities(), 1e-3).unwrap();
    let (force, distance, speed) = guide.limits();
    let model = *device.model();
    assert_eq!(force, 0.3 * model.max_force);
    assert_eq!(distance, (0.25 * model.workspace_radius).min(0.02));
    assert_eq!(speed, 0.3);
    let start = device.position();
    let mut kept = true;
    let mut progress = 0.0;
    for k in 0.. {
        let reading = between.reading(k, device.read(k * MS));
        let wrench = guide.tick(&reading);
        assert_eq!(wrench.moment, Vec3::zeros());
        assert!(wrench.force.norm() <= force);
        assert!(guide.progress() >= progress && guide.progress() <= 1.0);
        progress = guide.progress();
        device
            .write(
                k * MS + between.late_ns(),
                &Wrench {
                    force: between.force(wrench.force),
                    moment: Vec3::zeros(),
                },
            )
            .unwrap();
        if let Some(result) = guide.result() {
            assert_eq!(wrench, Wrench::zero());
            assert_eq!(guide.tick(&reading), Wrench::zero());
            assert!(kept || result.is_err(), "beyond a limit without an error");
            return result;
        }
        kept &= (device.position() - start).norm() <= distance && device.velocity().norm() <= speed;
    }
    unreachable!("the motion ends by itself")
}

/// The three numbers, each with its true value.
fn numbers(model: &DeviceModel, found: &Identified) -> [(&'static str, f64, Estimate); 3] {
    [
        ("mass", model.mass, found.mass),
        ("damping", model.damping, found.damping),
        ("friction", model.friction, found.friction),
    ]
}

fn row(name: &str, what: &str, is: f64, found: &Estimate) -> String {
    format!(
        "| {name} | {what} | {is:.5} | {:.5} | {:.5} to {:.5} | {:+.2} % |",
        found.value,
        found.low,
        found.high,
        100.0 * (found.value / is - 1.0)
    )
}

fn within_a_tenth(is: f64, found: &Estimate) -> bool {
    (found.value - is).abs() <= 0.1 * is
}

#[test]
fn every_built_in_device_is_identified_within_a_tenth() {
    let (mut all, mut inside) = (0, 0);
    for (name, model) in DeviceModel::all() {
        let found = run(free(model), &mut Nothing).unwrap();
        for (what, is, found) in numbers(&model, &found) {
            let row = row(name, what, is, &found);
            println!("{row}");
            assert!(within_a_tenth(is, &found), "{row}");
            all += 1;
            inside += u32::from(found.contains(is));
        }
        // Rounding of a difference of positions.
        assert!((found.position_step / model.position_step - 1.0).abs() < 1e-9);
        assert_eq!(found.delay_periods, Some(0.0), "{name}");
        for axis in &found.axes {
            // The mean square error of a count is a twelfth of its square, if the handle moves.
            let counts = axis.residual / model.position_step;
            println!(
                "  axis {} swings {} residual {counts:.3}",
                axis.axis, axis.swings
            );
            assert!((0.25..0.35).contains(&counts), "{name} {axis:?}");
        }
    }
    println!("{inside} of {all} intervals");
    // Of 27 intervals of 95 %, 23 or more contain the truth in all but 4 of 1000 cases, were they independent.
    assert!(inside >= 23, "{inside} of {all}");
}

/// Numbers from 0 to 1 (Numerical Recipes' linear congruence).
fn draw(seed: &mut u64) -> f64 {
    *seed = seed
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1_u64 << 53) as f64
}

#[test]
fn devices_with_other_numbers_are_identified() {
    let mut seed = 77_031;
    for name in ["falcon", "omega3", "woodenhaptics"] {
        let base = DeviceModel::named(name).unwrap();
        // From half to twice the number of the built-in device. The seed was chosen after the method was finished.
        let mut other = |value: f64| value * libm::exp2(2.0 * draw(&mut seed) - 1.0);
        let model = DeviceModel {
            mass: other(base.mass),
            damping: other(base.damping),
            friction: other(base.friction),
            ..base
        };
        let found = run(free(model), &mut Nothing).unwrap();
        for (what, is, found) in numbers(&model, &found) {
            let row = row(name, what, is, &found);
            println!("{row}");
            // A damping that is small beside the friction is not always found within a tenth. Its interval says so.
            let weak = what == "damping" && is * 0.3 < 0.1 * model.friction;
            assert!(
                within_a_tenth(is, &found) || (weak && found.contains(is)),
                "{row}"
            );
        }
    }
}

#[test]
fn a_device_that_a_hand_holds_is_refused() {
    for name in ["falcon", "touch", "virtuose6d"] {
        for (grip, arm) in Arm::GRIPS {
            let hand = Hand::new(Trajectory::still()).with_arm(arm);
            let model = DeviceModel::named(name).unwrap();
            let device = SimDevice::new(model, Some(hand), 1e-3).unwrap();
            let error = run(device, &mut Nothing).expect_err(grip);
            assert!(
                matches!(
                    error,
                    IdentifyError::Held { .. }
                        | IdentifyError::TooLittleMotion { .. }
                        | IdentifyError::TooFewSwings { .. }
                        | IdentifyError::Disturbed { .. }
                ),
                "{name} {grip}: {error:?}"
            );
        }
    }
}

#[test]
fn a_hand_that_pulls_the_handle_away_ends_the_motion_at_the_limit() {
    let path = [
        (0.0, Vec3::zeros()),
        (0.5, Vec3::zeros()),
        (2.5, Vec3::x() * 0.05),
    ];
    let slow = Trajectory::new_waypoints(&path).unwrap();
    let fast = [(0.0, Vec3::zeros()), (0.1, Vec3::x() * 0.05)];
    let fast = Trajectory::new_waypoints(&fast).unwrap();
    let error = |path| {
        let hand = Hand::new(path).with_arm(Arm::RIGID);
        let model = DeviceModel::named("touch").unwrap();
        run(
            SimDevice::new(model, Some(hand), 1e-3).unwrap(),
            &mut Nothing,
        )
        .unwrap_err()
    };
    let far = error(slow);
    assert!(
        matches!(far, IdentifyError::TooFar { found, most } if found > most && most == 0.01875)
    );
    assert!(
        far.to_string()
            .contains("allowed are 18.8 mm: put the handle down freely")
    );
    let speed = error(fast);
    assert!(matches!(speed, IdentifyError::TooFast { found, most } if found > most && most == 0.3));
}

/// Loses the readings of the ticks that the function names.
struct Lost(fn(u64) -> bool);

impl Between for Lost {
    fn reading(
        &mut self,
        tick: u64,
        state: Result<DeviceState, DeviceError>,
    ) -> Result<DeviceState, DeviceError> {
        if (self.0)(tick) {
            return Err(DeviceError::NoReport);
        }
        state
    }
}

#[test]
fn a_silent_device_ends_the_motion_and_single_lost_readings_do_not() {
    let model = DeviceModel::named("falcon").unwrap();
    let error = run(free(model), &mut Lost(|tick| tick >= 2000)).unwrap_err();
    assert_eq!(error, IdentifyError::Silent { ticks: 5, most: 5 });
    assert!(run(free(model), &mut Lost(|_| true)).is_err());
    let rarely: fn(u64) -> bool = |tick| tick % 50 < 4;
    let often: fn(u64) -> bool = |tick| tick % 13 == 0;
    for lost in [rarely, often] {
        let found = run(free(model), &mut Lost(lost)).unwrap();
        for (what, is, found) in numbers(&model, &found) {
            assert!(within_a_tenth(is, &found), "{what} {is} {found:?}");
        }
    }
}

/// Delays each force by whole periods and adds a weight.
struct Late {
    forces: Vec<Vec3>,
    weight: Vec3,
}

impl Between for Late {
    fn force(&mut self, force: Vec3) -> Vec3 {
        self.forces.rotate_right(1);
        let late = self.forces[0];
        self.forces[0] = force;
        late + self.weight
    }
}

#[test]
fn a_delay_and_a_weight_are_found_and_do_not_disturb_the_numbers() {
    let model = DeviceModel::named("falcon").unwrap();
    let weight = Vec3::new(0.0, 0.0, -0.2);
    let forces = vec![Vec3::zeros(); 2];
    let found = run(free(model), &mut Late { forces, weight }).unwrap();
    assert_eq!(found.delay_periods, Some(2.0));
    for (what, is, found) in numbers(&model, &found) {
        assert!(within_a_tenth(is, &found), "{what} {is} {found:?}");
    }
    for (axis, weight) in found.axes.iter().zip(weight.iter()) {
        // A twentieth of the weight.
        assert!((axis.bias - weight).abs() < 0.01, "{axis:?}");
    }
}

/// Each force reaches the device within the period in which it is written.
struct Within(u64);

impl Between for Within {
    fn late_ns(&self) -> u64 {
        self.0
    }
}

#[test]
fn a_delay_of_a_part_of_a_period_is_found_and_does_not_disturb_the_numbers() {
    // The damping of these devices is small beside their friction, and a delay that is wrong by a part of a period
    // halves or doubles it.
    for (name, late_ns) in [("omega3", 370_000), ("delta3", 500_000), ("touch", 820_000)] {
        let model = DeviceModel::named(name).unwrap();
        let found = run(free(model), &mut Within(late_ns)).unwrap();
        let delay = found.delay_periods.unwrap();
        // The steps of the delay are a twentieth of a period.
        assert!(
            (delay - late_ns as f64 * 1e-6).abs() <= 0.05,
            "{name} {delay}"
        );
        for (what, is, found) in numbers(&model, &found) {
            println!("{}", row(name, what, is, &found));
            assert!(within_a_tenth(is, &found), "{name} {what} {is} {found:?}");
        }
    }
}

#[test]
fn the_profile_is_a_device_file_with_intervals_and_the_date() {
    for name in ["virtuose6d", "hapkit"] {
        let mut base = DeviceFile::named(name).unwrap();
        base.name = "A \"named\" \\ device".to_owned();
        let found = run(free(base.model), &mut Nothing).unwrap();
        let text = found.profile(&base, "2026-01-14");
        let file = DeviceFile::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-3;
        assert!(near(file.model.mass, found.mass.value));
        assert!(near(file.model.damping, found.damping.value));
        assert!(near(file.model.friction, found.friction.value));
        assert!(near(file.model.position_step, base.model.position_step));
        let expected = DeviceModel {
            mass: file.model.mass,
            damping: file.model.damping,
            friction: file.model.friction,
            position_step: file.model.position_step,
            ..base.model
        };
        assert_eq!((&file.name, file.model), (&base.name, expected));
        let identified = ["mass", "damping", "friction"];
        let kept = |field: &&String| !identified.contains(&field.as_str());
        assert!(base.estimated.iter().filter(kept).eq(&file.estimated));
        for field in ["mass", "damping", "friction"] {
            let source = &file.sources[field];
            assert!(source.contains("2026-01-14: 95 % interval"), "{source}");
        }
        assert_eq!(file.sources["max_force"], base.sources["max_force"]);
    }
}

#[test]
fn senseless_capabilities_are_refused() {
    let model = DeviceModel::named("falcon").unwrap();
    let mut device = model.capabilities();
    device.max_force = f64::NAN;
    let error = Guide::new(&device, 1e-3).unwrap_err();
    assert!(matches!(
        error,
        IdentifyError::Senseless {
            field: "largest force",
            ..
        }
    ));
    assert!(Guide::new(&model.capabilities(), 0.0).is_err());
}
