use super::*;
use proptest::prelude::*;

const DOWN: Vec3 = Vec3::new(0.0, 0.0, -2.0);

fn exact(kind: TaskKind) -> Task {
    Task {
        variation: 0.0,
        ..Task::new(kind, DOWN)
    }
}

fn at(trajectory: &Trajectory, time: f64) -> Vec3 {
    trajectory.at(time).0
}

#[test]
fn names_are_those_of_the_kinds() {
    for (name, kind) in TaskKind::ALL {
        assert_eq!(kind.name(), name);
    }
}

#[test]
fn each_task_follows_its_description() {
    let close = |a: Vec3, b: [f64; 3]| (a - Vec3::from(b)).norm() < 1e-15;
    // 0.3 s of rest, 0.1 s in, 0.1 s out; the fifth tap repeats the first.
    let tap = exact(TaskKind::Tap).trajectory(1).unwrap();
    for start in [0.0, 0.5, 2.0, 500.0] {
        assert_eq!(at(&tap, start + 0.25), Vec3::zeros());
        // The remainder of 500 s rounds at 1e-13, times a speed below 0.2 m/s.
        assert!((at(&tap, start + 0.4) - Vec3::new(0.0, 0.0, -0.01)).norm() < 1e-13);
        assert!((at(&tap, start + 0.35).z + 0.005).abs() < 1e-13);
    }
    let press = exact(TaskKind::PressAndHold).trajectory(1).unwrap();
    assert_eq!(at(&press, 0.2), Vec3::zeros());
    assert!(close(at(&press, 0.41), [0.0, 0.0, -0.01]));
    assert!(close(at(&press, 1e4), [0.0, 0.0, -0.01]));
    // The hand stays in while it swings sideways by 10 mm, once a second.
    let rub = exact(TaskKind::Rub).trajectory(1).unwrap();
    let sideways: Vec<_> = (0..1000)
        .map(|k| at(&rub, 1.0 + 1e-3 * f64::from(k)))
        .inspect(|place| assert!((place.z + 0.005).abs() < 1e-15))
        .map(|place| place.xy().norm())
        .collect();
    let most = sideways.iter().copied().fold(0.0, f64::max);
    // A peak lies within half a millisecond of a sample: (2 pi 0.5 ms)^2 / 2 = 5e-6 of it.
    assert!((most / 0.01 - 1.0).abs() < 1e-5, "{most}");
    // Half a second of rest, 0.67 s out, half a second of rest there, 0.67 s back.
    let pull = exact(TaskKind::PullApart).trajectory(1).unwrap();
    assert!(close(at(&pull, 1.4), [0.0, 0.0, -0.02]));
    assert!(close(at(&pull, 2.4), [0.0; 3]));
    // Out, across, back, home: 0.6, 0.4, 0.6 and 0.4 s including their rests.
    let round = exact(TaskKind::MoveTogether).trajectory(1).unwrap();
    assert!(close(at(&round, 0.65), [0.0, 0.0, -0.02]));
    let across = at(&round, 1.05);
    assert!((across.xy().norm() - 0.01).abs() < 1e-15 && (across.z + 0.02).abs() < 1e-15);
    assert!(close(at(&round, 1.65) - across, [0.0, 0.0, 0.02]));
    assert!(close(at(&round, 2.05), [0.0; 3]));
    let shake = exact(TaskKind::Shake).trajectory(1).unwrap();
    let places: Vec<_> = (0..10_000)
        .map(|k| at(&shake, 1.0 + 1e-3 * f64::from(k)))
        .collect();
    let most = |f: fn(&Vec3) -> f64| places.iter().map(f).fold(0.0, f64::max);
    // As above, with 3 Hz: 4.4e-5.
    assert!((most(|p| p.z.abs()) / 0.01 - 1.0).abs() < 1e-4);
    assert!((0.003..0.0043).contains(&most(|p| p.xy().norm())));
}

#[test]
fn seeds_vary_within_the_fraction_and_repeat() {
    for (name, kind) in TaskKind::ALL {
        let task = Task::new(kind, Vec3::new(1.0, 2.0, 0.5));
        let places = |seed| {
            let trajectory = task.trajectory(seed).unwrap();
            (0..2000)
                .map(|k| at(&trajectory, 5e-3 * f64::from(k)))
                .collect::<Vec<_>>()
        };
        assert_eq!(places(1), places(1), "{name}");
        assert_ne!(places(1), places(2), "{name}");
        let along = task.direction.normalize();
        let deepest = places(1).iter().map(|p| p.dot(&along)).fold(0.0, f64::max);
        // The depth varies by a tenth.
        let fraction = deepest / task.depth;
        assert!((0.89..1.101).contains(&fraction), "{name} {fraction}");
    }
}

#[test]
fn senseless_numbers_are_refused_and_named() {
    let tap = Task::new(TaskKind::Tap, DOWN);
    let error = |task: Task| task.trajectory(1).unwrap_err().to_string();
    for (task, expected) in [
        (
            Task {
                direction: Vec3::zeros(),
                ..tap
            },
            "a task's direction must be finite and not zero, not [0.0, 0.0, 0.0]",
        ),
        (
            Task {
                depth: -0.01,
                ..tap
            },
            "a task's depth must be above 0 and up to 10, not -0.01",
        ),
        (
            Task {
                pause: f64::NAN,
                ..tap
            },
            "a task's pause must be from 0 to 10, not NaN",
        ),
        (
            Task {
                frequency: 6.0,
                ..tap
            },
            "a task's frequency must be above 0 and up to 5, not 6",
        ),
        (
            Task {
                speed: 2.0,
                variation: 0.0,
                ..tap
            },
            "a reach of 0.01 m at 2 m/s takes less than 0.05 s, and no hand is so fast: lower the speed",
        ),
    ] {
        assert_eq!(error(task), expected);
    }
}

proptest! {
    #[test]
    fn any_task_starts_at_rest_and_moves_without_a_jump(
        kind in 0..TaskKind::ALL.len(), seed in any::<u64>(),
        direction in (-1.0..1.0_f64, -1.0..1.0_f64, 0.1..1.0_f64),
        variation in 0.0..0.5_f64, pause in 0.0..1.0_f64,
    ) {
        let direction = Vec3::new(direction.0, direction.1, direction.2);
        let task = Task { pause, variation, ..Task::new(TaskKind::ALL[kind].1, direction) };
        // Some tasks at some variations have reaches that are too fast, and are refused.
        if let Ok(trajectory) = task.trajectory(seed) {
            prop_assert_eq!(trajectory.at(0.0), (Vec3::zeros(), Vec3::zeros()));
            let mut before = trajectory.at(0.0);
            for k in 1..5000 {
                let now = trajectory.at(2e-3 * f64::from(k));
                // The fastest reach has 1.875 * 0.1 / 0.5 m/s = 0.4 m/s. A shake has less: 0.01 * 2 pi 4.5 Hz.
                prop_assert!((now.0 - before.0).norm() < 0.4 * 2e-3);
                // The velocity does not jump: its slope is at most 5.8 d / T^2 = 5.8 * 0.015 / 0.05^2 = 35 m/s^2.
                prop_assert!((now.1 - before.1).norm() < 35.0 * 2e-3);
                before = now;
            }
        }
    }
}
