//! The realtime step uses one linearization, so that a fast rotation stretches the elements that it turns. The guard
//! holds back the energy that this would add.

use super::specimen::{Isotropic, Kind, quiet};
use super::trial::{Method, Trial};
use super::{Job, Outcome, Plan};
use crate::{Level, StudyError};

pub(super) fn plan(level: Level) -> Plan {
    let mut jobs = Vec::new();
    for (kind, method) in Kind::all().filter(|(_, method)| method.is_linearized()) {
        for young in level.ends(&[1.0, 1e3, 1e6, 1e9]) {
            for contrast in [1.0, 1e6] {
                for poisson in level.ends(&[0.0, 0.3, 0.499]) {
                    for h in level.ends(&[1e-4, 1e-3, 1e-2, 1e-1]) {
                        for fraction in [0.01, 1.0] {
                            let name = format!(
                                "E {young:e} Pa, {contrast:e} : 1, nu {poisson}, h {h} s, kicked at {fraction} c"
                            );
                            let kick = Kick {
                                material: Isotropic::new(young, poisson),
                                contrast,
                                fraction,
                            };
                            jobs.push(Job::new(name, (kind, method), 200, move || {
                                kick.run(kind, method, h)
                            }));
                        }
                    }
                }
            }
        }
    }
    Plan {
        name: "realtime step",
        stress: "free bodies kicked at 0.01 and 1 of their speed of sound, stepped with one linearization; E 1 Pa \
                 to 1 GPa and contrasts of 1e6, nu 0 to 0.499, h 0.1 to 100 ms",
        figure: "energy gained, as a fraction of the initial energy",
        unit: "",
        jobs,
    }
}

#[derive(Clone, Copy)]
struct Kick {
    material: Isotropic,
    /// Ratio between the stiffnesses of adjacent elements.
    contrast: f64,
    /// The largest speed along an axis, as a fraction of the speed of sound in the soft elements.
    fraction: f64,
}

impl Kick {
    fn run(self, kind: Kind, method: Method, h: f64) -> Result<Outcome, StudyError> {
        let shape = kind.mesh(2)?;
        let material = |element: usize| Isotropic {
            young: if element.is_multiple_of(2) {
                self.material.young
            } else {
                self.material.young / self.contrast
            },
            ..self.material
        };
        let soft = material(1);
        let mut body = kind.build(&shape, material, quiet(), &[])?;
        body.set_velocities(&shape.kick(self.fraction * soft.sound()))?;
        let mut trial = Trial::new(body, method)?;
        let start = trial.body.total_energy();
        trial.run(h, 200, &[]);
        Ok(Outcome {
            figure: trial.energy().excess() / start,
            limit: Some(method.allowed_excess(kind)),
            reason: trial.unexpected(),
            account: trial.account,
            ..Outcome::default()
        })
    }
}
