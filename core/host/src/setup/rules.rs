//! What does not go together: refusals before a run starts.

use tandem_machine::{Analog, GuardMode, JerkMode, Machine};
use tandem_sdk::{MAX_ENABLE_S, MAX_SIGNALS, PlannerDescription};

use crate::drives::{Entry, Roster};
use crate::error::{HostError, refusal};
use crate::joints::JointSpace;
use crate::switches::{Clock, Switches};

/// Checks planner, driver and guard against each other.
pub fn check(
    machine: &Machine,
    planner: &PlannerDescription,
    drivers: &Roster,
) -> Result<(), HostError> {
    let refuse = |key: &str, cause: String| Err(refusal(machine, key, cause));
    let name = &machine.planner.plugin;
    if !(2..=3).contains(&planner.order) {
        let cause = format!(
            "{name} describes plans of order {}: 2 and 3 are known",
            planner.order
        );
        return refuse("planner.plugin", cause);
    }
    if let Some(real) = drivers.real().filter(|_| machine.guard == GuardMode::Count) {
        let cause = format!(
            "\"count\" sends samples beyond the limits: not with {}, which moves metal",
            real.title
        );
        return refuse("guard.mode", cause);
    }
    if planner.breaks_limits != 0 && machine.guard != GuardMode::Count {
        let cause = format!(
            "this form of {name} breaks limits, as published: it runs on simulated drives with guard.mode = \"count\" only"
        );
        return refuse("planner.plugin", cause);
    }
    let jerk_stated = machine
        .limits
        .axes()
        .iter()
        .any(|a| a.jerk_mm_per_s3.is_finite());
    if jerk_stated && planner.order < 3 && machine.motion.jerk == JerkMode::Limit {
        let cause = format!(
            "the machine states a jerk limit and {name} keeps none; with motion.jerk = \"report\" it is only reported"
        );
        return refuse("planner.plugin", cause);
    }
    Ok(())
}

/// Checks the times that drivers state for enabling and disabling: the host waits for as long.
pub fn check_times(machine: &Machine, drivers: &Roster) -> Result<(), HostError> {
    for driver in drivers.all() {
        let described = driver.description;
        for (key, seconds) in [
            ("enable_s", described.enable_s),
            ("disable_s", described.disable_s),
        ] {
            if !(seconds > 0.0 && seconds <= MAX_ENABLE_S) {
                let cause = format!(
                    "driver {} says that its {key} is {seconds} s; it is to be more than 0 and at most {MAX_ENABLE_S} s",
                    driver.title
                );
                return Err(refusal(
                    machine,
                    &format!("{}.plugin", driver.section),
                    cause,
                ));
            }
        }
    }
    Ok(())
}

/// Real drives live in real time.
pub fn refuse_virtual(machine: &Machine, real: &Entry) -> HostError {
    let cause = format!(
        "{} moves metal: it is refused on the virtual clock",
        real.title
    );
    refusal(machine, &format!("{}.plugin", real.section), cause)
}

/// Checks the clock that is asked for, and what real drives need on top.
pub fn check_real(
    machine: &Machine,
    joints: &JointSpace,
    drivers: &Roster,
    clock: Option<Clock>,
) -> Result<(), HostError> {
    let Some(real) = drivers.real() else {
        return Ok(());
    };
    if clock == Some(Clock::Virtual) {
        return Err(refuse_virtual(machine, real));
    }
    let watched = |driver: &Entry| {
        driver.description.simulated != 0 || driver.description.watches_following != 0
    };
    let each = (0..)
        .zip(&joints.joints)
        .map(|(i, joint)| (drivers.of_joint(i), joint));
    let mut unwatched = each
        .filter(|(driver, joint)| !watched(driver) && joint.max_following_error_mm.is_infinite());
    match unwatched.next() {
        Some((driver, joint)) => {
            let table = if machine.joints.is_empty() {
                "axes"
            } else {
                "joints"
            };
            let unit = if joint.rotary { "deg" } else { "mm" };
            let cause = format!(
                "real drives need max_following_error_{unit}: {} watches no following error by itself",
                driver.title
            );
            Err(refusal(
                machine,
                &format!("{table}.{}", joint.name.to_ascii_lowercase()),
                cause,
            ))
        }
        None => Ok(()),
    }
}

