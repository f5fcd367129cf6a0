//! The law of a tool against analytic results: grooves, edges, the floor, friction, and messages that change nothing.

mod holding;
mod loose;
mod shapes;
mod turning;

use super::*;
use crate::geometry::Mat3;
use alloc::vec::Vec;
use proptest::prelude::*;

const PERIOD: f64 = 1e-3;
const STIFFEST: f64 = 3000.0;

impl Tool {
    /// A tick with the hand at a place (m), not turned. Returns the force on the hand (N).
    fn push(&mut self, hand: &Vec3) -> Vec3 {
        self.tick(&Pose::at(*hand)).force
    }
}

fn ball(radius: f64) -> Tool {
    rounded(&Hull::POINT, radius)
}

fn rounded(hull: &Hull, radius: f64) -> Tool {
    Tool::new(ToolConfig {
        hull: *hull,
        turns: false,
        radius,
        period: PERIOD,
        stiffest: STIFFEST,
        most_damping: f64::INFINITY,
        parting: 0.02,
    })
}

/// An obstacle of these triangles, for a device of 3 kN/m.
fn obstacle(triangles: &[[[f64; 3]; 3]], friction: f64) -> Patch {
    let mut patch = Patch::empty();
    patch.head.sequence = 1;
    patch.head.floor.fill_diagonal(1.0 / STIFFEST);
    let mut places: Vec<Vec3> = Vec::new();
    for (into, triangle) in patch.head.triangles.iter_mut().zip(triangles) {
        into.friction = friction;
        into.corners = triangle.map(|corner| {
            let corner = Vec3::from(corner);
            let known = places.iter().position(|place| *place == corner);
            known.unwrap_or_else(|| {
                places.push(corner);
                places.len() - 1
            }) as u8
        });
    }
    patch.head.triangle_count = triangles.len() as u8;
    patch.head.site_count = places.len() as u8;
    for ((site, place), vertex) in patch.sites.iter_mut().zip(places).zip(0..) {
        (site.place, site.vertex) = (place, vertex);
    }
    patch
}

/// Two half planes along y that meet at the origin, at this slope (rad) on both sides: a groove if positive.
fn ridge(slope: f64) -> [[[f64; 3]; 3]; 4] {
    let (x, z) = (0.1 * slope.cos(), 0.1 * slope.sin());
    let (near, far) = (-0.1, 0.1);
    let edge = |y| [0.0, y, 0.0];
    [
        [edge(near), [x, near, z], edge(far)],
        [edge(far), [x, near, z], [x, far, z]],
        [edge(near), edge(far), [-x, near, z]],
        [[-x, near, z], edge(far), [-x, far, z]],
    ]
}

/// Sixteen sites of a plane, and how they yield: the kernel of a half-space, smoothed over `width` (m), with this compliance (m/N)
/// of a site alone.
fn pad(spacing: f64, compliance: f64, width: f64, friction: f64) -> Patch {
    let mut patch = Patch::empty();
    patch.head.sequence = 1;
    (patch.head.site_count, patch.head.triangle_count) = (16, 18);
    patch.head.stiffness = 1.0 / compliance;
    let at = |i: u8, j: u8| 4 * i + j;
    let cells = (0..3).flat_map(|i| (0..3).map(move |j| (i, j)));
    let corners = cells.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    for (triangle, corners) in patch.head.triangles.iter_mut().zip(corners) {
        *triangle = Triangle { corners, friction };
    }
    for (site, number) in patch.sites.iter_mut().zip(0_u8..) {
        let [i, j] = [number / 4, number % 4].map(|k| spacing * (f64::from(k) - 1.5));
        (site.vertex, site.place) = (number.into(), Vec3::new(i, j, 0.0));
    }
    for (row, one) in patch.compliance.iter_mut().zip(&patch.sites) {
        for (block, other) in row.iter_mut().zip(&patch.sites) {
            let distance = (one.place - other.place).norm();
            let kernel = width / (distance * distance + width * width).sqrt();
            *block = Mat3::identity() * (compliance * kernel);
        }
    }
    patch
}

/// The patch of a host in whose step these `forces` act: the body has yielded to them.
fn after(patch: &Patch, forces: &[Vec3; MAX_SITES], number: u64) -> Patch {
    let mut new = patch.clone();
    new.head.sequence = number;
    for (site, row) in new.sites.iter_mut().zip(&patch.compliance) {
        site.place += row
            .iter()
            .zip(forces)
            .map(|(block, force)| block * force)
            .sum::<Vec3>();
    }
    for (site, force) in new.sites.iter_mut().zip(forces) {
        site.force = *force;
    }
    new
}

