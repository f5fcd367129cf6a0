//! The choice of the solver that steps a body: as the scene asks, or by the memory that a factor would take.

use crate::scene::spec::{Scene, SolverName};
use physics::{Body, complete_bytes};

/// The largest complete factor that `auto` allows (bytes, as [`complete_bytes`] counts them). A cube reaches this
/// size at 160 thousand tetrahedra. The process then holds nearly twice as much memory. A new factor takes some four
/// seconds, and by then the state that required it is long past.
pub(crate) const LARGEST_FACTOR: usize = 1 << 30;

/// The solver that steps a body, and the reason for the choice.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Choice {
    /// The solver: never `auto`.
    pub solver: SolverName,
    /// The reason, for people.
    pub why: String,
}

/// The solver of `body`.
pub fn choose(scene: &Scene, body: &Body) -> Choice {
    match scene.host.solver {
        SolverName::Auto => by_memory(complete_bytes(body)),
        solver => Choice {
            solver,
            why: "as `host.solver` asks".to_owned(),
        },
    }
}

/// Chooses by the size of the factor. On every measured body whose factor fits in memory, a frozen factor was the
/// fastest solver (`palpate bench speed`). Single precision was never faster by enough to justify its error to a user
/// who did not ask for it.
fn by_memory(bytes: usize) -> Choice {
    let megabytes = |bytes: usize| bytes as f64 / 1e6;
    let (found, most) = (megabytes(bytes), megabytes(LARGEST_FACTOR));
    if bytes > LARGEST_FACTOR {
        Choice {
            solver: SolverName::Incomplete,
            why: format!(
                "a complete factor would take {found:.0} MB, and `auto` allows {most:.0} MB"
            ),
        }
    } else {
        Choice {
            solver: SolverName::Frozen,
            why: format!("the factor takes {found:.1} MB, and `auto` allows {most:.0} MB"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_decides_the_solver_and_is_reported() {
        let fits = by_memory(LARGEST_FACTOR);
        assert_eq!(fits.solver, SolverName::Frozen);
        assert_eq!(
            fits.why,
            "the factor takes 1073.7 MB, and `auto` allows 1074 MB"
        );
        let large = by_memory(1_500_000_000);
        assert_eq!(large.solver, SolverName::Incomplete);
        assert_eq!(
            large.why,
            "a complete factor would take 1500 MB, and `auto` allows 1074 MB"
        );
    }
}
