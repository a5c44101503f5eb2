//! The speed profile along one block: speed up, cruise, slow down, with constant acceleration.

use crate::SpeedPiece;

/// A trapezoid (or triangle) of speed over a length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Length, mm.
    pub length_mm: f64,
    /// Speed at the start, mm/s.
    pub start_mm_per_s: f64,
    /// Highest speed, mm/s.
    pub peak_mm_per_s: f64,
    /// Speed at the end, mm/s.
    pub end_mm_per_s: f64,
    /// Acceleration and deceleration, mm/s².
    pub acceleration_mm_per_s2: f64,
}

impl Profile {
    /// Durations of speeding up, cruising and slowing down, s.
    ///
    /// `t_acc = (v_p − F_s)/A`, `t_dec = (v_p − F_e)/A`, `t_cruise = (L − (2v_p² − F_s² − F_e²)/(2A))/v_p`
    /// (Lee & Lee, two-step motion control loop, with linear acceleration).
    pub fn durations_s(&self) -> [f64; 3] {
        if self.is_level() {
            return [0.0, self.length_mm / self.peak_mm_per_s, 0.0];
        }
        let [up_mm, down_mm] = self.ramps_mm();
        let per_acceleration = 1.0 / self.acceleration_mm_per_s2;
        let peak = self.peak_mm_per_s;
        let cruise_s = (self.length_mm - (up_mm + down_mm)) / peak;
        [
            (peak - self.start_mm_per_s) * per_acceleration,
            if cruise_s > 0.0 { cruise_s } else { 0.0 },
            (peak - self.end_mm_per_s) * per_acceleration,
        ]
    }

    /// Whether the speed is the same everywhere: then nothing waits for the divisions by the acceleration.
    fn is_level(&self) -> bool {
        self.start_mm_per_s == self.peak_mm_per_s && self.end_mm_per_s == self.peak_mm_per_s
    }

    /// Lengths of speeding up and of slowing down, mm.
    fn ramps_mm(&self) -> [f64; 2] {
        if self.is_level() {
            return [0.0; 2];
        }
        let per_2a = 0.5 / self.acceleration_mm_per_s2;
        let peak = self.peak_mm_per_s;
        [self.start_mm_per_s, self.end_mm_per_s].map(|end| (peak - end) * (peak + end) * per_2a)
    }

    /// The pieces in order, with the [durations](Profile::durations_s) of this profile; those too short to matter (below
    /// 1e-12 s) have none.
    pub fn pieces(&self, durations_s: [f64; 3]) -> [SpeedPiece; 3] {
        let [up, cruise, down] = durations_s;
        let a = self.acceleration_mm_per_s2;
        let peak = self.peak_mm_per_s;
        // The last ramp is laid from the end of the block, so that rounding falls into the cruise.
        let [up_mm, down_mm] = self.ramps_mm();
        let piece = |duration_s, start_mm, speed_mm_per_s, acceleration_mm_per_s2| SpeedPiece {
            start_mm,
            speed_mm_per_s,
            acceleration_mm_per_s2,
            duration_s: if duration_s < 1e-12 { 0.0 } else { duration_s },
        };
        [
            piece(up, 0.0, self.start_mm_per_s, a),
            piece(cruise, up_mm, peak, 0.0),
            piece(down, self.length_mm - down_mm, peak, -a),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn pieces_cover_the_length(
            start in 0.0..50.0f64, end in 0.0..50.0f64, over in 0.1..50.0f64, a in 10.0..5000.0f64, cruise in 0.0..30.0f64,
        ) {
            let peak = start.max(end) + over;
            let length = ((peak * peak) * 2.0 - start * start - end * end) / (2.0 * a) + cruise;
            let profile = Profile {
                length_mm: length, start_mm_per_s: start, peak_mm_per_s: peak, end_mm_per_s: end, acceleration_mm_per_s2: a,
            };
            let mut at = 0.0;
            let mut speed = start;
            for piece in profile.pieces(profile.durations_s()) {
                if piece.duration_s == 0.0 { continue; }
                prop_assert!((piece.start_mm - at).abs() < 1e-9 && (piece.speed_mm_per_s - speed).abs() < 1e-9);
                at += (speed + piece.acceleration_mm_per_s2 * piece.duration_s / 2.0) * piece.duration_s;
                speed += piece.acceleration_mm_per_s2 * piece.duration_s;
            }
            prop_assert!((at - length).abs() < 1e-9 && (speed - end).abs() < 1e-9);
        }
    }
}
