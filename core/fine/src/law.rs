//! Laws of motion along one coordinate whose second derivative is bounded: how to come to rest in the shortest time.

/// The second derivative, within `±most`, that brings a double integrator to `x = 0, rate = 0`, coming in with `gentle`.
///
/// The discrete time-optimal law of Han, "From PID to Active Disturbance Rejection Control", IEEE Trans. Ind. Electron.
/// 56(3), 2009, equation (5), for `x ← x + h·rate, rate ← rate + h·u`: it reaches rest without chatter. Here the curve on
/// which it comes in is drawn with `gentle ≤ most`, so that there is room to get back onto it when what `most` may be
/// changes on the way. A sampled motion with u constant within each period has this form in `x − h·rate/2`, which the
/// caller passes.
pub fn to_rest(x: f64, rate: f64, gentle: f64, most: f64, period_s: f64) -> f64 {
    let step = gentle * period_s * period_s;
    if step <= 0.0 {
        return 0.0;
    }
    let ahead = period_s * rate;
    let y = x + ahead;
    let far = (step * (step + 8.0 * y.abs())).sqrt();
    let off = if y.abs() < step { ahead + y } else { ahead + y.signum() * (far - step) / 2.0 };
    (-off / (period_s * period_s)).clamp(-most, most)
}

/// State along the path and what it may be changed with.
#[derive(Clone, Copy, Debug)]
pub struct Along {
    /// Path speed, mm/s.
    pub speed_mm_per_s: f64,
    /// Path acceleration, mm/s².
    pub acceleration_mm_per_s2: f64,
    /// Deceleration that may be used, mm/s².
    pub most_mm_per_s2: f64,
    /// Jerk that may be used, mm/s³; infinite where it is not limited.
    pub jerk_mm_per_s3: f64,
}

impl Along {
    /// Way until the speed has come down to `end_mm_per_s`, mm: acceleration to zero, deceleration up, held, and down.
    pub fn way_to_mm(&self, end_mm_per_s: f64) -> f64 {
        let (a, j) = (self.most_mm_per_s2, self.jerk_mm_per_s3);
        let (mut v, mut way_mm) = (self.speed_mm_per_s, 0.0);
        let mut braking = -self.acceleration_mm_per_s2;
        if braking < 0.0 {
            let t = -braking / j;
            way_mm += t * (v + t * j * t / 3.0);
            v += -braking * t / 2.0;
            braking = 0.0;
        }
        let drop = v - end_mm_per_s;
        let ending = braking * braking / (2.0 * j);
        if drop <= ending {
            // What is already under way is more than enough.
            return way_mm + drop.max(0.0) * v / braking.max(f64::MIN_POSITIVE);
        }
        let peak = (j * drop + braking * braking / 2.0).sqrt().min(a.max(braking));
        let rise_s = (peak - braking) / j;
        let fall_s = peak / j;
        let held_s = ((drop - (peak * peak - braking * braking / 2.0) / j) / peak).max(0.0);
        way_mm += rise_s * (v - rise_s * (braking / 2.0 + j * rise_s / 6.0));
        v -= rise_s * (braking + peak) / 2.0;
        way_mm += held_s * (v - peak * held_s / 2.0);
        v -= peak * held_s;
        way_mm + fall_s * (v - fall_s * (peak / 2.0 - j * fall_s / 6.0))
    }
}
