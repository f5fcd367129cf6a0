//! The best motion among given positions, if the held force depends only on the last position.

use super::mechanism::Mechanism;

/// Returns the largest energy (J) of a motion over `places` (m), and that motion. The motion starts at the first place,
/// has at most `ticks` steps, and no step is longer than `step` (m). `forces` (N) are the forces held from the tick at
/// each place to the next tick. The method is dynamic programming (R. Bellman, 1957), backwards in time. It holds
/// without delay only, because a delayed force depends on earlier places.
pub fn best_among(
    port: &Mechanism,
    places: &[f64],
    forces: &[f64],
    step: f64,
    ticks: usize,
) -> (f64, Vec<f64>) {
    let count = places.len().min(forces.len());
    // The largest energy that the remaining ticks can give, by place, and the next place to go to.
    let mut value = vec![0.0; count];
    let mut choices: Vec<Vec<usize>> = Vec::with_capacity(ticks);
    for _ in 0..ticks {
        let best = |from: usize| {
            let mut best = (0.0, from);
            for to in 0..count {
                let by = places[to] - places[from];
                if by.abs() <= step {
                    let gain = port.work(forces[from], by) + value[to];
                    if gain > best.0 {
                        best = (gain, to);
                    }
                }
            }
            best
        };
        let (next, choice) = (0..count).map(best).unzip();
        value = next;
        choices.push(choice);
    }
    let mut at = 0;
    let mut motion = Vec::new();
    for choice in choices.iter().rev() {
        let Some(&next) = choice.get(at) else { break };
        at = next;
        motion.push(places[at]);
    }
    (value.first().copied().unwrap_or(0.0), motion)
}
