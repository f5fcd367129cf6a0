//! The fit, part by part: on sums and records whose result is known.

use super::*;

const PERIOD: f64 = 1e-3;

fn sample(offset: f64) -> Sample {
    Sample { offset, force: 0.0 }
}

fn record(offsets: impl IntoIterator<Item = f64>) -> Vec<Sample> {
    offsets.into_iter().map(sample).collect()
}

#[track_caller]
fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} {expected}");
}

/// The sums of rows of five columns and a target.
fn sums(rows: &[[f64; 6]]) -> Sums {
    let mut sums = Sums::ZERO;
    for row in rows {
        let products = row.map(|a| row.map(|b| a * b));
        sums = sums.plus(
            &Sums {
                products,
                rows: 1.0,
            },
            1.0,
        );
    }
    sums
}

#[test]
fn least_squares_finds_the_columns_and_what_they_do_not_explain() {
    // y = 2 a - 3 b + 0.5 c + d, and an error that is orthogonal to every column.
    let columns = [
        [1.0, 0.0, 2.0, 1.0, 4.0],
        [0.0, 3.0, 1.0, 1.0, 1.0],
        [2.0, 1.0, 0.0, 1.0, 9.0],
        [5.0, 2.0, 7.0, 1.0, 2.0],
        [1.0, 1.0, 1.0, 0.0, 0.0],
    ];
    let rows = columns.map(|[a, b, c, d, e]| [a, b, c, d, e, 2.0 * a - 3.0 * b + 0.5 * c + d]);
    let (found, remains) = sums(&rows).solve::<FREE>().unwrap();
    for (found, expected) in found.iter().zip([2.0, -3.0, 0.5, 1.0]) {
        near(*found, expected, 1e-9);
    }
    near(remains, 0.0, 1e-9);
    let mut apart = rows.to_vec();
    apart.push([0.0, 0.0, 0.0, 0.0, 0.0, 3.0]);
    let (same, remains) = sums(&apart).solve::<FREE>().unwrap();
    near(same[0], 2.0, 1e-9);
    near(remains, 9.0, 1e-9);
    let all = sums(&apart);
    assert_eq!(all.rows, 6.0);
    let back = all.plus(&sums(&apart[5..]), -1.0);
    assert_eq!(back.rows, 5.0);
    near(back.solve::<FREE>().unwrap().1, 0.0, 1e-9);
    // Columns that depend on each other have no solution.
    let equal: Vec<_> = rows
        .iter()
        .map(|r| [r[0], r[0], r[2], r[3], r[4], r[5]])
        .collect();
    assert!(sums(&equal).solve::<FREE>().is_none());
}

#[test]
fn a_solution_without_a_positive_mass_is_none() {
    let rows = |mass: f64| -> Vec<[f64; 6]> {
        let columns = [
            [1.0, 0.0, 2.0, 1.0],
            [0.0, 3.0, 1.0, 1.0],
            [2.0, 1.0, 0.0, 1.0],
            [5.0, 2.0, 7.0, 1.0],
        ];
        columns
            .map(|[a, b, c, d]| [a, b, c, d, 0.0, (a + 3.0 * b + 0.5 * c - d) / mass])
            .to_vec()
    };
    let found = mechanics(&sums(&rows(0.5))).unwrap();
    for (found, expected) in found.iter().zip([0.5, 3.0, 0.5, -1.0]) {
        near(*found, expected, 1e-9);
    }
    assert!(mechanics(&sums(&rows(-0.5))).is_none());
}

#[test]
fn lines_are_taken_from_every_column() {
    let times = [0.0, 0.1, 0.2, 0.3, 0.4];
    let line = |t: f64, k: usize| k as f64 + 1.0 + (2.0 - k as f64) * t;
    // In the last column a part remains that has neither mean nor slope.
    let bend = [2.0, -1.0, -2.0, -1.0, 2.0];
    let mut rows: Vec<(f64, [f64; 6])> = (times.iter().zip(bend))
        .map(|(t, bend)| {
            (
                *t,
                core::array::from_fn(|k| line(*t, k) + if k == 5 { bend } else { 0.0 }),
            )
        })
        .collect();
    without_lines(&mut rows);
    for ((_, row), bend) in rows.iter().zip(bend) {
        for value in &row[..5] {
            near(*value, 0.0, 1e-12);
        }
        near(row[5], bend, 1e-12);
    }
    let mut one = [(0.3, [1.0; 6])];
    without_lines(&mut one);
    assert_eq!(one[0].1, [0.0; 6]);
    without_lines(&mut []);
}

