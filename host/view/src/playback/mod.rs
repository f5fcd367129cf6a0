//! A feed from a log.
