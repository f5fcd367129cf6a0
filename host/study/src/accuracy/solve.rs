//! The operations of all benchmarks: choosing vertices, making materials, solving for equilibrium.

use crate::StudyError;
use physics::{Body, BodyConfig, Equilibrium, EquilibriumOptions, Material, SolidMaterial, Vec3};

/// No gravity, and a linear solver that converges as far as double precision permits.
pub(super) fn weightless() -> BodyConfig {
    BodyConfig {
        gravity: Vec3::zeros(),
        tolerance: 1e-12,
        absolute_tolerance: 0.0,
        max_iterations: 100_000,
        ..BodyConfig::default()
    }
}

/// The material of a sheet whose density does not matter.
pub(super) fn sheet_material(young: f64, poisson: f64, thickness: f64) -> Material {
    Material {
        young,
        poisson,
        thickness,
        density: 1.0,
    }
}

/// The material of a solid whose density does not matter.
pub(super) fn solid_material(young: f64, poisson: f64) -> SolidMaterial {
    SolidMaterial {
        young,
        poisson,
        density: 1.0,
    }
}

/// Numbers of the vertices whose positions satisfy `chosen`.
pub(super) fn vertices(positions: &[Vec3], chosen: impl Fn(&Vec3) -> bool) -> Vec<u32> {
    let numbered = (0_u32..).zip(positions);
    numbered
        .filter(|(_, x)| chosen(x))
        .map(|(vertex, _)| vertex)
        .collect()
}

/// Moves `body` to equilibrium under its loads and supports.
pub(super) fn settle(body: &mut Body) -> Result<(), StudyError> {
    let mut equilibrium = Equilibrium::new(body, EquilibriumOptions::default())?;
    equilibrium.solve(body, &[], 1.0)?;
    Ok(())
}

/// Brings a linear body to rest that is too large to factorize, in one step that is so long that inertia is negligible, by
/// conjugate gradients.
pub(super) fn settle_linear(body: &mut Body) -> Result<(), StudyError> {
    body.step(1e9, &[])?;
    Ok(())
}

/// Displacements of the vertices of `body` from `rest`.
pub(super) fn displacements(body: &Body, rest: &[Vec3]) -> Vec<Vec3> {
    body.positions()
        .zip(rest)
        .map(|(x, rest)| x - rest)
        .collect()
}

/// Displacement of the vertex nearest to `place`.
pub(super) fn displacement_at(body: &Body, rest: &[Vec3], place: Vec3) -> Vec3 {
    let pairs = body.positions().zip(rest);
    let nearest = pairs.min_by(|(_, a), (_, b)| {
        (**a - place)
            .norm_squared()
            .total_cmp(&(**b - place).norm_squared())
    });
    nearest.map_or(Vec3::zeros(), |(x, rest)| x - rest)
}
