//! The best motion among given places, where the force held after a place is a function of that place alone.

use super::port::Port;

/// The motion of `ticks` steps at most over `places` (m), from the first of them, that gets most out of forces that
/// depend on the place alone (`forces`, N, held from the tick at that place to the next), and what it gets (J). No
/// step is longer than `step` (m). By dynamic programming (R. Bellman, 1957) backwards in time; without delay only,
/// for a delayed force depends on earlier places.
pub fn best_among(
    port: &Port,
    places: &[f64],
    forces: &[f64],
    step: f64,
    ticks: usize,
) -> (f64, Vec<f64>) {
    let count = places.len().min(forces.len());
    // What can still be got with so many ticks left, by place, and where to go for it.
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
