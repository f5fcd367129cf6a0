//! Stiff elements beside soft ones and heavy elements beside light ones, with ratios of a million.

use super::materials::EXCESS;
use super::specimen::{Isotropic, Kind, quiet};
use super::trial::Trial;
use super::{Job, Outcome, Plan};
use crate::Level;

/// Newton's method leaves 1e-9 of the forces of cells that are a million times stiffer: ten times the rounding of the
/// other families.
const ROUNDING: f64 = 1e-5;

pub(super) fn plan(level: Level) -> Plan {
    let mut jobs = Vec::new();
    let ratios = [("E", 1e6, 1.0), ("density", 1.0, 1e6), ("both", 1e6, 1e6)];
    for (kind, method) in Kind::solved() {
        for (quantity, stiffness, mass) in ratios {
            for h in level.choose(vec![1e-3], vec![1e-4, 1e-3, 1e-2, 1e-1]) {
                let steps = level.choose(5, 30);
                let name = format!("{quantity} 1e6 : 1, h {h} s");
                jobs.push(Job::new(name, (kind, method), 3 * steps, move || {
                    let shape = kind.mesh(3)?;
                    // Every other element is stiff, every third heavy.
                    let material = |element: usize| Isotropic {
                        young: if element.is_multiple_of(2) {
                            1e3
                        } else {
                            1e3 * stiffness
                        },
                        poisson: 0.3,
                        density: if element.is_multiple_of(3) {
                            1e-2 * mass
                        } else {
                            1e-2
                        },
                    };
                    let mut body = kind.build(&shape, material, quiet(), &[])?;
                    // Strains of a hundredth in the soft and heavy elements.
                    let speed = 0.01 * (1e3 / (1e-2 * mass)).sqrt();
                    body.set_velocities(&shape.kick(speed))?;
                    let mut trial = Trial::new(body, method)?;
                    Ok(Outcome::of_energy_to(
                        ROUNDING,
                        &mut trial,
                        kind,
                        method,
                        |trial| {
                            trial.run(h, steps, &[]);
                        },
                    ))
                }));
            }
        }
    }
    Plan {
        name: "contrasts",
        stress: "E and mass differ by 1e6 from element to element; free bodies kicked at 0.01 of their least speed of sound",
        figure: EXCESS,
        unit: "",
        jobs,
    }
}
