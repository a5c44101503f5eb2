//! NURBS curves against published cases, an independent library and properties that must hold.

mod cases;
mod common;
mod degenerate;
mod independent;
mod properties;
