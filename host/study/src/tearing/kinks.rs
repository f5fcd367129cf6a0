//! Section `path`: the load at which a crack at an angle to the load starts, and where it goes.
//!
//! A square sheet, held flat, has a short straight crack in its middle and is pulled by the tractions of an even stress at an
//! angle to the crack, or sheared. The largest hoop stress says at which load the crack starts and where it turns (Erdogan
//! and Sih, "On the crack extension in plates under plane loading and transverse shear", 1963):
//! `cos²(a/2) (K_I cos(a/2) - 3 K_II sin(a/2))`, the largest over all angles `a`, is then `sqrt(E G_c)`.
//!
//! The intensities of the square are those of `docs/figures/intensity.py`: six-node triangles with quarter points at the
//! tips. They agree with the handbook (H. Tada, P. C. Paris and G. R. Irwin, "The Stress Analysis of Cracks Handbook", 2000)
//! within 0.1 % for slits in long plates. The script also gives the direction of the tear behind a kink of one edge.

use super::patterns::{Pattern, Slit, Triangles};
use super::plate::{Plate, SOFT};
use crate::{Level, StudyError};
use serde::Serialize;

/// Side of the square, and length of the crack (m).
const SIDE: f64 = 0.1;
const CRACK: f64 = 0.025;
/// The intensities over `S sqrt(pi a)`, `a` half the crack: `K_I` under a stress `S` across the crack, and `K_II` under a
/// shear stress `S` (`docs/figures/intensity.py 4`). A stress along the crack gives none.
const OPENING: f64 = 1.0860;
const SLIDING: f64 = 1.0496;

/// How a sheet is loaded.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Load {
    /// Pulled, with this angle (degrees) between crack and load.
    Pull(f64),
    /// Sheared along the crack.
    Shear,
}

impl Load {
    /// A unit of the stress: along the crack, shear, across the crack.
    fn unit(self) -> [f64; 3] {
        match self {
            Self::Pull(angle) => {
                let angle = angle.to_radians();
                let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
                [cosine * cosine, sine * cosine, sine * sine]
            }
            Self::Shear => [0.0, 1.0, 0.0],
        }
    }

    /// The stress at which the crack starts (Pa), and its kink (degrees).
    fn exact(self) -> (f64, f64) {
        let [_, shear, across] = self.unit();
        let root = (0.5 * core::f64::consts::PI * CRACK).sqrt();
        let [k1, k2] = [OPENING * across * root, SLIDING * shear * root];
        let hoop = |kink: f64| {
            let half = 0.5 * kink.to_radians();
            let (sine, cosine) = (libm::sin(half), libm::cos(half));
            cosine * cosine * (k1 * cosine - 3.0 * k2 * sine)
        };
        let kinks = (0..=9000_i32).map(|part| 0.0 - 0.01 * f64::from(part));
        let kink = kinks.max_by(|a, b| hoop(*a).total_cmp(&hoop(*b)));
        let kink = kink.unwrap_or_default();
        ((SOFT.young * SOFT.toughness).sqrt() / hoop(kink), kink)
    }
}

/// The loads, and the directions of the tear behind a kink of a tenth and of a sixteenth of the crack (degrees;
/// `docs/figures/intensity.py 4 10` and `4 16`).
const LOADS: [(Load, [f64; 2]); 7] = [
    (Load::Pull(15.0), [-88.2, -87.6]),
    (Load::Pull(30.0), [-71.0, -71.2]),
    (Load::Pull(45.0), [-52.4, -53.9]),
    (Load::Pull(60.0), [-32.9, -35.2]),
    (Load::Pull(75.0), [-14.2, -16.1]),
    (Load::Pull(90.0), [0.0, 0.0]),
    (Load::Shear, [-70.5, -74.5]),
];

