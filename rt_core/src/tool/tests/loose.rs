//! Pieces that nothing but inertia holds, and the friction of the host.

use super::*;

/// A pad on a piece of 50 g that nothing holds, as a message every sixtieth of a second has it: rigid but for its surface.
fn loose(friction: f64) -> Patch {
    let mut patch = pad(4e-3, 2e-4, 6e-3, friction);
    let inertia = 1.0 / (60.0 * 60.0 * 0.05);
    for block in patch.compliance.iter_mut().flatten() {
        *block += Mat3::identity() * inertia;
    }
    (patch.head.damping, patch.head.elastic) = (5e-3, 0.0);
    patch
}

/// The hand presses the piece and carries it sideways: both move at the same velocity, and no friction acts. A message comes every so many
/// ticks, at once or some ticks late.
#[test]
fn a_loose_piece_goes_on_with_the_hand() {
    for (every, late) in [(16, 1), (16, 4), (16, 15), (1, 0), (2, 0), (1, 4)] {
        let patch = loose(0.5);
        let mut tool = ball(8e-3);
        let way = |tick: usize| Vec3::x() * (0.1 * tick as f64 * PERIOD);
        let mut sent: Vec<[Vec3; MAX_SITES]> = Vec::new();
        let (mut told, mut pressed, mut across) = (0, 0.0_f64, 0.0_f64);
        for tick in 0..400 {
            if tick % every == 0 && tick >= late {
                told = tick - late;
                let forces = sent.get(told).or(sent.last());
                let forces = forces.copied().unwrap_or_default();
                let mut new = after(&patch, &forces, 1 + tick as u64);
                for site in &mut new.sites {
                    site.place += way(told);
                    (site.drift, site.velocity) = (Vec3::x() * 0.1, Vec3::x() * 0.1);
                }
                new.head.period = every as f64 * PERIOD;
                tool.accept(&new).unwrap();
            }
            tool.see_age((tick - told) as f64 * PERIOD);
            let down = 1e-3 * tick.min(100) as f64 / 100.0;
            let force = tool.push(&(way(tick) + Vec3::z() * (8e-3 - down)));
            sent.push(loads(&tool.contacts));
            pressed = pressed.max(force.z);
            across = across.max(force.x.hypot(force.y));
        }
        // A piece that stayed behind for a message would draw by its inertia: by 16 ms times 0.1 m/s over 6 mm/N.
        assert!(
            pressed > 0.1 && across < 1e-3,
            "{every} {late}: {across} of {pressed}"
        );
    }
}

/// Tick and host stick to other places: the host has half of the tick's friction. The tick follows on a loose piece, without a jump, and
/// presses as before. On a body that is held, the tick keeps its friction.
#[test]
fn friction_goes_over_to_that_of_the_host() {
    let patches: [fn() -> Patch; 2] = [|| loose(0.5), || pad(4e-3, 1.0 / 800.0, 3e-3, 0.5)];
    for patch in patches {
        let patch = patch();
        let mut tool = ball(8e-3);
        tool.accept(&patch).unwrap();
        let mut begun = None;
        let mut before = Vec3::zeros();
        for tick in 0..900_u32 {
            let [down, aside] = [(0, 2e-3), (100, 0.2e-3)]
                .map(|(from, way)| way * f64::from(tick.saturating_sub(from).min(100)) / 100.0);
            let hand = Vec3::new(aside, 0.0, 8e-3 - down);
            let settled = tick >= 220;
            if settled && tick % 16 == 0 {
                let forces = loads(&tool.contacts);
                // The friction of the host, by half of that with which the tick ended.
                let hosts = *begun.get_or_insert(forces.map(|force| Vec3::x() * (0.5 * force.x)));
                let each = forces.iter().zip(hosts);
                let mut hosts = [Vec3::zeros(); MAX_SITES];
                for (to, (force, friction)) in hosts.iter_mut().zip(each) {
                    *to = Vec3::new(friction.x, force.y, force.z);
                }
                let mut new = after(&patch, &hosts, 1 + u64::from(tick));
                new.head.period = 0.016;
                tool.accept(&new).unwrap();
                tool.see_age(PERIOD);
            }
            let force = tool.push(&hand);
            let jump = (force - before).norm();
            assert!(
                !settled || jump < 0.03 * force.norm(),
                "{tick}: {jump} of {force}"
            );
            if let (Some(_), 899) = (begun, tick) {
                let hosts: f64 = begun.iter().flatten().map(|force| -force.x).sum();
                let part = 1.0 + patch.head.elastic;
                assert!((force.x / hosts - part).abs() < 0.03, "{force} {hosts}");
                assert!(force.z > 2.0 * force.x.abs() && force.x < 0.0, "{force}");
            }
            before = force;
        }
    }
}