#[test]
fn a_groove_is_never_entered() {
    for (opening, friction) in [60.0_f64, 90.0, 120.0, 150.0]
        .into_iter()
        .flat_map(|angle| [(angle, 0.0), (angle, 0.5)])
    {
        let slope = (0.5 * (180.0 - opening)).to_radians();
        let (radius, planes) = (
            5e-3,
            [-1.0, 1.0].map(|side| Vec3::new(side * slope.sin(), 0.0, slope.cos())),
        );
        let mut tool = ball(radius);
        tool.accept(&obstacle(&ridge(slope), friction)).unwrap();
        let rest = radius / slope.cos();
        for tick in 0..400 {
            // Down by 3 mm at 0.1 m/s, then along the groove and across it.
            let time = f64::from(tick) * PERIOD;
            let down = (0.1 * time).min(4e-3);
            let along = 0.1 * (time - 0.04).max(0.0);
            let across = 2e-3 * (60.0 * time).sin();
            let force = tool.push(&Vec3::new(across, along, rest + 1e-3 - down));
            for normal in planes {
                let depth = radius - normal.dot(&tool.proxy().position);
                assert!(depth < 1e-6, "{opening} {friction} {tick}: {depth:e}");
            }
            assert!(tick < 50 || force.z > 0.0);
        }
    }
}

#[test]
fn the_force_turns_over_an_edge_by_two_degrees_a_tick() {
    // An edge of 90 degrees, over which a ball of 4 mm is led at 0.1 m/s, half a millimetre deep.
    let slope = -45.0_f64.to_radians();
    let mut tool = ball(4e-3);
    tool.accept(&obstacle(&ridge(slope), 0.0)).unwrap();
    let (mut last, mut most, mut turned) = (None::<Vec3>, 0.0_f64, 0.0);
    let distance = 3.5e-3;
    for tick in 0..250 {
        let way = 0.1 * PERIOD * f64::from(tick - 125);
        // Along the flank, around the edge and down on the other side.
        let arc = distance * slope.abs();
        let hand = if way.abs() < arc {
            let angle = way / distance;
            Vec3::new(angle.sin(), 0.0, angle.cos()) * distance
        } else {
            let normal = Vec3::new(way.signum() * slope.abs().sin(), 0.0, slope.cos());
            let down = Vec3::new(way.signum() * slope.cos(), 0.0, slope.sin());
            normal * distance + down * (way.abs() - arc)
        };
        let force = tool.push(&hand);
        if let Some(last) = last {
            let angle = force.angle(&last).to_degrees();
            (most, turned) = (most.max(angle), turned + angle);
        }
        last = Some(force);
    }
    assert!((turned - 90.0).abs() < 0.5, "{turned}");
    assert!(most < 2.0, "{most}");
}

#[test]
fn the_felt_stiffness_is_the_lesser_one_of_body_and_device() {
    for stiffness in [300.0, 1500.0, 2900.0, 6000.0, f64::INFINITY] {
        let mut patch = pad(5e-3, 1.0 / stiffness, 4e-3, 0.3);
        // A ball over the centre of the pad, so large that it touches one site.
        for site in &mut patch.sites {
            site.place.z = -5.0 * (site.place - Vec3::new(2.5e-3, 2.5e-3, 0.0)).norm_squared();
        }
        let more = (1.0 / STIFFEST - 1.0 / stiffness).max(0.0);
        patch.head.floor.fill_diagonal(more);
        let mut tool = ball(0.05);
        tool.accept(&patch).unwrap();
        let depth = 0.2e-3;
        let mut force = Vec3::zeros();
        for tick in 0..100 {
            let z = 0.05 + 1e-3 - 0.1e-3 * f64::from(tick.min(12));
            force = tool.push(&Vec3::new(2.5e-3, 2.5e-3, z));
        }
        let felt = force.z / depth;
        let expected = stiffness.min(STIFFEST);
        assert!((felt / expected - 1.0).abs() < 1e-6, "{felt} {expected}");
    }
}

