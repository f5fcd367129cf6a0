//! Whole runs of the host: what they compute, and what they show and store. They are one program, because each program compiles the generic solvers anew and is linked anew.

#[path = "../rig/mod.rs"]
mod rig;

mod body_change;
mod contact_changes;
mod contact_seen;
mod emulated;
mod energy;
mod engage;
mod few_axes;
mod hands;
mod host_body;
mod joined;
mod late_hosts;
mod late_link;
mod limits;
mod live_socket;
mod live_truth;
mod log_frames;
mod log_on_disk;
mod mounting;
mod observers;
mod pieces_asleep;
mod pressed_bodies;
mod publisher;
mod replay;
mod replay_devices;
mod replay_fields;
mod run_frames;
mod run_table;
mod schemes;
mod sessions;
mod slips;
mod slow_host;
mod solvers;
mod stiff;
mod summary;
mod threads;
mod tool;
mod torn_changes;
mod torn_shapes;
mod touch;
mod touching_scenes;
