//! `[loops]` and `[motion]`.

use crate::section::Section;

/// Most fine periods in a rough one: the rough loop keeps every sample of its period.
const MAX_FINE_PERIODS: f64 = 10_000.0;

/// What a stated jerk limit means to a planner that keeps only velocity and acceleration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JerkMode {
    /// It is a limit: such a planner does not start.
    #[default]
    Limit,
    /// It is only reported.
    Report,
}

/// How the machine moves where a block says nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Velocity step that linear axes accept where blocks meet, mm/s.
    pub speed_difference_mm_per_s: f64,
    /// Velocity step that rotary axes accept where blocks meet, rad/s.
    pub speed_difference_rad_per_s: f64,
    /// Distance allowed from the programmed path, mm.
    pub path_tolerance_mm: f64,
    /// Time constant of acceleration, s.
    pub time_constant_s: f64,
    /// Least and greatest time constant that a program may ask for, s; `None` where the machine states none.
    pub time_constant_range_s: Option<(f64, f64)>,
    /// What a stated jerk limit means to a planner of order 2.
    pub jerk: JerkMode,
    /// Highest feed ratio that may be asked while running; at least 1.
    pub max_feed_ratio: f64,
}

impl Motion {
    /// Reads `[motion]`.
    pub(crate) fn read(motion: &Section<'_>) -> Self {
        let linear = motion
            .at_least("allowable_speed_difference_mm_per_min", 0.0)
            .unwrap_or(0.0);
        let rotary = motion
            .at_least("allowable_speed_difference_deg_per_min", 0.0)
            .unwrap_or(linear);
        let modes = [("limit", JerkMode::Limit), ("report", JerkMode::Report)];
        let time_constant_s = motion.at_least("time_constant_ms", 0.0).unwrap_or(50.0) / 1000.0;
        let time_constant_range_s = time_constant_range(motion);
        let (min_s, max_s) = time_constant_range_s.unwrap_or((0.0, LONGEST_S));
        if !(min_s..=max_s).contains(&time_constant_s) {
            let (least, most) = (min_s * 1000.0, max_s * 1000.0);
            motion.refuse(
                "time_constant_ms",
                format!("must be {least} to {most}, the time constants of this machine"),
            );
        }
        Self {
            speed_difference_mm_per_s: linear / 60.0,
            speed_difference_rad_per_s: rotary.to_radians() / 60.0,
            path_tolerance_mm: motion.at_least("path_tolerance_mm", 0.0).unwrap_or(0.01),
            time_constant_s,
            time_constant_range_s,
            jerk: motion.choice("jerk", &modes).unwrap_or_default(),
            max_feed_ratio: motion.at_least("max_feed_ratio", 1.0).unwrap_or(1.0),
        }
    }
}

/// The longest time constant where the machine states no range, s.
const LONGEST_S: f64 = 1.0;

fn time_constant_range(motion: &Section<'_>) -> Option<(f64, f64)> {
    let key = "time_constant_range_ms";
    let (least, most) = motion.has(key).then(|| motion.range(key)).flatten()?;
    if least <= 0.0 {
        motion.refuse(key, "a time constant is above zero");
        return None;
    }
    Some((least / 1000.0, most / 1000.0))
}

/// What the fine loop's thread asks of the computer on the wall clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FineThread {
    /// The core it is pinned to; `None` for the last one that the process may use.
    pub core: Option<u32>,
    /// Its priority among `SCHED_FIFO` threads, 1 to 99.
    pub priority: u32,
}

impl Default for FineThread {
    /// The last core; above the usual interrupt threads (50), below the kernel's own.
    fn default() -> Self {
        Self {
            core: None,
            priority: 80,
        }
    }
}

/// Highest number of a core: what the system's set of cores has room for.
const LAST_CORE: u32 = 1023;