#[test]
fn a_message_that_tells_nothing_new_changes_nothing() {
    // The host has solved the same contact of a linear body, 4 ms before, and publishes at 60 Hz.
    for friction in [0.0, 0.4] {
        let patch = pad(4e-3, 1.0 / 800.0, 3e-3, friction);
        let (mut truth, mut tool) = (ball(8e-3), ball(8e-3));
        truth.accept(&patch).unwrap();
        tool.accept(&patch).unwrap();
        let mut sent = Vec::new();
        let (mut worst, mut peak) = (0.0_f64, 0.0_f64);
        for tick in 0..600_u32 {
            let time = f64::from(tick) * PERIOD;
            let turn = 2.0 * core::f64::consts::PI * time;
            let hand = Vec3::new(
                2e-3 * turn.sin(),
                1e-3 * (2.0 * turn).sin(),
                8e-3 - 4e-3 * (0.5 * turn).sin().abs(),
            );
            let exact = truth.push(&hand);
            sent.push(loads(truth.contacts()));
            if tick % 16 == 0 && tick > 4 {
                let mut new = after(&patch, &sent[tick as usize - 4], 2 + u64::from(tick));
                new.head.period = 0.016;
                tool.see_age(4.0 * PERIOD);
                tool.accept(&new).unwrap();
            }
            let force = tool.push(&hand);
            worst = worst.max((force - exact).norm());
            peak = peak.max(exact.norm());
        }
        // What linearizations leave that start elsewhere.
        let most = 2e-3;
        assert!(
            peak > 1.0 && worst < most * peak,
            "{friction}: {worst:e} {peak}"
        );
    }
}

#[test]
fn a_message_without_a_site_that_bears_force_keeps_the_force() {
    // The ball rubs the pad. Each message has another vertex at the place of one site: the contacts with that site go on.
    let patch = pad(4e-3, 1.0 / 800.0, 3e-3, 0.4);
    let (mut truth, mut tool) = (ball(8e-3), ball(8e-3));
    truth.accept(&patch).unwrap();
    tool.accept(&patch).unwrap();
    let mut vertices: Vec<u32> = patch.sites.iter().map(|site| site.vertex).collect();
    let mut sent = Vec::new();
    let (mut worst, mut peak, mut met) = (0.0_f64, 0.0_f64, 0);
    for tick in 0..1200_u32 {
        let time = f64::from(tick) * PERIOD;
        let turn = 2.0 * core::f64::consts::PI * time;
        let down = 4e-3 * (2.0 * time).min(1.0);
        let hand = Vec3::new(4e-3 * turn.sin(), 3e-3 * (2.0 * turn).sin(), 8e-3 - down);
        let exact = truth.push(&hand);
        sent.push(loads(truth.contacts()));
        if tick % 16 == 0 && tick > 4 {
            let mut new = after(&patch, &sent[tick as usize - 4], 2 + u64::from(tick));
            new.head.period = 0.016;
            let site = (tick / 16) as usize * 5 % MAX_SITES;
            vertices[site] += 100;
            for (site, vertex) in new.sites.iter_mut().zip(&vertices) {
                site.vertex = *vertex;
            }
            let bears = |contact: &&Contact| {
                let corners = contact.corners.iter().zip(&contact.weights);
                let mut corners = corners.filter(|(_, weight)| **weight > 0.0);
                corners.any(|(corner, _)| usize::from(*corner) == site)
            };
            met += tool.contacts().iter().filter(bears).count();
            tool.accept(&new).unwrap();
        }
        let force = tool.push(&hand);
        worst = worst.max((force - exact).norm());
        peak = peak.max(exact.norm());
    }
    // A new site has the offset of its neighbour, and the iteration of the geometry starts elsewhere.
    assert!(met > 10 && peak > 1.0, "{met} {peak}");
    assert!(worst < 0.02 * peak, "{worst:e} {peak}");
}