#[test]
fn a_swing_lasts_as_long_as_the_handle_moves_one_way() {
    // 5 ms on either side: ten ticks at 0.4 counts each are four counts, and at 0.3 counts three.
    let path = |parts: &[(usize, f64)]| {
        let mut x = 0.0;
        let steps = parts
            .iter()
            .flat_map(|(n, step)| core::iter::repeat_n(*step, *n));
        record(
            core::iter::once(0.0)
                .chain(steps.map(|step| {
                    x += step;
                    x
                }))
                .collect::<Vec<_>>(),
        )
    };
    let found = |samples: &[Sample]| -> Vec<(usize, usize, f64)> {
        let swings = swings_of(samples, 1.0, PERIOD);
        swings
            .iter()
            .map(|swing| (swing.from, swing.to, swing.sign))
            .collect()
    };
    let forth_and_back = path(&[(50, 0.4), (50, -0.4)]);
    // Both directions need 3.5 of 4 counts: at nine of ten ticks in one direction the motion is 3.2 counts.
    assert_eq!(found(&forth_and_back), [(5, 51 - 5, 1.0), (55, 96, -1.0)]);
    assert_eq!(
        found(&path(&[(50, 0.35 + 1e-9)])).len(),
        1,
        "at the bound the handle moves"
    );
    assert_eq!(found(&path(&[(50, 0.34)])), []);
    // 30 ms is the shortest swing: 29 ticks and the five on either side.
    assert_eq!(found(&path(&[(39, 0.4)])).len(), 1);
    assert_eq!(found(&path(&[(38, 0.4)])), []);
    // A lost reading in a swing does not cut it; the swing begins at a reading.
    let mut lost = forth_and_back.clone();
    lost[20].offset = f64::NAN;
    assert_eq!(found(&lost), [(5, 46, 1.0), (55, 96, -1.0)]);
    lost[5].offset = f64::NAN;
    lost[6].offset = f64::NAN;
    assert_eq!(found(&lost)[0], (7, 46, 1.0));
    // The span is counted in counts of the device.
    assert_eq!(swings_of(&forth_and_back, 2.0, PERIOD).len(), 0);
    // At twice the period the spans have half of the ticks.
    assert_eq!(swings_of(&path(&[(50, 0.8)]), 1.0, 2.0 * PERIOD)[0].from, 3);
}

#[test]
fn the_smallest_change_and_the_span_are_those_of_the_readings() {
    let counted = record([1e-5, 4e-5, 4e-5, f64::NAN, 1e-5, -1e-5, -1.000_000_000_1e-5]);
    near(smallest_change(&counted), 2e-5, 1e-12);
    near(span_of(&counted), 5e-5, 1e-12);
    assert_eq!(smallest_change(&record([1.0, 1.0])), f64::INFINITY);
}

/// A mass with viscous damping, Coulomb friction, a spring and a constant force, that a force moves in one direction.
struct Motion {
    numbers: [f64; 4],
    spring: f64,
    /// Time from the write of a force to its start (periods).
    delay: f64,
}

impl Motion {
    /// A swing of 60 ms from a speed, under a force that changes in every tick; the record has ten ticks before it.
    fn record(&self, speed: f64, force: impl Fn(usize) -> f64) -> Vec<Sample> {
        const STEPS: usize = 1000;
        let [mass, damping, friction, bias] = self.numbers;
        let dt = PERIOD / STEPS as f64;
        let (mut x, mut v) = (0.003, speed);
        let mut samples = Vec::new();
        for tick in 0..70 {
            let offset = if tick < 10 { 0.0 } else { x };
            samples.push(Sample {
                offset,
                force: force(tick),
            });
            if tick < 10 {
                continue;
            }
            for step in 0..STEPS {
                let acts = (tick as f64 + (step as f64 + 0.5) / STEPS as f64 - self.delay).floor();
                let acts = if acts < 0.0 {
                    0.0
                } else {
                    force(acts as usize)
                };
                // Half a step ahead (the midpoint rule).
                let pull = |x: f64, v: f64| {
                    (acts + bias - damping * v - friction * speed.signum() - self.spring * x) / mass
                };
                let middle = v + 0.5 * dt * pull(x, v);
                let next = v + dt * pull(x + 0.5 * dt * v, middle);
                x += dt * middle;
                v = next;
            }
            assert!(v * speed > 0.0, "the swing keeps its direction");
        }
        samples
    }

