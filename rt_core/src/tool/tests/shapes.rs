//! Tools of every shape: capsules, plates, boxes and hulls.

use super::*;
use crate::hull::MAX_CORNERS;
use nalgebra::{SMatrix, SVector};

/// A segment of this half length (m) along a direction.
fn segment(along: Vec3) -> Hull {
    Hull::new(&[along, -along]).expect("two points")
}

/// A rectangle across z of these half sides (m).
pub(super) fn plate(x: f64, y: f64) -> Hull {
    let corners = [[x, y], [-x, y], [-x, -y], [x, -y]].map(|[x, y]| Vec3::new(x, y, 0.0));
    Hull::new(&corners).expect("four points")
}

/// The corners of a box of these half sides (m), turned so that one corner points down.
fn dice(half: f64) -> Hull {
    let turn = nalgebra::Rotation3::rotation_between(&Vec3::new(-1.0, -1.0, -1.0), &-Vec3::z());
    let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|corner: u8| {
        let sign = |bit: u8| half * (2.0 * f64::from(corner >> bit & 1) - 1.0);
        turn.expect("no half turn") * Vec3::new(sign(0), sign(1), sign(2))
    });
    Hull::new(&corners).expect("eight points")
}

/// Points around the z axis.
fn drum(radius: f64, half: f64) -> Hull {
    let corners = (0..MAX_CORNERS).map(|number| {
        let angle = 0.3 + core::f64::consts::TAU * (number / 2) as f64 / (MAX_CORNERS / 2) as f64;
        let z = if number % 2 == 0 { half } else { -half };
        Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
    });
    Hull::new(&corners.collect::<Vec<_>>()).expect("few points")
}

/// Every shape, with its radius (m).
fn shapes() -> [(Hull, f64); 6] {
    [
        (Hull::POINT, 5e-3),
        (segment(Vec3::new(0.01, 0.004, 0.0)), 4e-3),
        (segment(Vec3::new(0.004, 0.0, 0.008)), 4e-3),
        (plate(0.008, 0.012), 1.5e-3),
        (dice(6e-3), 1e-3),
        (drum(8e-3, 5e-3), 2e-3),
    ]
}

/// A floor of two triangles, whose diagonal lies under the tool.
pub(super) fn floor() -> [[[f64; 3]; 3]; 2] {
    let [a, b, c, d] = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]];
    let at = |[x, y]: [f64; 2]| [x, y, 0.0];
    [[at(a), at(b), at(c)], [at(a), at(c), at(d)]]
}

#[test]
fn each_shape_stands_on_a_floor_with_its_lowest_point() {
    for (hull, radius) in shapes() {
        let height = radius - hull.lowest(&Vec3::z()).z;
        let mut tool = rounded(&hull, radius);
        tool.accept(&obstacle(&floor(), 0.3)).unwrap();
        let (mut force, mut last) = (Vec3::zeros(), Vec3::zeros());
        for tick in 0..200 {
            // 1.5 mm down, then sideways within the cone of friction.
            let down = (0.1e-3 * f64::from(tick)).min(2.5e-3);
            let aside = (2e-6 * f64::from(tick - 50)).clamp(0.0, 0.2e-3);
            last = force;
            force = tool.push(&Vec3::new(aside, 0.0, height + 1e-3 - down));
            assert!(tool.proxy().position.z > height - 1e-9, "{hull:?} {tick}");
        }
        let expected = Vec3::new(-0.2e-3, 0.0, 1.5e-3) * STIFFEST;
        assert!(
            (force - expected).norm() < 1e-3 * expected.norm(),
            "{force}"
        );
        // Sweeps of friction end at a thousandth.
        assert!((force - last).norm() < 1e-3, "{force} {last}");
        assert!(tool.has_room());
    }
}

#[test]
fn no_shape_enters_a_groove() {
    for (hull, radius) in shapes() {
        for opening in [60.0_f64, 90.0, 150.0] {
            let slope = (0.5 * (180.0 - opening)).to_radians();
            let planes = [-1.0, 1.0].map(|side| Vec3::new(side * slope.sin(), 0.0, slope.cos()));
            let depth = |centre: &Vec3| {
                let each = planes.map(|n| radius - n.dot(&(centre + hull.lowest(&n))));
                each.into_iter().fold(f64::NEG_INFINITY, f64::max)
            };
            let mut tool = rounded(&hull, radius);
            tool.accept(&obstacle(&ridge(slope), 0.3)).unwrap();
            // The place on the axis of the groove at which the tool meets it.
            let rest = depth(&Vec3::zeros()) / slope.cos();
            for tick in 0..400 {
                let time = f64::from(tick) * PERIOD;
                let down = (0.1 * time).min(4e-3);
                let (across, along) = (2e-3 * (60.0 * time).sin(), 0.1 * (time - 0.04).max(0.0));
                let hand = Vec3::new(across, along, rest + 1e-3 - down);
                let force = tool.push(&hand);
                assert!(
                    depth(&tool.proxy().position) < 1e-6,
                    "{hull:?} {opening} {tick}"
                );
                let [meets, is_free] = [depth(&hand) > 1e-6, depth(&hand) < 0.0];
                assert!(force.z > 0.0 || !meets, "{hull:?} {opening} {tick}");
                assert!(force.z == 0.0 || !is_free, "{hull:?} {opening} {tick}");
            }
        }
    }
}