/// A rigid strip, first as two triangles over its whole width, and then through its middle, which lies lower.
#[test]
fn a_contact_leaves_a_triangle_that_the_surface_has_no_longer() {
    let (radius, low) = (5e-3, -2e-3);
    let [a, b, c, d] = [[-0.02, -0.02], [0.02, -0.02], [0.02, 0.02], [-0.02, 0.02]];
    let at = |[x, y]: [f64; 2], z: f64| [x, y, z];
    let middle = [0.0, 0.0, low];
    let [a, b, c, d] = [a, b, c, d].map(|corner| at(corner, 0.0));
    // The first list has the middle as a site of a triangle below the others.
    let whole = [
        [a, b, c],
        [a, c, d],
        [middle, at([0.01, 0.0], -0.01), at([0.0, 0.01], -0.01)],
    ];
    let divided = [
        [a, b, middle],
        [b, c, middle],
        [c, d, middle],
        [d, a, middle],
    ];
    let mut tool = ball(radius);
    let mut first = obstacle(&whole, 0.3);
    tool.accept(&first).unwrap();
    let hand = Vec3::new(1e-3, 0.0, radius - 1e-3);
    for above in (0..50).rev() {
        tool.push(&(hand + Vec3::z() * (f64::from(above) * 1e-4)));
    }
    assert!((tool.wrench().force.z - 1e-3 * STIFFEST).abs() < 1e-9);
    let second = obstacle(&divided, 0.3);
    // The sites keep their slots.
    let slot = |vertex: u32| {
        let place = second.sites[vertex as usize].place;
        first
            .sites
            .iter()
            .position(|site| site.place == place)
            .unwrap() as u8
    };
    let triangles = second.head.triangles().map(|triangle| Triangle {
        corners: triangle.corners.map(|corner| slot(corner.into())),
        ..*triangle
    });
    let triangles: Vec<Triangle> = triangles.collect();
    first.head.triangle_count = 4;
    first.head.triangles[..4].copy_from_slice(&triangles);
    (first.head.sequence, first.head.period) = (2, 0.016);
    tool.accept(&first).unwrap();
    for _ in 0..200 {
        tool.push(&hand);
    }
    // Over the funnel, the tool is free, once the force of the former triangles has faded.
    assert!(tool.wrench().force.norm() < 1e-9, "{}", tool.wrench().force);
}

#[test]
fn friction_holds_up_to_the_cone_and_no_further() {
    for stiffness in [1000.0, f64::INFINITY] {
        let mut patch = pad(5e-3, 1.0 / stiffness, 4e-3, 0.4);
        patch
            .head
            .floor
            .fill_diagonal((1.0 / STIFFEST - 1.0 / stiffness).max(0.0));
        let mut tool = ball(5e-3);
        tool.accept(&patch).unwrap();
        let mut last = 0.0;
        for tick in 0..300 {
            let (down, along) = (
                (f64::from(tick) * 0.05e-3).min(1e-3),
                f64::from((tick - 50).max(0)) * 2e-5,
            );
            let force = tool.push(&Vec3::new(along, 0.3e-3, 5e-3 - down));
            let across = force.xy().norm();
            let [normal, friction] = tool
                .contacts()
                .iter()
                .fold([0.0; 2], |[sum, most], contact| {
                    [sum + contact.normal_force, most + contact.friction.norm()]
                });
            assert!(
                friction <= 0.4 * normal * 1.001,
                "{stiffness} {tick}: {friction} {normal}"
            );
            // It grows while the ball sticks.
            assert!(
                !(60..65).contains(&tick) || across > last,
                "{stiffness} {tick}"
            );
            last = across;
            if tick > 250 {
                assert!(
                    friction > 0.4 * normal * 0.99,
                    "{stiffness} {tick}: {friction} {normal}"
                );
            }
            if tick > 250 && stiffness == f64::INFINITY {
                assert!(
                    (across / (0.4 * force.z) - 1.0).abs() < 5e-3,
                    "{tick}: {across}"
                );
            }
        }
    }
}

#[test]
fn a_hold_with_tremor_does_not_creep() {
    for stiffness in [1000.0, f64::INFINITY] {
        let mut patch = pad(5e-3, 1.0 / stiffness, 4e-3, 0.6);
        patch
            .head
            .floor
            .fill_diagonal((1.0 / STIFFEST - 1.0 / stiffness).max(0.0));
        let mut tool = ball(5e-3);
        tool.accept(&patch).unwrap();
        for tick in 0..=10 {
            tool.push(&Vec3::new(0.2e-3, 0.1e-3, 5e-3 - 0.1e-3 * f64::from(tick)));
        }
        // Pressed, and moved by 0.1 mm while it sticks: the force across tells how far the anchor is away.
        let mut held = |ticks: i32, tremor: f64| {
            let mut force = Vec3::zeros();
            for tick in 0..ticks {
                let time = f64::from(tick) * PERIOD;
                let at = |rate: f64| tremor * (2.0 * core::f64::consts::PI * rate * time).sin();
                let hand = Vec3::new(0.3e-3, 0.1e-3, 4e-3);
                force = tool.push(&(hand + Vec3::new(at(9.0), at(8.3), at(10.1))));
            }
            force
        };
        let before = held(100, 0.0);
        held(60_000, 20e-6);
        let crept = (held(100, 0.0) - before).xy().norm() / stiffness.min(STIFFEST);
        assert!(crept < 1e-6, "{stiffness}: {crept:e}");
    }
}

