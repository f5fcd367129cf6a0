//! The observer of a run that makes frames for viewers.
