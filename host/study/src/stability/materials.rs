//! Free bodies that are kicked: any stiffness, any compressibility, any step; lightly, hard, and for a long time.

use super::specimen::{Isotropic, Kind, quiet};
use super::trial::{Method, ROUNDING, Trial};
use super::{Job, Outcome, Plan};
use crate::{Level, StudyError};

pub(super) const EXCESS: &str = "energy gained, as a fraction of the initial energy";

/// A kick of a hundredth of the speed of sound: strains of a few hundredths.
pub(super) fn light(level: Level) -> Plan {
    let mut jobs = Vec::new();
    for (kind, method) in Kind::solved() {
        for young in level.ends(&[1.0, 1e3, 1e6, 1e9]) {
            for poisson in level.ends(&[0.0, 0.3, 0.45, 0.499]) {
                for h in level.ends(&[1e-4, 1e-3, 1e-2, 1e-1]) {
                    let kick = Kick {
                        material: Isotropic::new(young, poisson),
                        fraction: 0.01,
                        h,
                    };
                    let steps = level.choose(5, 20);
                    jobs.push(kick.job(kind, method, steps));
                }
            }
        }
    }
    Plan {
        name: "materials and steps",
        stress: "free bodies kicked at 0.01 of their speed of sound; E 1 Pa to 1 GPa, nu 0 to 0.499, \
                 h 0.1 to 100 ms",
        figure: EXCESS,
        unit: "",
        jobs,
    }
}

/// A kick at the speed of sound: cells are crushed and inverted.
pub(super) fn hard(level: Level) -> Plan {
    let mut jobs = Vec::new();
    for (kind, method) in Kind::solved() {
        for poisson in level.ends(&[0.3, 0.45, 0.499]) {
            for h in level.ends(&[1e-4, 1e-3, 1e-2, 1e-1]) {
                let kick = Kick {
                    material: Isotropic::new(1e5, poisson),
                    fraction: 1.0,
                    h,
                };
                jobs.push(kick.job(kind, method, level.choose(20, 100)));
            }
        }
    }
    Plan {
        name: "hard kicks",
        stress: "free bodies kicked at their speed of sound; nu 0.3 to 0.499, h 0.1 to 100 ms",
        figure: EXCESS,
        unit: "",
        jobs,
    }
}

/// Thousands of steps without damping of the body.
pub(super) fn long(level: Level) -> Plan {
    let mut jobs = Vec::new();
    for (kind, method) in Kind::solved() {
        for h in level.ends(&[1e-4, 1e-3, 1e-2]) {
            let kick = Kick {
                material: Isotropic::new(1e5, 0.3),
                fraction: 0.05,
                h,
            };
            jobs.push(kick.job(kind, method, level.choose(20, 3000)));
        }
    }
    Plan {
        name: "long vibration",
        stress: "free bodies kicked at 0.05 of their speed of sound, undamped, for 3000 steps",
        figure: EXCESS,
        unit: "",
        jobs,
    }
}

/// A free body of one material that starts at random velocities.
#[derive(Clone, Copy)]
struct Kick {
    material: Isotropic,
    /// The largest speed along an axis, as a fraction of the speed of sound.
    fraction: f64,
    h: f64,
}

impl Kick {
    fn name(self) -> String {
        let Isotropic { young, poisson, .. } = self.material;
        format!("E {young:e} Pa, nu {poisson}, h {} s", self.h)
    }

    fn job(self, kind: Kind, method: Method, steps: usize) -> Job {
        Job::new(self.name(), (kind, method), steps, move || {
            let mut trial = self.trial(kind, method)?;
            Ok(Outcome::of_energy(&mut trial, kind, method, |trial| {
                trial.run(self.h, steps, &[]);
            }))
        })
    }

    fn trial(self, kind: Kind, method: Method) -> Result<Trial, StudyError> {
        let shape = kind.mesh(2)?;
        let mut body = kind.build(&shape, |_| self.material, quiet(), &[])?;
        body.set_velocities(&shape.kick(self.fraction * self.material.sound()))?;
        Trial::new(body, method)
    }
}

impl Outcome {
    /// The energy of a free undamped body over `run`.
    pub(super) fn of_energy(
        trial: &mut Trial,
        kind: Kind,
        method: Method,
        run: impl FnOnce(&mut Trial),
    ) -> Self {
        Self::of_energy_to(ROUNDING, trial, kind, method, run)
    }

    /// Does what `of_energy` does, but the energy may rise by the fraction `rounding` of the initial energy.
    pub(super) fn of_energy_to(
        rounding: f64,
        trial: &mut Trial,
        kind: Kind,
        method: Method,
        run: impl FnOnce(&mut Trial),
    ) -> Self {
        let start = trial.body.total_energy();
        run(trial);
        let energy = trial.energy();
        let regained = energy.rise() / start;
        let reason = (method.never_gains(kind) && regained > rounding).then(|| {
            format!("the energy falls, and rises again by {regained:.3e} of its initial value")
        });
        Self {
            figure: energy.excess() / start,
            limit: Some(method.allowed_excess(kind)),
            reason: trial.unexpected().or(reason),
            account: std::mem::take(&mut trial.account),
            ..Self::default()
        }
    }
}
