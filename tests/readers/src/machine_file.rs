//! Any bytes as a machine file: what is refused is refused with its place, and what is read makes sense and is written so
//! that it reads the same.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use tandem_machine::Machine;

/// A folder of this process, in memory where there is such a place.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let memory = Path::new("/dev/shm");
    let base = if memory.is_dir() {
        memory.to_owned()
    } else {
        std::env::temp_dir()
    };
    let folder = base.join(format!("tandem-fuzz-machine-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
});

fn assert_sound(machine: &Machine) {
    let positive = |value: f64| value > 0.0 && value.is_finite();
    assert!(
        positive(machine.fine_period_s)
            && positive(machine.rough_period_s)
            && machine.fine_periods_per_rough >= 1
    );
    let rough_s = machine.fine_period_s * f64::from(machine.fine_periods_per_rough);
    assert!(
        (machine.rough_period_s / rough_s - 1.0).abs() < 1e-9,
        "{} {rough_s}",
        machine.rough_period_s
    );
    for (axis, limits) in machine.limits.axes().iter().enumerate() {
        assert!(
            positive(limits.feed_mm_per_s) && positive(limits.rapid_mm_per_s),
            "{limits:?}"
        );
        assert!(
            positive(limits.acceleration_mm_per_s2) && limits.jerk_mm_per_s3 > 0.0,
            "{limits:?}"
        );
        assert!(
            limits.speed_difference_mm_per_s >= 0.0 && limits.min_mm < limits.max_mm,
            "{limits:?}"
        );
        for place in [machine.start[axis], machine.home[axis]] {
            assert!(
                (limits.min_mm..=limits.max_mm).contains(&place),
                "{place}: {limits:?}"
            );
        }
    }
}

/// Judges one input.
///
/// # Panics
/// The reader broke what it promises.
pub fn judge(bytes: &[u8]) {
    let path = FOLDER.join("machine.toml");
    std::fs::write(&path, bytes).expect("a file");
    match Machine::read(&path, &[]) {
        Ok(machine) => {
            assert_sound(&machine);
            std::fs::write(&path, machine.effective_toml()).expect("a file");
            let again = Machine::read(&path, &[])
                .unwrap_or_else(|e| panic!("{e}\n{}", machine.effective_toml()));
            assert_eq!(again.effective_toml(), machine.effective_toml());
        }
        Err(error) => {
            assert!(!error.problems.is_empty());
            assert!(
                error
                    .problems
                    .iter()
                    .all(|problem| !problem.to_string().contains('\n')),
                "{error}"
            );
        }
    }
}
