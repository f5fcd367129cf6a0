//! Folds ticks into frames.
