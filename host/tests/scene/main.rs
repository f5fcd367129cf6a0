//! Scenes: what their files say, and how wrong files are refused. They are one program, because each program compiles the generic solvers anew and is linked anew.

mod contact_scene;
mod flat_pattern;
mod placement;
mod plan;
mod plausible;
mod scene_edits;
mod scene_errors;
mod scene_files;
mod tear_scene;
mod thread;
