//! What a run counted, as its summary.

use std::sync::atomic::Ordering::Relaxed;

use tandem_machine::{JerkMode, Machine};
use tandem_recorder::{JointWatch, PlanningUs, SUMMARY_FORMAT, Summary};
use tandem_rings::Counters;
use tandem_sdk::AxisVector;

use crate::soft::soft_loop::SoftLoop;
use crate::switches::Clock;

/// The summary of what `soft_loop` saw and the fine loop counted; what only the clock or the host knows is added to it.
pub fn summarise(
    machine: &Machine,
    program: &str,
    clock: Clock,
    soft_loop: &SoftLoop<'_>,
    counters: &Counters,
) -> Summary {
    let monitor = &soft_loop.monitor;
    let axes = &machine.axes;
    let of = |rotary: bool, values: &AxisVector| {
        let shown = |i: usize| {
            if rotary {
                values[i].to_degrees()
            } else {
                values[i]
            }
        };
        let chosen = (0..axes.count()).filter(|i| axes.is_rotary(*i) == rotary);
        chosen
            .map(|i| (axes.letter(i).to_lowercase().to_string(), shown(i)))
            .collect()
    };
    let linear = |values: &AxisVector| of(false, values);
    let rotary = |values: &AxisVector| of(true, values);
    Summary {
        format: SUMMARY_FORMAT,
        program: program.to_string(),
        machine: machine.name.clone(),
        planner: machine.planner.plugin.clone(),
        clock: if clock == Clock::Virtual {
            "virtual"
        } else {
            "wall"
        }
        .to_string(),
        dry_run: false,
        blocks: monitor.blocks,
        length_mm: monitor.length_mm,
        nominal_time_s: monitor.nominal_s,
        motion_time_s: monitor.samples.saturating_sub(1) as f64 * machine.fine_period_s,
        reference_time_s: None,
        time_ratio: None,
        fine_period_s: machine.fine_period_s,
        rough_period_s: machine.rough_period_s,
        samples: counters.samples,
        max_velocity_mm_s: linear(&monitor.peaks[0]),
        max_velocity_deg_s: rotary(&monitor.peaks[0]),
        max_acceleration_mm_s2: linear(&monitor.peaks[1]),
        max_acceleration_deg_s2: rotary(&monitor.peaks[1]),
        max_jerk_mm_s3: linear(&monitor.peaks[2]),
        max_jerk_deg_s3: rotary(&monitor.peaks[2]),
        joints: monitor.joints.as_ref().map(JointWatch::peaks),
        max_path_deviation_mm: monitor.max_path_deviation_mm(),
        worst_of_limits: (0..machine.axes.count())
            .map(|i| {
                (
                    machine.axes.letter(i).to_lowercase().to_string(),
                    monitor.worst.of_axis(i),
                )
            })
            .collect(),
        jerk: if machine.motion.jerk == JerkMode::Limit {
            "limit"
        } else {
            "report"
        }
        .to_string(),
        limit_violations: counters.limit_violations,
        guard_stops: counters.guard_stops,
        governed_samples: counters.governed_samples,
        jerk_relaxed_samples: counters.jerk_relaxed_samples,
        overruns: 0,
        missed_periods: counters.missed_periods,
        missed_in_motion: counters.missed_in_motion,
        lateness_us: None,
        exchange_us: None,
        old_feedback_samples: monitor.old_feedback_samples,
        max_feedback_age_periods: monitor.max_feedback_age_periods,
        max_phase_us: monitor.max_phase_ns.map(|ns| ns as f64 / 1e3),
        page_faults: None,
        starvations: counters.starvations,
        queue_limited_samples: counters.queue_limited_samples,
        late_ratios: counters.late_ratios,
        lost_samples: soft_loop.host.status.lost_samples.load(Relaxed),
        record_errors: vec![],
        end_position_mm: linear(&monitor.position),
        end_position_deg: rotary(&monitor.position),
        wall_time_s: 0.0,
        planning_ns_per_block: soft_loop.planning_ns as f64 / monitor.blocks.max(1) as f64,
        planning_us: PlanningUs::from(&soft_loop.planning),
        limited_by_s: monitor
            .limited_by_s
            .iter()
            .filter(|(_, s)| *s > 0.0)
            .map(|(by, s)| (by.name().to_string(), *s))
            .collect(),
        policy: None,
        stops: monitor.stops.stops.clone(),
        stop_count: monitor.stops.count,
        fault: None,
        stopped: None,
    }
}