/// A flat plate that covers all sites of a surface that yields presses them down by one depth: the force is that of the stiffness
/// of all sites together.
#[test]
fn a_flat_plate_has_the_force_of_a_rigid_punch() {
    let patch = pad(4e-3, 1.0 / 800.0, 3e-3, 0.3);
    let entry = |i: usize, j: usize| patch.compliance[i][j][(2, 2)];
    let compliance = SMatrix::<f64, MAX_SITES, MAX_SITES>::from_fn(entry);
    let inverse = compliance.cholesky().expect("positive definite");
    let stiffness = inverse.solve(&SVector::repeat(1.0)).sum();
    for (hull, radius) in [(plate(0.01, 0.01), 1e-3), (drum(0.02, 5e-3), 2e-3)] {
        let height = radius - hull.lowest(&Vec3::z()).z;
        let mut tool = rounded(&hull, radius);
        tool.accept(&patch).unwrap();
        let mut force = Vec3::zeros();
        let depth = 1.2e-3;
        for tick in 0..300 {
            let down = (0.02e-3 * f64::from(tick)).min(depth);
            force = tool.push(&Vec3::new(0.3e-3, -0.2e-3, height - down));
        }
        let error = force.z / (stiffness * depth) - 1.0;
        assert!(error.abs() < 1e-3, "{error}");
        assert!(force.xy().norm() < 1e-2 * force.z, "{force}");
    }
}

/// Points that coincide are a sphere.
#[test]
fn a_hull_of_equal_points_is_a_ball() {
    let patch = pad(4e-3, 1.0 / 800.0, 3e-3, 0.3);
    let (mut one, mut many) = (ball(8e-3), rounded(&drum(0.0, 0.0), 8e-3));
    one.accept(&patch).unwrap();
    many.accept(&patch).unwrap();
    for tick in 0..600 {
        let turn = core::f64::consts::TAU * f64::from(tick) * PERIOD;
        let down = 4e-3 * (0.5 * turn).sin().abs();
        let hand = Vec3::new(2e-3 * turn.sin(), 1e-3 * (2.0 * turn).sin(), 8e-3 - down);
        let [one, many] = [&mut one, &mut many].map(|tool| tool.push(&hand));
        assert!((one - many).norm() < 1e-6, "{tick}: {one} {many}");
    }
}

/// A tool that is pushed through the floor by a stale host is not lost: its corner is pressed back along the floor's normal.
#[test]
fn a_tool_whose_hull_has_passed_the_surface_parts_at_a_bounded_speed() {
    for (hull, radius) in shapes() {
        let height = radius - hull.lowest(&Vec3::z()).z;
        let hand = Vec3::z() * (height - 1.5 * radius);
        let mut tool = rounded(&hull, radius);
        tool.push(&hand);
        tool.accept(&obstacle(&floor(), 0.0)).unwrap();
        let mut last = hand.z;
        for tick in 0..5000 {
            tool.push(&hand);
            let way = tool.proxy().position.z - last;
            last = tool.proxy().position.z;
            // Contacts at an angle, each of which parts by 20 um along its normal, move the tool further. An overlap of 0.1 um
            // counts as none.
            assert!(way > -1e-7 && way < 4e-5, "{hull:?} {tick} {way:e}");
        }
        let apart = tool.proxy().position - Vec3::z() * height;
        // A foot that stays on the material may lie aside by as much as costs 0.1 um of distance, and tilts the force a little.
        assert!(
            apart.norm() < 2e-5 && apart.z.abs() < 1e-6,
            "{hull:?} {apart}"
        );
    }
}

/// The upper side and the sides of a box of 0.1 m, whose sides lean outwards by this way (m).
fn leaning_box(out: f64, friction: f64) -> Patch {
    let at =
        |[x, y]: [f64; 2], z: f64| [(0.05 - out * z) * x, (0.05 - out * z) * y, 0.05 * (z - 1.0)];
    let [a, b, c, d] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mut triangles = Vec::new();
    for [one, other] in [[a, b], [b, c], [c, d], [d, a]] {
        let [p, q, r, s] = [at(one, 1.0), at(one, 0.0), at(other, 0.0), at(other, 1.0)];
        triangles.extend([[p, q, r], [p, r, s]]);
    }
    triangles.extend([[a, b, c], [a, c, d]].map(|corners| corners.map(|corner| at(corner, 1.0))));
    obstacle(&triangles, friction)
}

/// A plate lies over all edges of a box. The planes of the sides pass through the plate, on one or the other side of its nearest
/// points: no contact turns to the normal of a side.
#[test]
fn a_plate_that_overhangs_a_box_is_pushed_upwards() {
    for friction in [0.0, 0.3] {
        let mut tool = rounded(&plate(0.1, 0.09), 4e-3);
        for tick in 0..1000 {
            if tick % 16 == 0 {
                // Half a micrometre over the height of the side.
                let out = [0.5e-6, -0.5e-6][tick / 16 % 2];
                let mut patch = leaning_box(out, friction);
                (patch.head.sequence, patch.head.period) = (tick as u64 / 16 + 1, 0.016);
                tool.accept(&patch).unwrap();
            }
            let time = tick as f64 * PERIOD;
            let down = (0.02 * time).min(2e-3);
            let hand = Vec3::z() * (5e-3 - down);
            let force = tool.push(&hand);
            let expected = (4e-3 - hand.z).max(0.0) * STIFFEST;
            // Friction holds the edges, which move by a micrometre.
            let error = force - Vec3::z() * expected;
            assert!(error.norm() < 1e-2, "{tick} {force} {expected}");
        }
    }
}