/// The periods of the two loops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Loops {
    pub rough_period_s: f64,
    pub fine_period_s: f64,
    pub fine_periods_per_rough: u32,
    pub max_missed_periods: u32,
    pub max_missed_share: f64,
    pub fine_thread: FineThread,
    pub fine_hang_after_s: f64,
    pub soft_hang_after_s: f64,
}

/// Time after which a fine loop that has not come back does not any more, at least, s. Thousands of times what a period takes,
/// and long enough for a computer without a real-time kernel that is busy with other things; the drives' own watchdogs, which
/// stop the machine, take some hundredths of a second.
const FINE_HANG_AFTER_S: f64 = 2.0;
/// The same in fine periods, where they are long.
const FINE_HANG_AFTER_PERIODS: f64 = 1000.0;
/// Time after which a call of a plugin on the soft side does not come back any more, s: drives on a field bus may take half a
/// minute to start, and plans of the densest programs a few seconds.
const SOFT_HANG_AFTER_S: f64 = 60.0;

/// Share of the periods of a second that may be missed in motion. The drives bridge each of them by guessing; a computer that
/// is set up for its period misses none in an hour, and one that misses one in a hundred will soon miss many in a row.
const MAX_MISSED_SHARE: f64 = 0.01;

impl Loops {
    /// Reads `[loops]`.
    pub fn read(loops: &Section<'_>) -> Self {
        let period = |key, default| {
            if loops.has(key) {
                loops.positive(key)
            } else {
                Some(default)
            }
        };
        let rough = period("rough_period_ms", 8.0);
        let fine = period("fine_period_ms", 1.0);
        let count = rough
            .zip(fine)
            .and_then(|(rough, fine)| fine_periods(loops, rough, fine));
        let fine_thread = FineThread {
            core: loops.whole("fine_core", 0, LAST_CORE),
            priority: loops
                .whole("fine_priority", 1, 99)
                .unwrap_or(FineThread::default().priority),
        };
        let fine_period_s = fine.unwrap_or(1.0) / 1000.0;
        let at_least_s = FINE_HANG_AFTER_S.max(FINE_HANG_AFTER_PERIODS * fine_period_s);
        Self {
            rough_period_s: rough.unwrap_or(8.0) / 1000.0,
            fine_period_s,
            fine_hang_after_s: loops
                .at_least("fine_hang_after_ms", 10.0)
                .map_or(at_least_s, |ms| ms / 1000.0),
            soft_hang_after_s: loops
                .at_least("soft_hang_after_s", 0.1)
                .unwrap_or(SOFT_HANG_AFTER_S),
            fine_periods_per_rough: count.unwrap_or(1),
            max_missed_periods: loops.whole("max_missed_periods", 0, u32::MAX).unwrap_or(2),
            max_missed_share: share(loops, "max_missed_share").unwrap_or(MAX_MISSED_SHARE),
            fine_thread,
        }
    }
}

/// Reads a share of a whole; `None` where it is absent or wrong, which is reported.
fn share(loops: &Section<'_>, key: &str) -> Option<f64> {
    let share = loops.at_least(key, 0.0)?;
    if share > 1.0 {
        loops.refuse(key, format!("must be at most 1, not {share}"));
        return None;
    }
    Some(share)
}

fn fine_periods(loops: &Section<'_>, rough: f64, fine: f64) -> Option<u32> {
    let count = (rough / fine).round();
    let key = if loops.has("rough_period_ms") {
        "rough_period_ms"
    } else {
        "fine_period_ms"
    };
    if count < 1.0 || (rough / fine - count).abs() > 1e-9 * count {
        loops.refuse(
            key,
            format!("the rough period, {rough} ms, is not a whole multiple of the fine period, {fine} ms"),
        );
        return None;
    }
    if count > MAX_FINE_PERIODS {
        let most = format!(
            "the rough period, {rough} ms, is more than {MAX_FINE_PERIODS} fine periods of {fine} ms"
        );
        loops.refuse(key, most);
        return None;
    }
    Some(count as u32)
}
