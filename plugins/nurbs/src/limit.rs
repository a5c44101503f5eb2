//! The feed at which the chord of a fine period stays on the curve.

/// The feed, mm/s, whose chord over `period_s` stands off a circle of curvature `per_mm` by `chord_error_mm`.
///
/// `V = 2/T·√(2ρδ − δ²)` (Yeh & Hsu). For ρ < δ the formula falls with ρ and then has no value: there δ is taken as ρ, so
/// that the chord is at most a diameter. Infinite on a straight path.
pub fn chord_feed_mm_per_s(per_mm: f64, chord_error_mm: f64, period_s: f64) -> f64 {
    if per_mm == 0.0 {
        return f64::INFINITY;
    }
    let radius_mm = 1.0 / per_mm;
    let error_mm = chord_error_mm.min(radius_mm);
    2.0 / period_s * (error_mm * (2.0 * radius_mm - error_mm)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chord_of_a_period_stands_off_by_the_error() {
        for (radius, error) in [(10.0, 0.001), (0.02, 0.001), (300.0, 0.01)] {
            let chord = chord_feed_mm_per_s(1.0 / radius, error, 0.002) * 0.002;
            let sagitta = radius - (radius * radius - chord * chord / 4.0).sqrt();
            assert!((sagitta - error).abs() < 1e-9, "{sagitta}");
        }
        assert_eq!(chord_feed_mm_per_s(0.0, 0.001, 0.002), f64::INFINITY);
        // Below the error a chord is a diameter; the feed does not rise again.
        assert!((chord_feed_mm_per_s(1e4, 0.001, 0.002) - 0.1).abs() < 1e-12);
    }
}
