use super::*;
use crate::stress::Study as _;

fn quick() -> Study {
    Study {
        quick: true,
        seed: 3,
        map_rate: None,
        map_delay: 0,
        devices: Vec::new(),
    }
}

#[test]
fn a_device_of_the_users_own_is_measured_at_its_own_rate() {
    let mut device = StudyDevice::built_in().remove(0);
    device.name = "mine".to_owned();
    device.model.damping = 2.0;
    device.model.rate_hz = 2000;
    let study = Study {
        devices: vec![device.clone()],
        ..quick()
    };
    let tasks = study.tasks();
    assert!(
        tasks
            .iter()
            .all(|task| task.device == "mine" && task.rate == 2000)
    );
    let is_boundary = |task: &&Task| matches!(task.case, Case::Passive(0.0, false));
    let task = tasks.iter().find(is_boundary).expect("the plain boundary");
    let Outcome::Passive {
        theory,
        measured: Some(measured),
        ..
    } = study.work(task, 0)
    else {
        panic!("a boundary");
    };
    // K = 2 b / T.
    assert!((theory - 8000.0).abs() < 1e-6, "{theory}");
    assert!((measured / theory - 1.0).abs() < 0.02, "{measured}");
    // The numbers of the device belong to the settings of the file.
    device.model.mass *= 2.0;
    let other = Study {
        devices: vec![device],
        ..quick()
    };
    assert_ne!(study.header(), other.header());
    assert_ne!(study.header(), quick().header());
}

/// The outcomes of the wanted cells of the quick study.
fn cells(wanted: impl Fn(&Task) -> bool) -> Vec<Outcome> {
    let study = quick();
    let tasks = study.tasks();
    let wanted = (0..).zip(&tasks).filter(|(_, task)| wanted(task));
    wanted.map(|(cell, task)| study.work(task, cell)).collect()
}

#[test]
fn boundaries_of_passivity_are_those_of_theory_on_two_devices() {
    let found = cells(|task| matches!(task.case, Case::Passive(..)));
    let mut devices = Vec::new();
    for outcome in &found {
        let Outcome::Passive {
            setting,
            theory,
            measured: Some(measured),
            any_speed,
            ..
        } = outcome
        else {
            panic!("{outcome:?}");
        };
        // The bisection ends at a hundredth, and the adversary must come within 4 % of the boundary. It can never be
        // inside the boundary by more than rounding.
        let error = measured / theory - 1.0;
        assert!((-1e-6..0.05).contains(&error), "{outcome:?}");
        if let Some(any_speed) = any_speed {
            // A hand of limited speed allows more than the bound of Abbott and Okamura, which holds for any speed.
            assert!(measured > any_speed, "{outcome:?}");
        }
        if !devices.contains(&&setting.device) {
            devices.push(&setting.device);
        }
    }
    assert_eq!((devices.len(), found.len()), (2, 10));
}

#[test]
fn walls_on_devices_of_one_and_two_degrees_of_freedom_are_those_of_theory() {
    let slanted = |free| DeviceModel {
        axes: rt_core::Axes::new(free),
        ..DeviceModel::named("hapkit").expect("it is built in")
    };
    for (device, model) in [
        ("hapkit", slanted([true, false, false])),
        ("paddle", slanted([false, false, true])),
        (
            "pantograph",
            DeviceModel::named("pantograph").expect("it is built in"),
        ),
    ] {
        assert!(model.axes.is_some());
        for (fraction, whole) in [(0.0, false), (0.4, false), (0.0, true)] {
            let task = Task {
                device: device.to_owned(),
                model,
                rate: 1000,
                delay: 0,
                case: Case::Passive(fraction, whole),
            };
            let outcome = quick().work(&task, 7);
            let Outcome::Passive {
                theory,
                measured: Some(measured),
                ..
            } = outcome
            else {
                panic!("{outcome:?}");
            };
            // As for the other devices.
            let error = measured / theory - 1.0;
            assert!((-1e-6..0.05).contains(&error), "{device}: {outcome:?}");
        }
    }
}