    /// The sums of many swings of both directions, with a delay that is assumed in the fit.
    fn sums(&self, delay: f64) -> Vec<Sums> {
        let swings = (0..20_u32).map(|k| {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            let speed = sign * (0.2 + 0.013 * f64::from(k));
            let force = move |tick: usize| {
                // Forces of many shapes, so that no two columns of the fit are alike.
                let t = tick as f64 * PERIOD;
                sign * 0.4 + (1.0 + 0.05 * f64::from(k)) * libm::sin(2.0 * f64::from(k) + 150.0 * t)
            };
            let samples = self.record(speed, force);
            sums_of(
                &samples,
                &Swing {
                    from: 10,
                    to: 70,
                    sign,
                },
                PERIOD,
                delay,
            )
        });
        swings.collect()
    }
}

const NUMBERS: [f64; 4] = [0.2, 1.5, 0.15, -0.1];

#[test]
fn a_motion_without_error_gives_its_numbers() {
    for delay in [0.0, 0.3, 1.0, 2.75] {
        let motion = Motion {
            numbers: NUMBERS,
            spring: 0.0,
            delay,
        };
        let whole = total(&motion.sums(delay));
        // Sixty positions a swing, of which two went to the start and the speed at the start.
        assert_eq!(whole.rows, 20.0 * 58.0);
        let found = mechanics(&whole).unwrap();
        println!("{delay} {found:?} {}", whole.solve::<FREE>().unwrap().1);
        for (found, expected) in found.iter().zip(NUMBERS) {
            // The position is integrated by trapezia.
            near(*found, expected, 3e-4);
        }
        let other = mechanics(&total(&motion.sums(delay + 0.5))).unwrap();
        assert!(
            (other[1] - NUMBERS[1]).abs() > 0.01,
            "a wrong delay shows: {other:?}"
        );
    }
}

#[test]
fn a_spring_is_the_fifth_column() {
    let motion = Motion {
        numbers: NUMBERS,
        spring: 40.0,
        delay: 0.0,
    };
    let whole = total(&motion.sums(0.0));
    let (found, _) = whole.solve::<HELD>().unwrap();
    near(found[4] / found[0], 40.0, 0.05);
    near(found[1] / found[0], NUMBERS[1], 0.01);
    near(1.0 / found[0], 0.2, 1e-4);
}

#[test]
fn a_lost_reading_leaves_out_its_row_alone() {
    let motion = Motion {
        numbers: NUMBERS,
        spring: 0.0,
        delay: 0.0,
    };
    let mut samples = motion.record(0.3, |tick| libm::sin(tick as f64));
    let swing = Swing {
        from: 10,
        to: 70,
        sign: 1.0,
    };
    let whole = sums_of(&samples, &swing, PERIOD, 0.0);
    for tick in [20, 21, 40] {
        samples[tick].offset = f64::NAN;
    }
    let lossy = sums_of(&samples, &swing, PERIOD, 0.0);
    assert_eq!((whole.rows, lossy.rows), (58.0, 55.0));
    let part = lossy.products[5][5] / whole.products[5][5];
    assert!((0.9..1.0).contains(&part), "{part}");
}

fn estimate(low: f64, high: f64) -> Estimate {
    Estimate {
        value: 0.5 * (low + high),
        low,
        high,
    }
}

#[test]
fn axes_that_agree_have_their_mean_interval_and_axes_that_differ_a_wider_one() {
    let one = combined(&[estimate(1.0, 2.0)]);
    assert_eq!((one.value, one.low, one.high), (1.5, 1.0, 2.0));
    let agree = combined(&[estimate(1.0, 2.0), estimate(1.5, 2.5), estimate(0.5, 3.5)]);
    near(agree.value, 5.5 / 3.0, 1e-12);
    near(agree.high - agree.value, 2.5 / 3.0, 1e-12);
    near(agree.value - agree.low, 2.5 / 3.0, 1e-12);
    // Of two axes that differ each is outside of the mean's interval.
    let differ = combined(&[estimate(1.0, 1.2), estimate(2.0, 2.2)]);
    assert_eq!((differ.value, differ.low, differ.high), (1.6, 1.1, 2.1));
    // An interval that touches that of the mean does not differ, on either side.
    for sign in [1.0, -1.0] {
        let one = |a: f64, b: f64| estimate((sign * a).min(sign * b), (sign * a).max(sign * b));
        let touch = combined(&[one(0.0, 2.0), one(2.5, 3.0)]);
        let ends = [sign * 1.25, sign * 2.5];
        assert_eq!(
            (touch.low, touch.high),
            (ends[0].min(ends[1]), ends[0].max(ends[1]))
        );
    }
}