#[test]
fn the_dampers_of_the_surface_give_their_impulse() {
    // A step of the hand by `d`: the force decays to `K d`, and the impulse beyond that is `b K d`, however the stretch relaxes.
    for (stiffness, damping) in [
        (300.0, 5e-3),
        (1500.0, 2e-3),
        (1500.0, 20e-3),
        (2900.0, 5e-3),
    ] {
        let mut patch = pad(5e-3, 1.0 / stiffness, 4e-3, 0.0);
        for site in &mut patch.sites {
            site.place.z = -5.0 * (site.place - Vec3::new(2.5e-3, 2.5e-3, 0.0)).norm_squared();
        }
        patch.head.damping = damping;
        let mut tool = ball(0.05);
        tool.accept(&patch).unwrap();
        let above = Vec3::new(2.5e-3, 2.5e-3, 0.05);
        tool.push(&above);
        let (depth, mut impulse, mut last) = (0.1e-3, 0.0, 0.0);
        for tick in 0..20_000 {
            last = tool.push(&(above - Vec3::z() * depth)).z;
            assert!(
                tick > 0 || last <= STIFFEST * depth * (1.0 + 1e-9),
                "{stiffness} {damping}: {last}"
            );
            impulse += (last - stiffness * depth) * PERIOD;
        }
        assert!(
            (last / (stiffness * depth) - 1.0).abs() < 1e-9,
            "{stiffness} {damping}: {last}"
        );
        let expected = damping * stiffness * depth;
        assert!(
            (impulse / expected - 1.0).abs() < 1e-6,
            "{stiffness} {damping}: {impulse} {expected}"
        );
    }
}

#[test]
fn a_surface_that_comes_to_the_tool_parts_from_it_at_a_bounded_speed() {
    let mut tool = ball(5e-3);
    let hand = Vec3::z() * 3e-3;
    tool.push(&hand);
    tool.accept(&obstacle(&ridge(0.0), 0.0)).unwrap();
    let mut last = 0.0;
    for tick in 0..200 {
        let force = tool.push(&hand).z;
        // 0.02 m/s on 3 kN/m.
        assert!(force - last < 0.0601, "{tick}: {force} {last}");
        last = force;
    }
    assert!((last - STIFFEST * 2e-3).abs() < 1e-9, "{last}");
}

proptest! {
    #[test]
    fn no_patch_makes_a_force_that_is_no_number(
        numbers in proptest::collection::vec(-1.0..1.0_f64, 16 * 9),
        corners in proptest::collection::vec(proptest::array::uniform3(0_u8..16), MAX_TRIANGLES),
        path in proptest::collection::vec(proptest::array::uniform3(-1.0..1.0_f64), 20),
        friction in 0.0..2.0_f64,
        soft in prop_oneof![Just(0.0), Just(1e-3)],
    ) {
        let mut patch = pad(4e-3, soft, 3e-3, friction);
        patch.head.stiffness = 1000.0;
        patch.head.damping = 5e-3;
        patch.head.floor.fill_diagonal(1.0 / STIFFEST);
        patch.head.triangle_count = MAX_TRIANGLES as u8;
        for (triangle, corners) in patch.head.triangles.iter_mut().zip(corners) {
            *triangle = Triangle { corners, friction };
        }
        for (site, n) in patch.sites.iter_mut().zip(numbers.chunks(9)) {
            site.place = Vec3::new(n[0], n[1], n[2]) * 0.01;
            site.velocity = Vec3::new(n[3], n[4], n[5]);
            site.force = Vec3::new(n[6], n[7], n[8]);
        }
        let mut tool = ball(5e-3);
        for (tick, hand) in path.iter().enumerate() {
            patch.head.sequence += 1;
            if tick % 7 == 0 {
                patch.sites[tick % 16].vertex += 100;
                tool.accept(&patch).unwrap();
            }
            let force = tool.push(&(Vec3::from(*hand) * 0.01));
            prop_assert!(force.iter().all(|x| x.is_finite()), "{force}");
            for contact in tool.contacts() {
                prop_assert!(contact.normal_force >= 0.0);
            }
        }
    }
}

