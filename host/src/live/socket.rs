//! The Unix socket that serves frames.
