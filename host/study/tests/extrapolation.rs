//! The force between publications, against physics with the same steps that publishes every step. The whole
//! table is `palpate bench extrapolation`; here a short run at 60 Hz guards what the book promises.

use study::extrapolation::{Motion, run};

#[test]
fn linear_bridges_the_gap_at_60_hz() {
    let found = run(3.0, &[60.0], &[0.5], |_| {}).expect("the study runs");
    let rms = |motion, scheme| found.rms(motion, 60.0, scheme, 0.5).expect("was measured");

    let (hold, linear) = (rms(Motion::Apart, "hold"), rms(Motion::Apart, "linear"));
    assert!(
        5.0 * linear <= hold,
        "pulling apart: linear {linear} N, hold {hold} N"
    );

    let share = rms(Motion::Together, "linear") / found.peak[0];
    assert!(
        share < 0.01,
        "moving together: {share} of the pulling-apart peak {}",
        found.peak[0]
    );

    // Element tangents are clipped to semidefinite, so nothing is left to clip but rounding.
    assert!(found.worst_clip < 1e-9, "{}", found.worst_clip);
}