#[test]
fn a_patch_that_cannot_be_used_is_refused() {
    let good = pad(4e-3, 1e-3, 3e-3, 0.1);
    let mut tool = ball(5e-3);
    let mut bad = good.clone();
    bad.sites[3].place.x = f64::NAN;
    assert_eq!(tool.accept(&bad), Err(PatchFault::NotFinite));
    bad = good.clone();
    bad.compliance[1][2][(0, 1)] = f64::INFINITY;
    assert_eq!(tool.accept(&bad), Err(PatchFault::NotFinite));
    bad = good.clone();
    bad.head.triangles[0].friction = -0.1;
    assert_eq!(tool.accept(&bad), Err(PatchFault::NotFinite));
    bad = good.clone();
    bad.head.triangles[4].corners[1] = 16;
    assert_eq!(tool.accept(&bad), Err(PatchFault::Sites));
    bad = good.clone();
    bad.head.site_count = 17;
    assert_eq!(tool.accept(&bad), Err(PatchFault::Sites));
    assert_eq!(tool.accept(&good), Ok(()));
    assert_eq!(tool.accept(&good), Err(PatchFault::Outdated));
    assert_eq!(tool.refused(), 6);
}

#[test]
fn a_deep_hold_stands_still() {
    // A ball pressed in by its radius into a pad: where the nearest points alone are contacts, the force changes by half a newton
    // in each tick of the hold.
    for (spacing, width) in [(4e-3, 3e-3), (4e-3, 6e-3), (2.5e-3, 3e-3)] {
        for (place, friction) in [
            ([0.0, 0.0], 0.0),
            ([0.7e-3, 0.3e-3], 0.0),
            ([0.7e-3, 0.3e-3], 0.4),
        ] {
            let mut tool = ball(8e-3);
            tool.accept(&pad(spacing, 1.0 / 800.0, width, friction))
                .unwrap();
            let (mut last, mut before) = (Vec3::zeros(), Vec3::zeros());
            for tick in 0..200 {
                let down = f64::from(tick.min(80)) * 0.1e-3;
                let force = tool.push(&Vec3::new(place[0], place[1], 8e-3 - down));
                let bend = (force - last * 2.0 + before).norm();
                assert!(
                    !(2..80).contains(&tick) || bend < 0.03,
                    "{spacing} {width} {friction} {tick}: {bend}"
                );
                assert!(
                    tick < 120 || (force - last).norm() < 1e-3,
                    "{spacing} {width} {friction} {tick}: {:e}",
                    (force - last).norm()
                );
                (last, before) = (force, last);
            }
            assert!(last.z > 5.0 && tool.has_room());
        }
    }
}

#[test]
fn what_is_not_computed_far_from_the_surface_changes_no_force() {
    // Two more sites, far away, keep the other tool inside the box around the sites.
    let near = |number: u64, is_boxed: bool| {
        let shift = Vec3::new(0.3e-3, 0.2e-3, 0.4e-3) * (number as f64 * 1.7).sin();
        let mut patch = obstacle(&ridge(0.1), 0.3);
        let count = usize::from(patch.head.site_count);
        for (site, row) in patch
            .sites
            .iter_mut()
            .zip(&mut patch.compliance)
            .take(count)
        {
            site.place += shift;
            site.velocity = shift * 10.0;
            for block in row.iter_mut().take(count) {
                block.fill_diagonal(2e-4);
            }
        }
        (patch.head.damping, patch.head.stiffness) = (5e-3, 5e3);
        (patch.head.sequence, patch.head.period) = (number + 1, 0.016);
        if is_boxed {
            patch.head.site_count += 2;
            patch.sites[count].place = Vec3::repeat(1.0);
            patch.sites[count + 1].place = Vec3::repeat(-1.0);
        }
        patch
    };
    let mut tools = Vec::from_iter([5e-3, 5e-3].map(ball));
    let (mut most, mut shortcuts) = (0.0_f64, 0);
    for tick in 0..3000_u32 {
        let time = f64::from(tick) * PERIOD;
        let hand = Vec3::new(
            2e-3 * (9.0 * time).sin(),
            1e-3 * (7.0 * time).sin(),
            // Up to 5 cm above the surface, and 1 mm deep.
            4e-3 + 0.05 * (4.0 * time).sin().max(0.0).powi(2),
        );
        let [one, other] = [false, true].map(|is_boxed| {
            let tool = &mut tools[usize::from(is_boxed)];
            if tick % 16 == 0 {
                tool.accept(&near(u64::from(tick), is_boxed)).unwrap();
            }
            tool.push(&hand)
        });
        shortcuts += u32::from(tools[0].is_away);
        assert!(!tools[1].is_away);
        most = most.max(one.norm());
        // Rounding of places: 0.1 pm on 3 kN/m.
        assert!((one - other).norm() < 3e-10, "{tick}: {one} {other}");
    }
    assert!(most > 1.0 && shortcuts > 1000, "{most} {shortcuts}");
}

