//! The commands from outside: their output, their files and their exit codes. They are one program, so that long commands run side by side.

mod accuracy;
mod bad_meshes;
mod bugreport;
mod compare;
mod doctor;
mod killed_frames;
mod latency;
mod lost_logs;
mod outputs;
mod overrides;
mod paper;
mod program;
mod replay;
mod serve;
mod solve;
mod stress_hold;
mod stress_options;
mod stress_scene;
mod stress_wall;
mod tables;
mod units;
mod view_run;
