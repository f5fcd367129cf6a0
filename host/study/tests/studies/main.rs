//! Tests of the studies, one program: the generic code of the solvers is compiled once, and the tests run side by side.

mod accuracy;
mod contact;
mod contact_between;
mod extrapolation;
mod latency;
mod stability;
mod stress_connections;
mod stress_contact;
mod stress_hold;
mod stress_mounting;
mod stress_scene;
mod stress_tools;
mod tearing;
mod tearing_runs;
mod truth;
mod velocity;