/// A record of a sum of sines, of which a count is `step`, under the force that a mass with damping and friction needs.
fn driven(seconds: f64, step: f64, numbers: [f64; 4], spring: f64) -> Vec<Sample> {
    let [mass, damping, friction, bias] = numbers;
    let ticks = (seconds / PERIOD) as usize;
    let sum = |t: f64, order: i32| -> f64 {
        let part = |hz: f64, size: f64| {
            let w = core::f64::consts::TAU * hz;
            size * w.powi(order)
                * libm::sin(w * t + f64::from(order) * core::f64::consts::FRAC_PI_2)
        };
        part(1.3, 4e-3) + part(3.1, 2e-3)
    };
    let force = |t: f64| {
        let v = sum(t, 1);
        mass * sum(t, 2) + damping * v + friction * v.signum() - bias + spring * sum(t, 0)
    };
    (0..ticks)
        .map(|k| {
            let t = k as f64 * PERIOD;
            // A held force is that of the middle of its period.
            Sample {
                offset: (sum(t, 0) / step).round() * step,
                force: force(t + 0.5 * PERIOD),
            }
        })
        .collect()
}

#[test]
fn a_record_gives_the_numbers_with_intervals_that_contain_them() {
    let samples = driven(15.0, 1e-5, NUMBERS, 0.0);
    let found = identify(&[(1, &samples)], PERIOD, 5.0).unwrap();
    println!("{found:?}");
    let [mass, damping, friction, bias] = NUMBERS;
    for (found, expected) in [
        (found.mass, mass),
        (found.damping, damping),
        (found.friction, friction),
    ] {
        near(found.value, expected, 0.01 * expected);
        assert!(found.contains(expected), "{found:?} {expected}");
        assert!(found.high - found.low < 0.02 * expected, "{found:?}");
        near(found.high - found.value, found.value - found.low, 1e-12);
    }
    let axis = found.axes[0];
    assert_eq!((axis.axis, found.axes.len()), (1, 1));
    near(axis.bias, bias, 1e-3);
    near(axis.residual / 1e-5, 1.0 / 12.0_f64.sqrt(), 0.03);
    near(found.position_step, 1e-5, 1e-12);
    assert_eq!((found.delay_periods, found.period), (Some(0.0), PERIOD));
}

#[test]
fn the_interval_is_that_of_the_jackknife() {
    let samples = driven(15.0, 1e-5, NUMBERS, 0.0);
    let swings = swings_of(&samples, 1e-5, PERIOD);
    let sums: Vec<Sums> = swings
        .iter()
        .map(|swing| sums_of(&samples, swing, PERIOD, 0.0))
        .collect();
    let found = identify_axis(0, &samples, &sums, 1e-5).unwrap();
    assert_eq!(found.swings, swings.len());
    // Ten neighbourhoods, each left out once; 2.262 is Student's point for nine degrees of freedom.
    let n = sums.len();
    let without = |group: usize| -> [f64; 4] {
        let left = (0..n).filter(|k| !(group * n / 10..(group + 1) * n / 10).contains(k));
        let left: Vec<Sums> = left.map(|k| sums[k]).collect();
        mechanics(&total(&left)).unwrap()
    };
    let whole = mechanics(&total(&sums)).unwrap();
    for (k, estimate) in [found.mass, found.damping, found.friction]
        .iter()
        .enumerate()
    {
        let squares: f64 = (0..10)
            .map(|group| (without(group)[k] - whole[k]).powi(2))
            .sum();
        let error = (0.9 * squares).sqrt();
        near(estimate.value, whole[k], 1e-9 * whole[k]);
        near(
            (estimate.high - estimate.value) / (2.262 * error),
            1.0,
            1e-3,
        );
        near((estimate.value - estimate.low) / (2.262 * error), 1.0, 1e-3);
    }
}

