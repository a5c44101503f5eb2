//! A drive as a file describes it.

use serde::Deserialize;

/// A drive by CiA 402 and the axis that it moves. Positions are counts of its encoder.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DriveDescription {
    /// Where the axis stands at power-on.
    pub position_counts: f64,
    /// Counts of one turn, from one index pulse to the next.
    pub counts_per_turn: f64,
    /// Gain of the position loop, in 1/s; without velocity feed-forward the axis lags by velocity / gain.
    pub position_gain_per_s: f64,
    /// Lag of the velocity loop, in s.
    pub velocity_lag_s: f64,
    /// Acceleration at rated torque, in counts/s².
    pub rated_acceleration_counts_per_s2: f64,
    /// Time until the brake is open, before which the drive is not enabled, in ms.
    pub brake_open_ms: f64,
    /// Time until the brake holds, while which the drive still does, in ms.
    pub brake_close_ms: f64,
    /// Modes that it supports: 3 profile velocity, 6 homing, 8 cyclic position, 9 cyclic velocity.
    pub modes: Vec<i8>,
    /// Where the negative limit switch begins.
    pub negative_limit_counts: Option<f64>,
    /// Where the positive limit switch begins.
    pub positive_limit_counts: Option<f64>,
    /// Above which position the home switch is on.
    pub home_switch_counts: Option<f64>,
    /// Above which position each touch probe is on.
    pub probes_counts: [Option<f64>; 2],
    /// Where a process holds against the axis.
    pub cuts: Vec<Cut>,
    /// Deceleration of a quick stop at power-on, object 6085, in counts/s².
    pub quick_stop_deceleration_counts_per_s2: u32,
    /// Following error at power-on that is a fault, object 6065, in counts.
    pub following_error_window_counts: u32,
    /// How long it may be exceeded, object 6066, in ms.
    pub following_error_time_ms: u16,
    /// Errors of synchronization at power-on that are not a fault yet, object 10F1:02: a missing setpoint counts 3, a
    /// setpoint in time takes one back.
    pub sync_error_limit: u16,
    /// Shortest cycle of SYNC0 that it can follow, in µs.
    pub min_cycle_us: u32,
    /// Whether it tells of a fault by an emergency message too.
    pub emergency: bool,
}

impl Default for DriveDescription {
    fn default() -> Self {
        Self {
            position_counts: 0.0,
            counts_per_turn: 1_048_576.0,
            position_gain_per_s: 150.0,
            velocity_lag_s: 0.001,
            rated_acceleration_counts_per_s2: 1e8,
            brake_open_ms: 0.0,
            brake_close_ms: 0.0,
            modes: vec![3, 6, 8, 9],
            negative_limit_counts: None,
            positive_limit_counts: None,
            home_switch_counts: None,
            probes_counts: [None; 2],
            cuts: vec![],
            quick_stop_deceleration_counts_per_s2: 40_000_000,
            following_error_window_counts: 100_000,
            following_error_time_ms: 10,
            sync_error_limit: 12,
            min_cycle_us: 125,
            emergency: true,
        }
    }
}

/// A stretch of the axis in which a process holds against it, the more the faster it goes: a cut.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// Where it begins.
    pub from_counts: f64,
    /// Where it ends.
    pub to_counts: f64,
    /// Torque of the process, as a share of the rated one, for a velocity of 1 count/s.
    pub torque_share_s_per_count: f64,
}

/// Modes that this drive can do at all.
pub(super) const MODES: [i8; 4] = [3, 6, 8, 9];

impl DriveDescription {
    /// Refuses what has no meaning.
    pub(crate) fn judge(&self) -> Result<(), String> {
        let positive = [
            ("counts_per_turn", self.counts_per_turn),
            ("position_gain_per_s", self.position_gain_per_s),
            (
                "rated_acceleration_counts_per_s2",
                self.rated_acceleration_counts_per_s2,
            ),
        ];
        if let Some((key, _)) = positive
            .into_iter()
            .find(|(_, value)| !(*value > 0.0 && value.is_finite()))
        {
            return Err(format!("drive.{key} is more than 0"));
        }
        let shortest = super::STEP_NS as f64 / 1e9;
        if !(shortest..=1.0).contains(&self.velocity_lag_s)
            || self.position_gain_per_s > 0.5 / self.velocity_lag_s
        {
            return Err(format!(
                "drive.velocity_lag_s is {shortest} to 1, and position_gain_per_s at most half its inverse"
            ));
        }
        let fits = |cut: &Cut| {
            let share = cut.torque_share_s_per_count;
            // Beyond this it would brake the axis by more than its speed within a step of the drive's loop.
            let most = 0.5 / shortest / self.rated_acceleration_counts_per_s2;
            cut.from_counts < cut.to_counts && (0.0..=most).contains(&share)
        };
        if !self.cuts.iter().all(fits) {
            return Err(
                "drive.cuts begin before they end, with 0 or a little torque for a count/s"
                    .to_string(),
            );
        }
        let times = [
            ("brake_open_ms", self.brake_open_ms),
            ("brake_close_ms", self.brake_close_ms),
        ];
        if let Some((key, _)) = times
            .into_iter()
            .find(|(_, value)| !(0.0..=60_000.0).contains(value))
        {
            return Err(format!("drive.{key} is 0 to 60000"));
        }
        if !(-1e15..=1e15).contains(&self.position_counts) {
            return Err("drive.position_counts is a number of counts".to_string());
        }
        if let Some(mode) = self.modes.iter().find(|mode| !MODES.contains(mode)) {
            return Err(format!("drive.modes has {mode}; 3, 6, 8 and 9 can be had"));
        }
        Ok(())
    }
}
