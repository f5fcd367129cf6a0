//! The force between publications, compared with physics of the same steps that publishes every step.
//! `palpate bench extrapolation` prints the whole table. Here a short run at 60 Hz checks the claims of the book.

use study::extrapolation::{Motion, run};

#[test]
fn linear_bridges_the_gap_at_60_hz() {
    let found = run(3.0, &[60.0], &[0.5], &mut |_| {}).expect("the study runs");
    let rms = |motion, scheme| found.rms(motion, 60.0, scheme, 0.5).expect("was measured");

    let (hold, linear) = (rms(Motion::Apart, "hold"), rms(Motion::Apart, "linear"));
    assert!(
        5.0 * linear <= hold,
        "pulling apart: linear {linear} N, hold {hold} N"
    );

    let fraction = rms(Motion::Together, "linear") / found.peak[0];
    assert!(
        fraction < 0.01,
        "moving together: {fraction} of the pulling-apart peak {}",
        found.peak[0]
    );

    // The cap lets the hands feel the body: here it withholds a few thousandths of a newton.
    let capped = rms(Motion::Apart, "capped");
    assert!(
        5.0 * capped <= hold,
        "pulling apart: capped {capped} N, hold {hold} N"
    );
    let fraction = rms(Motion::Together, "capped") / found.peak[0];
    assert!(fraction < 0.01, "moving together: {fraction} of the peak");

    // Element tangents are clipped to semidefinite matrices, so the condensed matrix is clipped by rounding only.
    assert!(found.worst_clip < 1e-9, "{}", found.worst_clip);
}
