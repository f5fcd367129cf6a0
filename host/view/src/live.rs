//! A feed from a run, over its Unix socket.
