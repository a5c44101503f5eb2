//! The feed strategy `force-control`: the cutting torque from motor current and speed, and the feed that holds it.
//!
//! ```toml
//! [feed_strategy]
//! plugin = "force-control"
//! [feed_strategy.options]
//! law = "pi"                      # or p, ratio
//! reference_torque_nm = 0.1
//! min_feed_mm_per_min = 10
//! max_feed_mm_per_min = 300
//! teeth = 2
//! [feed_strategy.options.axes.x]
//! lead_mm = 20
//! torque_constant_nm_per_a = 0.378
//! inertia_kg_m2 = 1.842e-4        # tandem identify finds this and the friction
//! friction = { coulomb_nm = 0.06, viscous_nm_s_per_rad = 6e-4 }
//! [feed_strategy.options.stability]
//! torque_per_feed_nm_min_per_mm = 0.001
//! ```
//!
//! In every fine sample an [`observer::Observer`] per axis estimates the torque that opposes the motor; a
//! [`friction::FrictionModel`] is taken out before it. Once a rough period the mean over whole tooth periods goes through a
//! [`law::Law`], which asks for a feed. A [`guard::Guard`] on the fine samples asks for a hold. Methods after Song, Son, Kwon
//! and Kim, "Control of a CNC Machining Center Using the Indirect Measurement of the Cutting Force".

pub mod axis;
pub mod conversion;
pub mod engagement;
pub mod fit;
pub mod friction;
pub mod guard;
pub mod inertia;
pub mod law;
pub mod learning;
pub mod mean;
pub mod observer;
pub mod options;
pub mod stability;
pub mod strategy;

tandem_sdk::plugin!(feed_strategy "force-control" = strategy::ForceControl::open);
