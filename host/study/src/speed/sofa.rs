//! What other programs take for the same cube and for sheets of as many triangles: figures from elsewhere.
//!
//! SOFA v26.06, built with `g++ -O3 -march=native` in double precision, one thread of an AMD EPYC of 2.6 GHz
//! with AVX-512, where the calibration took 29.45 us: medians of whole steps. Its
//! stopping rule is an absolute one; the residuals given are what was left relative to the right-hand side.
//! The thesis's figures are its own tables 3.1 and 4.1, on an i7-4800MQ or a Xeon E5-2620: not scaled.

use serde::Serialize;

/// One figure from elsewhere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Elsewhere {
    /// The program and its setting.
    pub setting: &'static str,
    /// Tetrahedra or triangles.
    pub elements: usize,
    /// Time of a whole step (s).
    pub step: f64,
    /// Whether that is the 99th percentile, and not the median.
    pub p99: bool,
    /// Whether it was taken where the calibration was, so that it can be scaled.
    pub scalable: bool,
}

const fn figure(setting: &'static str, elements: usize, milliseconds: f64) -> Elsewhere {
    Elsewhere {
        setting,
        elements,
        step: 1e-3 * milliseconds,
        p99: false,
        scalable: true,
    }
}

const fn percentile(elements: usize, milliseconds: f64) -> Elsewhere {
    Elsewhere {
        p99: true,
        ..figure(FACTOR_99, elements, milliseconds)
    }
}

const fn thesis(elements: usize, milliseconds: f64) -> Elsewhere {
    Elsewhere {
        scalable: false,
        ..figure("the thesis, its machine", elements, milliseconds)
    }
}

const CLASSIC: &str = "SOFA, classic force field, 25 iterations (residual 1e-2 to 7e-2)";
const FASTEST: &str = "SOFA, fastest force field, 25 iterations (not converged)";
const FASTEST_100: &str = "SOFA, fastest, 100 iterations (1.5e-9, 8e-8, 2e-6)";
const FACTOR: &str = "SOFA, fastest, factor refreshed every 50 steps (1e-6)";
const FACTOR_99: &str = "the same, 99th percentile";
const DIRECT: &str = "SOFA, sparse direct";
const CLOTH: &str = "SOFA, fastest cloth with right constants, 25 iterations, no bending";

/// Whole steps of the cube.
pub const CUBE: [Elsewhere; 21] = [
    figure(CLASSIC, 1296, 1.60),
    figure(CLASSIC, 3072, 3.61),
    figure(CLASSIC, 6000, 6.87),
    figure(FASTEST, 1296, 0.56),
    figure(FASTEST, 3072, 1.18),
    figure(FASTEST, 6000, 2.20),
    figure(FASTEST_100, 1296, 1.46),
    figure(FASTEST_100, 3072, 3.04),
    figure(FASTEST_100, 6000, 5.57),
    figure(FACTOR, 1296, 0.47),
    figure(FACTOR, 3072, 1.31),
    figure(FACTOR, 6000, 4.04),
    percentile(1296, 2.8),
    percentile(3072, 13.5),
    percentile(6000, 64.0),
    figure(DIRECT, 1296, 2.5),
    figure(DIRECT, 3072, 13.1),
    figure(DIRECT, 6000, 65.5),
    thesis(1296, 2.2),
    thesis(3072, 5.2),
    thesis(6000, 13.0),
];

/// Force at the end of the press (N), by tetrahedra: SOFA's with polar rotations, and an independent
/// program's.
pub const CUBE_FORCE: [(usize, f64); 3] = [(1296, 21.6604), (3072, 21.4799), (6000, 21.3776)];

/// Whole steps of sheets; the thesis's are its cloth, banknote and T-shirt, elasticity alone.
pub const SHEETS: [Elsewhere; 6] = [
    figure(CLOTH, 1404, 0.85),
    figure(CLOTH, 1922, 1.15),
    figure(CLOTH, 3280, 1.90),
    thesis(1404, 8.7),
    thesis(1922, 11.0),
    thesis(3280, 14.0),
];
