//! How long the frozen factor takes: factorization, refresh of the panels, solve.
fn main() {}
