//! How far the host tells the tick the surface near a tool, and warnings about hands that move a tool farther.

use super::hand::aims;
use super::shapes::round;
use crate::scene::LoadedScene;
use crate::scene::plausible::Warning;
use crate::scene::spec::Host;
use physics::contact::rounded::Rounded;
use std::sync::Arc;

/// The ways of the tool until the next patch, by which the surface is published beyond its radius.
pub(crate) const WAYS: f64 = 2.0;
/// The least of this reach, as a fraction of the radius.
const LEAST: f64 = 0.5;
/// The speed (m/s) for which a tool at rest is told of the surface near it.
const LEAST_SPEED: f64 = 0.5;
/// The places of a path that are looked at, from one patch to the next.
const PLACES: usize = 32;
/// The most places of a path, and the time after which none is looked at (s): tasks repeat.
const MOST_PLACES: usize = 100_000;
const LONGEST: f64 = 60.0;

/// The largest age at which a patch must be good (s).
pub(crate) fn horizon(host: &Host) -> f64 {
    1.0 / host.publish_rate + host.latency
}

/// The distance (m) beyond a tool of this radius (m) and this speed (m/s) up to which a patch has the surface, if the patch must be good for
/// `horizon` (s).
pub(crate) fn reach(horizon: f64, radius: f64, speed: f64) -> f64 {
    (WAYS * speed.max(LEAST_SPEED) * horizon).max(LEAST * radius)
}

/// Where a tool is farthest beyond its patch.
struct Farthest {
    /// When the patch is made (s).
    time: f64,
    /// The speed of the tool then, and the largest speed until the next patch (m/s).
    speeds: [f64; 2],
    /// The way of the tool until the next patch, and the distance up to which the patch has the surface (m).
    way: f64,
    reach: f64,
}

/// Warnings about hands that move a tool beyond the surface that a patch has, before the next patch is there. The hands are taken to be where
/// they aim. The shapes are those of the tools, in the order of the scene.
pub(super) fn warnings<'a>(
    loaded: &LoadedScene,
    shapes: impl Iterator<Item = &'a Arc<Rounded>>,
) -> Vec<Warning> {
    let scene = &loaded.scene;
    let horizon = horizon(&scene.host);
    let tools = scene.numbered_tools().zip(shapes);
    let warnings = tools.filter_map(|((tool, device, _), shape)| {
        let far = farthest(loaded, device, shape, horizon)?;
        let [speed, most] = far.speeds;
        Some(Warning {
            location: loaded.source.location(&format!("device[{device}].hand")),
            found: format!(
                "a hand that moves the tool {:?} by {} mm until the next patch of the surface near it: at {:.2} s from {} m/s up to \
                 {} m/s",
                tool.name,
                round(1e3 * far.way),
                far.time,
                round(speed),
                round(most)
            ),
            usual: format!(
                "up to {} mm, as far as the patch has the surface",
                round(1e3 * far.reach)
            ),
            advice: "raise `host.publish_rate`, lower `host.latency`, or slow the hand: the tool meets nothing beyond its patch"
                .to_owned(),
        })
    });
    warnings.collect()
}

/// Where the hand of a device leads its tool farthest beyond its patch; `None` if it never does.
fn farthest(
    loaded: &LoadedScene,
    device: usize,
    shape: &Rounded,
    horizon: f64,
) -> Option<Farthest> {
    let scene = &loaded.scene;
    // A hand that no run can have is refused there.
    let [path, turns] = aims(loaded, device, scene.seed).ok()??;
    let scale = scene.devices[device].motion_scale;
    let lever = match loaded.models[device].rotation {
        Some(_) => shape.hull().extent(),
        None => 0.0,
    };
    let duration = scene.duration.min(LONGEST);
    let step = (horizon / PLACES as f64).max(duration / MOST_PLACES as f64);
    let places = (0..(duration / step).ceil() as usize + PLACES).map(|place| {
        let time = place as f64 * step;
        (path.at(time), turns.at(time))
    });
    let places: Vec<_> = places.collect();
    let mut farthest: Option<Farthest> = None;
    for (number, until) in places.windows(PLACES + 1).enumerate() {
        let ((from, _), (from_turn, _)) = until[0];
        let speeds = || {
            let each = until.iter();
            each.map(|((_, way), (_, turn))| scale * way.norm() + lever * turn.norm())
        };
        let speed = speeds().next()?;
        let ways = until.iter().map(|((to, _), (turn, _))| {
            scale * (to - from).norm() + lever * (turn - from_turn).norm()
        });
        let far = Farthest {
            time: number as f64 * step,
            speeds: [speed, speeds().fold(0.0, f64::max)],
            way: ways.fold(0.0, f64::max),
            reach: reach(horizon, shape.radius(), speed),
        };
        let most = farthest.as_ref().map_or(1.0, |most| most.way / most.reach);
        if far.way > most * far.reach {
            farthest = Some(far);
        }
    }
    farthest
}