#[test]
fn a_record_that_does_not_fit_is_refused_with_its_reason() {
    let whole = driven(15.0, 1e-5, NUMBERS, 0.0);
    let refused = |samples: &[Sample]| identify(&[(2, samples)], PERIOD, 5.0).unwrap_err();
    let still = record(vec![0.0; 5000]);
    assert_eq!(
        refused(&still),
        IdentifyError::TooLittleMotion {
            axis: 2,
            moved: 0.0,
            needed: 1e-3,
            force: 5.0
        }
    );
    // Nineteen counts are too little, twenty are enough (and have no swings).
    let stairs =
        |counts: usize| {
            record((0..5000).map(|k| {
                f64::from(u32::from(k > 100)) * counts as f64 + f64::from(u32::from(k == 3))
            }))
        };
    assert!(matches!(
        refused(&stairs(19)),
        IdentifyError::TooLittleMotion {
            moved: 19.0,
            needed: 20.0,
            ..
        }
    ));
    assert!(matches!(
        refused(&stairs(20)),
        IdentifyError::TooFewSwings {
            axis: 2,
            found: 0,
            needed: 20
        }
    ));
    let swings = swings_of(&whole, 1e-5, PERIOD);
    // Up to the end of the nineteenth swing and of the twentieth.
    let few = refused(&whole[..swings[18].to + 6]);
    assert!(
        matches!(
            few,
            IdentifyError::TooFewSwings {
                found: 19,
                needed: 20,
                ..
            }
        ),
        "{few}"
    );
    assert!(identify(&[(2, &whole[..swings[19].to + 6])], PERIOD, 5.0).is_ok());
    // A hand is a spring that makes up a tenth of the forces.
    let held = refused(&driven(15.0, 1e-5, NUMBERS, 60.0));
    assert!(
        matches!(held, IdentifyError::Held { axis: 2, stiffness } if (stiffness - 60.0).abs() < 1.0),
        "{held}"
    );
    assert!(identify(&[(0, &driven(15.0, 1e-5, NUMBERS, 1.0))], PERIOD, 5.0).is_ok());
    // Someone who shakes the handle makes a motion that no mass, damping or friction explains.
    let mut pushed = whole.clone();
    for (k, sample) in pushed.iter_mut().enumerate() {
        sample.offset += 1.5e-4 * libm::sin(0.13 * k as f64);
    }
    let disturbed = refused(&pushed);
    assert!(
        matches!(disturbed, IdentifyError::Disturbed { axis: 2, residual } if residual > 3e-5),
        "{disturbed}"
    );
}

#[test]
fn the_numbers_of_a_device_are_the_means_of_its_axes() {
    let light = driven(15.0, 1e-5, NUMBERS, 0.0);
    let heavy = driven(15.0, 2e-5, [0.3, 1.5, 0.25, 0.0], 0.0);
    let found = identify(&[(0, &light), (2, &heavy)], PERIOD, 5.0).unwrap();
    near(found.mass.value, 0.25, 0.003);
    near(found.friction.value, 0.2, 0.003);
    // The axes differ in mass and friction.
    assert!(
        found.mass.low < 0.201 && found.mass.high > 0.299,
        "{:?}",
        found.mass
    );
    // The count is the smaller one.
    near(found.position_step, 1e-5, 1e-12);
    assert_eq!((found.axes[0].axis, found.axes[1].axis), (0, 2));
}

#[test]
fn a_number_that_cannot_be_negative_ends_at_zero() {
    let found = identify(
        &[(0, &driven(15.0, 1e-5, [0.2, 1.5, 0.0, 0.0], 0.0))],
        PERIOD,
        5.0,
    )
    .unwrap();
    assert!(
        found.friction.low >= 0.0 && found.friction.value >= 0.0 && found.friction.value < 0.01
    );
}

/// A record whose forces were written some periods before they acted.
fn written_before(mut samples: Vec<Sample>, periods: usize) -> Vec<Sample> {
    for k in 0..samples.len() {
        let later = samples.get(k + periods).map_or(0.0, |sample| sample.force);
        samples[k].force = later;
    }
    samples
}

#[test]
fn a_delay_is_told_only_where_the_record_shows_it() {
    for late in [0, 2, 5] {
        let told = |step: f64| {
            let samples = written_before(driven(15.0, step, NUMBERS, 0.0), late);
            identify(&[(0, &samples)], PERIOD, 5.0)
                .unwrap()
                .delay_periods
        };
        assert_eq!(told(1e-5), Some(late as f64));
        // On counts of a tenth of a millimetre, a delay of a period more or less fits as well.
        assert_eq!(told(1e-4), None);
    }
}
