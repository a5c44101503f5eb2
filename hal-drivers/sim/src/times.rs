//! Times of the options in fine periods, and how long drives take at most.

/// Whole fine periods that `seconds` take; more than there will ever be where they never end.
pub fn periods(seconds: f64, period_s: f64) -> u64 {
    (seconds / period_s - 1e-6).ceil().max(0.0) as u64
}

/// The longest of the times that end.
pub fn longest(seconds: &[f64]) -> f64 {
    seconds
        .iter()
        .copied()
        .filter(|s| s.is_finite())
        .fold(0.0, f64::max)
}

/// Time beyond the delays of drives within which they are up or down for certain, s: a second to come to rest in, lost frames.
pub const MARGIN_S: f64 = 1.0;
