//! One plugin of each kind that behaves until it is told not to: what a host must survive.

mod driver;
mod kinematics;
mod mischief;
mod planner;
mod strategy;

pub use mischief::{Misbehave, Options};

tandem_sdk::plugin!(
    planner "hostile" = planner::Hostile::open,
    feed_strategy "hostile" = strategy::Hostile::open,
    driver "hostile" = driver::Hostile::open,
    kinematics "hostile" = kinematics::Hostile::open,
);
