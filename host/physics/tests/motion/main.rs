//! Tests of `motion`. They are one program, because each program compiles the generic solvers anew.

#[global_allocator]
static ALLOCATOR: alloc_count::calls::Counting = alloc_count::calls::Counting;

mod beam;
mod calculix;
mod calls;
mod certified;
mod contacts;
mod equilibrium;
mod guard;
mod guess;
mod incomplete;
mod integrator;
mod inverted;
mod joined;
mod pieces_asleep;
mod rounding;
mod stability;
mod step;
mod stepper;
mod strip;
mod team;
mod touching;