/// Checks what homing asks of the machine, and what the machine asks of homing: a controller that `stays` asks that of its
/// operator before it begins a job.
pub fn check_homing(
    machine: &Machine,
    joints: &JointSpace,
    switches: Switches,
    stays: bool,
) -> Result<(), HostError> {
    let refuse = |key: &str, cause: &str| Err(refusal(machine, key, cause));
    if switches.home.is_some() && machine.homing.is_empty() {
        return refuse(
            "homing",
            "no axis has a [homing.<axis>] table: there is nothing to home",
        );
    }
    if switches.home.is_some() && !joints.are_axes() && !machine.squares() {
        let (key, cause) = match machine.kinematics.plugin.as_str() {
            "identity" => (
                "joints",
                "--home is refused: a gantry squares itself by a switch at each of its joints, in tables such as [homing.y1] and \
                 [homing.y2] after their names",
            ),
            _ => (
                "kinematics.plugin",
                "--home is refused: each axis is homed by a drive of its own, so not with kinematics",
            ),
        };
        return refuse(key, cause);
    }
    if machine.require_homing && switches.home.is_none() && !machine.homing.is_empty() && !stays {
        return refuse(
            "machine.require_homing",
            "the axes of this machine are to be homed first: run with --home",
        );
    }
    Ok(())
}

/// Checks that trace and report have room for all signals, and that each has its own name.
pub fn check_signals(machine: &Machine, of_strategy: &[&str]) -> Result<(), HostError> {
    let analog = if machine.has("analog") {
        "analog"
    } else {
        "driver.analog"
    };
    let count = of_strategy.len() + machine.analog.len();
    if count > MAX_SIGNALS {
        let cause = format!(
            "{count} signals with those of the feed strategy: a trace has room for {MAX_SIGNALS}"
        );
        return Err(refusal(machine, analog, cause));
    }
    match machine
        .analog
        .iter()
        .map(Analog::signal)
        .find(|name| of_strategy.contains(&name.as_str()))
    {
        Some(name) => Err(refusal(
            machine,
            analog,
            format!("{name}: the feed strategy has a signal of this name"),
        )),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use tandem_sdk::DriverDescription;

    use super::*;

    #[test]
    fn an_order_that_is_none_is_refused() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../../examples/machines/mill-3axis.toml");
        let machine = Machine::read(&path, &[]).unwrap();
        for (order, known) in [
            (0, false),
            (1, false),
            (2, true),
            (3, true),
            (4, false),
            (250, false),
        ] {
            let planner = PlannerDescription {
                order,
                ..PlannerDescription::order_2()
            };
            let words = check(
                &machine,
                &planner,
                &Roster::of_one(DriverDescription::simulated()),
            )
            .err()
            .map(|e| e.to_string());
            let told = words.is_some_and(|words| {
                words.contains(&format!("plans of order {order}: 2 and 3 are known"))
            });
            assert_eq!(told, !known, "{order}");
        }
    }

    #[test]
    fn a_time_that_nobody_can_wait_for_is_refused_with_its_key() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../../examples/machines/mill-3axis.toml");
        let machine = Machine::read(&path, &[]).unwrap();
        let words = |description| {
            check_times(&machine, &Roster::of_one(description))
                .err()
                .map(|e| e.to_string())
        };
        for described in [DriverDescription::simulated(), DriverDescription::real()] {
            assert_eq!(words(described), None);
            for most in [f64::MIN_POSITIVE, MAX_ENABLE_S] {
                assert_eq!(
                    words(DriverDescription {
                        enable_s: most,
                        disable_s: most,
                        ..described
                    }),
                    None
                );
            }
            for absurd in [
                f64::INFINITY,
                f64::NAN,
                -1.0,
                0.0,
                -0.0,
                600.1,
                1e300,
                f64::NEG_INFINITY,
            ] {
                for (key, description) in [
                    (
                        "enable_s",
                        DriverDescription {
                            enable_s: absurd,
                            ..described
                        },
                    ),
                    (
                        "disable_s",
                        DriverDescription {
                            disable_s: absurd,
                            ..described
                        },
                    ),
                ] {
                    let told = words(description).unwrap_or_default();
                    assert!(
                        told.contains("driver.plugin: driver driver says that its"),
                        "{absurd}: {told}"
                    );
                    assert!(
                        told.contains(&format!("{key} is {absurd} s")),
                        "{absurd}: {told}"
                    );
                }
            }
        }
    }

    /// A planner that breaks limits, such as the published feed of `nurbs`, runs on simulated drives that count only.
    #[test]
    fn a_planner_that_breaks_limits_moves_no_metal() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../../examples/machines/mill-3axis.toml");
        let planner = PlannerDescription {
            breaks_limits: 1,
            ..PlannerDescription::order_2()
        };
        for (guard, driver, runs) in [
            ("count", DriverDescription::simulated(), true),
            ("stop", DriverDescription::simulated(), false),
            ("count", DriverDescription::real(), false),
            ("stop", DriverDescription::real(), false),
        ] {
            let set = ("guard.mode".to_string(), guard.to_string());
            let machine = Machine::read(&path, &[set]).unwrap();
            let answer = check(&machine, &planner, &Roster::of_one(driver));
            assert_eq!(
                answer.is_ok(),
                runs,
                "{guard} {driver:?}: {:?}",
                answer.err().map(|e| e.to_string())
            );
        }
    }
}
