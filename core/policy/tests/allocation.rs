//! Calls of a script leave the heap alone.

#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

use counting_allocator::{HeapUse, heap_use_of};
use tandem_policy::{Bounds, Budget, Engine, Facts, Period, Policy};
use tandem_sdk::{AxisVector, Block, BlockKind};

fn policy(name: &str) -> Policy {
    let path = format!(
        "{}/../../scripts/policies/{name}.wasm",
        env!("CARGO_MANIFEST_DIR")
    );
    let script = Engine::new()
        .unwrap()
        .compile(&std::fs::read(path).unwrap())
        .unwrap();
    let facts = Facts::default();
    Policy::new(script, vec![], Budget::default(), Bounds::default(), &facts).unwrap()
}

fn line(index: u32) -> Block {
    let at = |index: u32| AxisVector::from_slice(&[f64::from(index), f64::from(index % 2)]);
    let ends = Block {
        end: at(index + 1),
        ..Block::at(at(index))
    };
    Block {
        kind: BlockKind::Line,
        feed_mm_per_s: 50.0,
        length_mm: 1.4,
        ..ends
    }
}

#[test]
fn windows_and_periods_allocate_nothing_once_the_notes_are_spent() {
    let (mut corners, mut load) = (policy("corner-time-constant"), policy("load-feed"));
    let (mut plunge, mut contour) = (policy("gentle-plunge"), policy("keep-contour"));
    let mut round = |period: u64| {
        for index in 0..64 {
            corners.offer(&line(index), None);
            let mut down = line(index);
            down.end[2] = -1.0;
            plunge.offer(&down, None);
        }
        corners.decide(None);
        plunge.decide(None);
        assert!(plunge.tuning(1).feed_cap_mm_per_s.is_some());
        assert!(corners.tuning(1).time_constant_s.is_some());
        let torque = Period {
            period,
            duration_s: 0.008,
            cutting_torque_nm: 1.0 + 0.5 * (period % 3) as f64,
            reference_torque_nm: 1.0,
            ..Period::default()
        };
        assert!(load.period(&torque).is_some());
        assert!(contour.period(&torque).is_some());
    };
    // The first notes are made at once, later ones a second apart.
    (0..30).for_each(&mut round);
    assert_eq!(
        heap_use_of(|| (30..90).for_each(&mut round)),
        HeapUse::default()
    );
}
