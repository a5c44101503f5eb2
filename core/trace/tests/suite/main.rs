//! Traces as they are written, cut short, and damaged.

mod damage;
mod made;
mod round_trip;
