//! The sheet of the steps, and the hands that stretch it.

use physics::mesh::TriMesh;
use physics::mesh::generate::{Pattern, sheet};
use physics::{Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Material, Vec3};
use sim::Tremor;
use std::sync::LazyLock;

/// Without and with the bending stiffness of a plate. Without it, the matrix has fewer blocks.
pub(crate) const BENDING: [f64; 2] = [0.0, 1.0];
/// Step lengths (s).
pub(crate) const STEPS: [f64; 2] = [0.01, 0.001];
/// Cells along the sheet and across it; two triangles each.
pub(crate) const CELLS: [u32; 2] = [27, 26];
/// Side of a cell (m).
const CELL: f64 = 0.01;
/// Displacement of each hand (m), and pulls a second (Hz).
pub(crate) const PULL: f64 = 0.004;
pub(crate) const PULLS_PER_SECOND: f64 = 0.25;
/// Root mean square of each hand's tremor (m), along all axes.
pub(crate) const TREMOR: f64 = 1e-4;
/// Start of the measured steps (s), in the middle of a pull, where the hands are fastest.
pub(crate) const BEGIN: f64 = 1.0;

pub(crate) const MATERIAL: Material = Material {
    young: 1e6,
    poisson: 0.3,
    thickness: 1e-3,
    density: 1000.0,
};
/// Rayleigh damping: by mass (1/s), by stiffness (s).
pub(crate) const DAMPING: [f64; 2] = [0.1, 0.1];

/// The two hands: one on the left edge, one on the right.
pub(crate) struct Hands {
    origins: [Vec3; 2],
    tremors: [Tremor; 2],
}

impl Hands {
    /// Poses of the hands at a time (s).
    pub(crate) fn at(&self, time: f64) -> [HandlePose; 2] {
        let phase = std::f64::consts::TAU * PULLS_PER_SECOND * time;
        let pull = Vec3::x() * (0.5 * PULL * (1.0 - phase.cos()));
        let moved = |hand: usize, side: f64| {
            let tremor = self.tremors[hand].at(time).0;
            HandlePose::at(self.origins[hand] + pull * side + tremor)
        };
        [moved(0, -1.0), moved(1, 1.0)]
    }
}

fn handle(mesh: &TriMesh, group: &str) -> HandleSpec {
    let vertices = mesh.group(group).map_or(Vec::new(), |g| g.members.clone());
    let sum: Vec3 = vertices.iter().map(|&v| mesh.positions[v as usize]).sum();
    HandleSpec {
        origin: sum / vertices.len() as f64,
        vertices,
        freedom: Freedom::Translation,
        border: Border::Hinged,
    }
}

/// A sheet at [`BEGIN`], and its hands.
pub(crate) struct Case {
    bending: f64,
    dt: f64,
    pub(crate) sheet: Body,
    pub(crate) hands: Hands,
}

static CASES: LazyLock<Vec<Case>> = LazyLock::new(|| {
    let all = BENDING.into_iter().flat_map(|b| STEPS.map(|dt| (b, dt)));
    all.map(|(bending, dt)| stretched(bending, dt)).collect()
});

/// The case with this entry of [`BENDING`] and this entry of [`STEPS`].
pub(crate) fn case(bending: f64, dt: f64) -> &'static Case {
    let found = CASES.iter().find(|c| c.bending == bending && c.dt == dt);
    found.expect("one of the cases")
}

/// Stretches a sheet, with steps of `dt` (s) at the end.
fn stretched(bending: f64, dt: f64) -> Case {
    const SETTLING_STEPS: usize = 20;
    const FIRST: f64 = 0.02;
    let [length, width] = CELLS.map(|cells| CELL * f64::from(cells));
    let mesh = sheet(length, width, CELLS[0], CELLS[1], Pattern::Alternating)
        .expect("the sheet can be made");
    let handles = [handle(&mesh, "left"), handle(&mesh, "right")];
    let hands = Hands {
        origins: [handles[0].origin, handles[1].origin],
        tremors: [1, 2].map(|seed| Tremor::new(TREMOR, seed).expect("a tremor")),
    };
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        mass_damping: DAMPING[0],
        stiffness_damping: DAMPING[1],
        bending,
        ..BodyConfig::default()
    };
    let mut sheet = Body::sheet(&mesh, &[MATERIAL], config, &handles).expect("it can be simulated");
    // Long steps almost to the start of the measurement, then steps of the measured length.
    let coarse = ((BEGIN - SETTLING_STEPS as f64 * dt) / FIRST).round() as usize;
    for k in 1..=coarse {
        sheet
            .step(FIRST, &hands.at(FIRST * k as f64))
            .expect("it steps");
    }
    for k in (0..SETTLING_STEPS).rev() {
        sheet
            .step(dt, &hands.at(BEGIN - dt * k as f64))
            .expect("it steps");
    }
    Case {
        bending,
        dt,
        sheet,
        hands,
    }
}
