//! Numbers of all axes side by side: loops over them become vector instructions.

#![allow(
    clippy::inline_always,
    reason = "what is inlined is compiled for the wide instructions of its caller"
)]

/// One number a lane.
pub type Lanes<const L: usize> = [f64; L];

/// Calls `f` for every lane. Not a loop: what is summed up lane by lane stays in registers then, and does not go through memory.
#[inline(always)]
pub fn each<const L: usize>(f: impl FnMut(usize) -> f64) -> Lanes<L> {
    std::array::from_fn(f)
}

/// The larger one; the first where either is no number. Unlike `f64::max` one instruction.
#[inline(always)]
pub fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// The smaller one; the first where either is no number.
#[inline(always)]
pub fn smaller(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}

/// The largest of all lanes.
#[inline(always)]
pub fn largest<const L: usize>(values: &Lanes<L>) -> f64 {
    values
        .iter()
        .fold(f64::NEG_INFINITY, |most, v| larger(most, *v))
}
