//! The feed strategy `force-control`.

pub mod conversion;
pub mod fit;
pub mod friction;
pub mod guard;
pub mod inertia;
pub mod law;
pub mod mean;
pub mod observer;
pub mod stability;
