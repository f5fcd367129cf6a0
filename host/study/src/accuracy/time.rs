//! Orders of the time schemes. A cube that is held by one face is struck and swings for a tenth of a second. The error
//! is that of its vertices, against the second-order scheme with very short steps.

use super::Series;
use super::solve::{vertices, weightless};
use crate::{Level, StudyError};
use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Integrator, IntegratorOptions, NewtonOptions, SolidLaw, SolidMaterial,
    TimeScheme, Vec3,
};

const DURATION: f64 = 0.1;
const RUBBER: SolidMaterial = SolidMaterial {
    young: 1e4,
    poisson: 0.3,
    density: 1000.0,
};

pub(super) fn run(level: Level) -> Result<Vec<Series>, StudyError> {
    let fine = match level {
        Level::Quick => 800,
        Level::Full => 6400,
    };
    let exact = swing(TimeScheme::TrBdf2, fine)?;
    let mut all = Vec::new();
    for (name, title, scheme, steps) in [
        (
            "time_implicit_euler",
            "swinging cube, implicit Euler: error of its vertices (m)",
            TimeScheme::ImplicitEuler,
            &[50, 100, 200, 400, 800],
        ),
        (
            "time_tr_bdf2",
            "swinging cube, TR-BDF2: error of its vertices (m)",
            TimeScheme::TrBdf2,
            &[25, 50, 100, 200, 400],
        ),
    ] {
        let source = "TR-BDF2 with far shorter steps";
        let mut series = Series::new(name, title, "m", None, source);
        for &steps in level.take(steps, 3) {
            let found = swing(scheme, steps)?;
            let squares: f64 = found
                .iter()
                .zip(&exact)
                .map(|(a, b)| (a - b).norm_squared())
                .sum();
            let error = libm::sqrt(squares / exact.len() as f64);
            series.push(
                format!("{steps} steps"),
                1.0 / f64::from(steps),
                error,
                None,
            );
        }
        all.push(series);
    }
    Ok(all)
}

/// The positions of the vertices after the swing, in `steps` steps.
fn swing(scheme: TimeScheme, steps: u32) -> Result<Vec<Vec3>, StudyError> {
    let mesh = solid_box([1.0; 3], [1; 3])?.quadratic();
    let config = BodyConfig {
        mass_damping: 0.5,
        stiffness_damping: 0.005,
        ..weightless()
    };
    let mut body = Body::solid(&mesh, &[RUBBER], SolidLaw::StableNeoHookean, config, &[])?;
    body.add_support(&vertices(&mesh.positions, |x| x.z < 1e-9 - 0.5), [true; 3])?;
    let struck = |x: &Vec3| Vec3::new(x.z, -0.5 * x.z, 0.3 * x.z * x.x);
    let lifted = mesh.positions.iter().map(|x| x.add_scalar(0.5));
    let velocities: Vec<Vec3> = lifted.map(|x| struck(&x)).collect();
    body.set_velocities(&velocities)?;
    let options = IntegratorOptions {
        scheme,
        newton: NewtonOptions {
            tolerance: 1e-12,
            max_iterations: 50,
        },
        max_halvings: 0,
        refuse_inversion: false,
    };
    let mut integrator = Integrator::new(&body, options)?;
    for _ in 0..steps {
        integrator.step(&mut body, DURATION / f64::from(steps), &[])?;
    }
    Ok(body.positions().collect())
}
