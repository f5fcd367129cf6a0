//! A few cells of the study. Each check is shown to be able to fail.

use super::*;
use crate::stress::Study as _;

fn run(seed: u64, cell: u64, devices: &[StudyDevice]) -> Outcome {
    let study = Study {
        seed,
        cells: cell + 1,
        devices: devices.to_vec(),
    };
    study.cell(cell, &|_| ())
}

#[test]
fn bad_input_of_every_kind_is_met_and_survived() {
    let mut met: BTreeMap<String, u64> = BTreeMap::new();
    for cell in 0..16 {
        let outcome = run(1, cell, &[]);
        assert!(outcome.passed(), "cell {cell}: {outcome:?}");
        assert_eq!(outcome.ticks, TICKS);
        for (event, count) in outcome.met {
            *met.entry(event).or_default() += count;
        }
    }
    for (event, count) in met {
        assert!(count > 0, "no cell met: {event}");
    }
}

#[test]
fn a_cell_is_a_function_of_its_number_and_the_seed() {
    assert_eq!(run(3, 7, &[]), run(3, 7, &[]));
}

#[test]
fn the_limits_of_a_cell_are_those_of_its_device() {
    let mut device = StudyDevice::built_in().remove(5);
    assert!(device.model.rotation.is_some(), "its handle turns");
    // A rate at which a stretch has another number of ticks.
    device.model.rate_hz = 4000;
    let devices = [StudyDevice::built_in().remove(0), device];
    for (cell, device) in (0..4).zip(devices.iter().cycle()) {
        let config = config(Chance::new(1, cell), Scheme::Capped, Some(&device.model));
        for one in &config.devices {
            assert_eq!(one.safety.max_force, device.model.max_force);
            let period = 1.0 / f64::from(device.model.rate_hz);
            assert!((one.safety.period / period - 1.0).abs() < 1e-12);
        }
        let outcome = run(1, cell, &devices);
        assert_eq!(outcome.device.as_ref(), Some(&device.name));
        assert!(outcome.passed(), "cell {cell}: {outcome:?}");
        assert!(outcome.met["models used"] > 0 && outcome.met["wrenches limited"] > 0);
    }
}

#[test]
fn every_check_detects_its_fault() {
    let chance = Chance::new(1, 1);
    let config = config(chance, Scheme::Linear, None);
    let quiet = [Wrench::zero(); MAX_DEVICES];
    let mut strong = quiet;
    strong[0].force.x = 1e3;
    let mut none = quiet;
    none[0].force.x = f64::NAN;
    let mut lost = Telemetry::empty();
    lost.body_count = 1;
    lost.bodies[0].energy.available = f64::NAN;
    let mut outcome = Outcome::default();
    look(&config, &strong, &quiet, &Telemetry::empty(), &mut outcome);
    assert_eq!(outcome.beyond, 1);
    look(&config, &none, &quiet, &lost, &mut outcome);
    assert_eq!((outcome.not_finite, outcome.lost_account), (1, 1));
    assert!(!is_back(&lost));
    assert!(!outcome.passed());
}