#[test]
fn an_overflow_does_not_outlive_its_patch() {
    for friction in [0.0, 0.3] {
        overflow(&pad(4e-3, 1e-3, 3e-3, friction), friction == 0.0);
    }
}

fn overflow(good: &Patch, is_smooth: bool) {
    let hand = Vec3::new(0.3e-3, 0.2e-3, 4e-3);
    let mut fresh = ball(5e-3);
    fresh.accept(good).unwrap();
    let expected = (0..1000).fold(Vec3::zeros(), |_, _| fresh.push(&hand));
    assert!(expected.z > 0.5);
    // Numbers that are finite, and whose products are not.
    let faults: [fn(&mut Patch); 4] = [
        |patch| patch.compliance[5][6].fill(1e308),
        |patch| patch.sites[5].force.z = -1e308,
        |patch| patch.sites[6].velocity.fill(1e308),
        |patch| patch.head.floor.fill(1e308),
    ];
    for (number, fault) in faults.iter().enumerate() {
        let mut tool = ball(5e-3);
        for (sequence, is_bad) in [(1, false), (2, true), (3, true), (4, false)] {
            let mut patch = good.clone();
            if is_bad {
                patch.head.damping = 1e3;
                fault(&mut patch);
            }
            patch.head.sequence = sequence;
            tool.accept(&patch).unwrap();
            for tick in 0..1000 {
                let force = tool.push(&hand);
                assert!(
                    force.iter().all(|x| x.is_finite()),
                    "{number} {tick}: {force}"
                );
            }
        }
        let force = tool.wrench().force;
        // What linearizations leave that start elsewhere; and friction, which remembers the way, from one side of its cone to the other.
        let most = if is_smooth { 2e-3 } else { 0.6 };
        assert!(
            (force - expected).norm() < most * expected.norm(),
            "{number}: {force} {expected}"
        );
        assert_eq!(tool.sequence(), 4);
    }
}

/// A message has other points than the one before it, at which the surface is lower: the force goes over to that of the new surface
/// within half a period, without a jump.
#[test]
fn a_message_of_other_points_lets_the_force_go_over() {
    let (mut kept, mut lower) = (
        pad(4e-3, 1.0 / 800.0, 3e-3, 0.0),
        pad(4e-3, 1.0 / 800.0, 3e-3, 0.0),
    );
    (kept.head.period, lower.head.period) = (0.016, 0.016);
    (lower.head.sequence, lower.head.time_ns) = (2, 1);
    for site in lower
        .sites
        .iter_mut()
        .take(usize::from(lower.head.site_count))
    {
        site.vertex += 100;
        site.place.z -= 0.5e-3;
    }
    let (mut before, mut after) = (ball(8e-3), ball(8e-3));
    before.accept(&kept).unwrap();
    lower.head.sequence = 1;
    after.accept(&lower).unwrap();
    lower.head.sequence = 2;
    let hand = |tick: usize| Vec3::z() * (8e-3 - 2e-3 * (tick as f64 / 100.0).min(1.0));
    let mut forces = Vec::new();
    for tick in 0..300 {
        if tick == 200 {
            before.accept(&lower).unwrap();
        }
        forces.push(before.push(&hand(tick)).z);
        after.push(&hand(tick));
    }
    let whole = forces[199] - after.wrench().force.z;
    assert!(whole > 0.3, "{whole}");
    for tick in 200..300 {
        let change = (forces[tick] - forces[tick - 1]).abs();
        // An eighth of the change in each tick of half a period.
        assert!(change < 0.05 + 0.2 * whole, "{tick}: {change} of {whole}");
    }
    assert!((forces[299] - after.wrench().force.z).abs() < 0.02 * after.wrench().force.z);
}
