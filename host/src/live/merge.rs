//! Merges frames.

use super::frame::Frame;

/// Merges `later` into `frame`.
pub fn merge(frame: &mut Frame, later: &Frame) {
    let mut folded = frame.folded.clone();
    folded.last = later.folded.last;
    folded.to_ns = later.folded.to_ns;
    folded.ticks += later.folded.ticks;
    for (a, b) in folded.hands.iter_mut().zip(&later.folded.hands) {
        a.force_norm.merge(&b.force_norm);
    }
    *frame = later.clone();
    frame.folded = folded;
}