#[test]
fn boundaries_of_stability_are_those_of_the_eigenvalues() {
    for outcome in cells(|task| matches!(task.case, Case::Stable(..))) {
        let Outcome::Stable {
            theory, measured, ..
        } = outcome
        else {
            panic!("{outcome:?}");
        };
        // The bisection ends at half a hundredth.
        assert!((measured / theory - 1.0).abs() < 0.01, "{outcome:?}");
    }
}

#[test]
fn the_map_has_energy_above_the_line_and_none_below() {
    let found = cells(|task| matches!(task.case, Case::Energy(..)) && task.device == "falcon");
    let mut sides = [0, 0];
    for outcome in &found {
        let Outcome::Energy {
            setting,
            stiffness,
            energy,
            up,
            ..
        } = outcome
        else {
            panic!("{outcome:?}");
        };
        let sampled = Sampled {
            period: 1e-3,
            delay: 0,
            device: setting.device_damping,
            wall: setting.damping,
        };
        let line = sampled.passive();
        assert!(up[0] < *stiffness && *stiffness < up[1]);
        if *stiffness < line {
            // The tolerance is rounding.
            assert!(*energy < 1e-14, "{outcome:?}");
            sides[0] += 1;
        } else if *stiffness > 1.1 * line {
            assert!(*energy > 1e-9, "{outcome:?}");
            sides[1] += 1;
        }
    }
    assert!(sides[0] >= 5 && sides[1] >= 20, "{sides:?}");
}

#[test]
fn the_gain_counts_walls_that_are_safe_and_stiff_enough() {
    let cell = |times, energy, rendered| Outcome::Scheme {
        setting: Setting {
            device: "falcon".to_owned(),
            rate: 1000,
            delay: 0,
            device_damping: 0.5,
            damping: 0.0,
            whole: false,
        },
        scheme: "capped".to_owned(),
        as_hand: false,
        times,
        stiffness: 1000.0 * times,
        energy,
        family: "sines".to_owned(),
        rendered,
    };
    let times = |steps: &[(f64, f64, f64)]| {
        let cells = (0..).zip(steps.iter().map(|s| cell(s.0, s.1, s.2)));
        gains(&cells.collect())[0].times()
    };
    assert_eq!(
        times(&[(1.0, 0.0, 1.0), (5.0, 9e-4, 0.95), (10.0, 2e-3, 1.0)]),
        5.0
    );
    // A wall rendered too softly does not count, nor does a wall beyond a failure.
    assert_eq!(
        times(&[(1.0, 0.0, 1.0), (5.0, 0.0, 0.8), (10.0, 0.0, 1.0)]),
        1.0
    );
    assert_eq!(times(&[(1.0, 2e-3, 1.0), (5.0, 0.0, 1.0)]), 0.0);
}

#[test]
fn the_cap_extracts_less_than_linear() {
    let found = cells(|task| {
        let matching =
            matches!(task.case, Case::Scheme { times, whole: false, .. } if times == 10.0);
        matching && task.device == "falcon"
    });
    let energy = |name: &str| {
        let of = |outcome: &Outcome| match outcome {
            Outcome::Scheme {
                scheme,
                energy,
                rendered,
                ..
            } if scheme == name => Some((*energy, *rendered)),
            _ => None,
        };
        found.iter().find_map(of).expect("a cell")
    };
    let (linear, stiff) = energy("linear");
    // The wall is as stiff as asked, to rounding, if no force is withheld.
    assert!(
        linear > 0.1 && (stiff - 1.0).abs() < 1e-9,
        "{linear} {stiff}"
    );
    let (capped, stiff) = energy("capped");
    assert!(
        capped < 0.01 * linear && stiff > RENDERED,
        "{capped} {stiff}"
    );
}

#[test]
fn a_cell_is_a_function_of_its_number_and_the_seed() {
    let study = quick();
    let tasks = study.tasks();
    for cell in [0, tasks.len() / 2, tasks.len() - 1] {
        let run = || study.work(&tasks[cell], cell as u64);
        assert_eq!(run(), run());
    }
    assert_eq!(study.header().cells, tasks.len() as u64);
}
