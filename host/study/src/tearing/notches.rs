//! Section `notches`: the load at which a tear starts from notches and slits of few edges.
//!
//! A plate of 40 x 80 edges is pulled by even tractions across a notch in its border, or across a slit in its middle. The
//! exact load is that of the handbook (H. Tada, P. C. Paris and G. R. Irwin, "The Stress Analysis of Cracks Handbook", 2000):
//! single edge notch, and centre crack. Finite elements of six nodes in such plates agree with both formulas within 0.7 % and
//! 0.1 %.

use super::patterns::{Pattern, Slit, Triangles};
use super::plate::{Plate, SOFT};
use crate::{Level, StudyError};
use core::f64::consts::PI;
use serde::Serialize;

/// The length of an edge (m), and the width of the plate in edges. It is twice as high as wide.
const EDGE: f64 = 1e-3;
const ACROSS: f64 = 40.0;
/// The lengths in edges.
const LENGTHS: [u32; 8] = [1, 8, 2, 3, 4, 6, 12, 16];

/// Where a tear starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// A notch in the border.
    Edge,
    /// A slit in the middle, with two tips.
    Centre,
}

/// The start at one notch or slit.
#[derive(Clone, Debug, Serialize)]
pub struct Notch {
    /// The name of the mesh.
    pub mesh: String,
    /// `notch` at the border, or `slit` in the middle.
    pub kind: &'static str,
    /// The length in edges of the mesh.
    pub edges: u32,
    /// The stress at the first edge, relative to that of the handbook.
    pub start: f64,
}

impl Notch {
    /// The relative error of the load.
    pub fn error(&self) -> f64 {
        self.start - 1.0
    }
}

impl Kind {
    /// The stress at which a tear of `edges` edges starts (Pa).
    fn exact(self, edges: f64) -> f64 {
        let part = edges / ACROSS;
        let quarter = 0.5 * PI * part;
        let (sine, cosine) = (libm::sin(quarter), libm::cos(quarter));
        let (length, factor) = match self {
            Self::Edge => {
                let shape = 0.752 + 2.02 * part + 0.37 * (1.0 - sine).powi(3);
                let root = (libm::tan(quarter) / quarter).sqrt();
                (edges * EDGE, root * shape / cosine)
            }
            Self::Centre => {
                let shape = 1.0 - 0.025 * part.powi(2) + 0.06 * part.powi(4);
                (0.5 * edges * EDGE, shape / cosine.sqrt())
            }
        };
        (SOFT.young * SOFT.toughness / (PI * length)).sqrt() / factor
    }

    /// The notch or slit of this length in edges. A slit has vertices of the mesh at its ends.
    fn slit(self, edges: f64) -> Slit {
        let (half, length) = (0.5 * ACROSS * EDGE, edges * EDGE);
        let from = match self {
            Self::Edge => -half,
            Self::Centre => -EDGE * (0.5 * edges).floor(),
        };
        Slit {
            from: [from, 0.0],
            to: [from + length, 0.0],
        }
    }
}

/// The starts at notches and slits of all lengths on three patterns; at the quick level, of two lengths on one. Slits have
/// two edges at least: a slit of one edge has no vertex that could open.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level, progress: &dyn Fn(f64)) -> Result<Vec<Notch>, StudyError> {
    let patterns = [
        Pattern::Crossed,
        Pattern::Scattered(1),
        Pattern::Turned(0.0),
    ];
    let patterns = level.take(&patterns, 1);
    let mut lengths = level.take(&LENGTHS, 2).to_vec();
    lengths.sort_unstable();
    let whole = (patterns.len() * lengths.len()) as f64;
    let (mut notches, mut done) = (Vec::new(), 0.0);
    for &pattern in patterns {
        for &edges in &lengths {
            for (kind, name) in [(Kind::Edge, "notch"), (Kind::Centre, "slit")] {
                if kind == Kind::Centre && edges < 2 {
                    continue;
                }
                let count = f64::from(edges);
                let plate = Plate {
                    size: [ACROSS * EDGE, 2.0 * ACROSS * EDGE],
                    slit: kind.slit(count),
                    triangles: &Triangles::Pattern(pattern),
                    spacing: EDGE,
                    stress: [0.0, 0.0, kind.exact(count)],
                };
                let started = plate.start()?;
                notches.push(Notch {
                    mesh: started.mesh,
                    kind: name,
                    edges,
                    start: started.load,
                });
            }
            done += 1.0;
            progress(done / whole);
        }
    }
    Ok(notches)
}