/// How the crack of one sheet started.
#[derive(Clone, Debug, Serialize)]
pub struct Kink {
    /// The name of the mesh.
    pub pattern: String,
    /// Number of triangles.
    pub triangles: usize,
    /// The number of edges of the crack.
    pub edges: u32,
    /// The angle between crack and load, or `shear`.
    pub load: String,
    /// The stress at the first edge, relative to that of the largest hoop stress.
    pub start: f64,
    /// The kink of the largest hoop stress, and the direction of the tear behind a kink of one edge (degrees).
    pub exact: [f64; 2],
    /// The kinks that the stress intensities at the two tips ask for (degrees).
    pub found: [f64; 2],
    /// The directions of the first edges at the two tips (degrees).
    pub first: [f64; 2],
    /// The directions of the second edges at the two tips (degrees).
    pub second: [f64; 2],
}

impl Kink {
    /// The largest errors (degrees): of the kinks by the intensities, of the first edges, and of the second edges.
    pub fn errors(&self) -> [f64; 3] {
        let [kink, behind] = self.exact;
        let all = [
            (self.found, kink),
            (self.first, kink),
            (self.second, behind),
        ];
        all.map(|(angles, exact)| {
            let [left, right] = angles.map(|angle| (angle - exact).abs());
            left.max(right)
        })
    }
}

/// The meshes, with the number of edges of the crack: patterns, and one by Gmsh (4.15.2, algorithm 6), whose edges are twice
/// as long at the border as at the crack.
fn meshes(edges: u32) -> Vec<(Triangles, u32)> {
    let patterns = Pattern::ALL.into_iter().chain([Pattern::Crossed]);
    let mut meshes: Vec<_> = patterns
        .map(|pattern| (Triangles::Pattern(pattern), edges))
        .collect();
    let frontal = match edges {
        16 => include_str!("../../meshes/frontal_plate_16.obj"),
        _ => include_str!("../../meshes/frontal_plate_10.obj"),
    };
    let frontal = Triangles::Obj("Frontal".to_owned(), frontal.to_owned());
    meshes.push((frontal, edges));
    meshes
}

/// The kinks of all loads on all meshes with cracks of 10 and 16 edges; at the quick level, of three loads on two meshes with
/// cracks of 10 edges.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level, progress: &dyn Fn(f64)) -> Result<Vec<Kink>, StudyError> {
    let (meshes, loads) = match level {
        Level::Quick => (meshes(10)[4..].to_vec(), vec![LOADS[0], LOADS[2], LOADS[6]]),
        Level::Full => ([meshes(10), meshes(16)].concat(), LOADS.to_vec()),
    };
    let mut kinks = Vec::new();
    for (triangles, edges) in &meshes {
        for &(load, behind) in &loads {
            let behind = behind[usize::from(*edges == 16)];
            kinks.push(kink(triangles, *edges, load, behind)?);
            progress(kinks.len() as f64 / (meshes.len() * loads.len()) as f64);
        }
    }
    Ok(kinks)
}

fn kink(triangles: &Triangles, edges: u32, load: Load, behind: f64) -> Result<Kink, StudyError> {
    let (stress, exact) = load.exact();
    let plate = Plate {
        size: [SIDE; 2],
        slit: Slit {
            from: [-0.5 * CRACK, 0.0],
            to: [0.5 * CRACK, 0.0],
        },
        triangles,
        spacing: CRACK / f64::from(edges),
        stress: load.unit().map(|part| part * stress),
    };
    let started = plate.start()?;
    let [left, right] = &started.tips[..] else {
        return Err(StudyError::Slit);
    };
    let of = |place: usize| [left, right].map(|(_, edges)| edges[place].to_degrees());
    Ok(Kink {
        pattern: started.mesh,
        triangles: started.triangles,
        edges,
        load: match load {
            Load::Pull(angle) => format!("{angle}°"),
            Load::Shear => "shear".to_owned(),
        },
        start: started.load,
        exact: [exact, behind],
        found: [left, right].map(|(kink, _)| kink.to_degrees()),
        first: of(0),
        second: of(1),
    })
}
