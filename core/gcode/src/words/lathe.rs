//! G7 and G8: X as a diameter or a radius; and cuts at a constant speed of the surface (G96).

use tandem_sdk::{AxisVector, BlockKind};

use super::{Action, Group, Word, motion, spindle};
use crate::line::Line;
use crate::line_error::Checked;

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "G7",
        Group::LatheDiameter,
        "",
        "X words are diameters; I and R of arcs stay radii",
        Action::Act(|line| diameter(line, true)),
        "G7",
    ),
    Word::new(
        "G8",
        Group::LatheDiameter,
        "",
        "X words are radii",
        Action::Act(|line| diameter(line, false)),
        "G8",
    ),
];

/// Within one block of a cut the radius changes by no more than this ratio, and with it the speed of the spindle: 5 %, what
/// spindle drives keep to themselves.
const RADIUS_RATIO: f64 = 1.05;
/// Most blocks that a cut becomes.
const MAX_PARTS: f64 = 256.0;

fn diameter(line: &mut Line, on: bool) -> Checked<()> {
    line.state.modes.diameter = on;
    Ok(())
}

/// A straight line from where the last block ended to the programmed position, in parts in which the radius hardly
/// changes: the spindle turns as the larger radius of each asks, so that the surface never moves faster than it is to.
#[cold]
pub(crate) fn straight_at_surface_speed(line: &mut Line, kind: BlockKind) -> Checked<()> {
    let (start, end) = (line.state.path.last_end, line.state.path.block_end());
    let radii = [start, end].map(|at| spindle::radius_mm(line, &at));
    let slowest = line.state.spindle.radius_at_most_mm();
    let [from, to] = radii.map(|radius| radius.max(slowest).max(f64::MIN_POSITIVE));
    let ratio = (from / to).max(to / from);
    let parts = if kind == BlockKind::Line && slowest > 0.0 {
        (ratio.ln() / RADIUS_RATIO.ln()).ceil()
    } else {
        1.0
    };
    let parts = parts.clamp(1.0, MAX_PARTS) as u32;
    let target = line.state.path.position;
    let mut inner = radii[0];
    for part in 1..=parts {
        // Equal ratios of the radius: where it shrinks, the parts become shorter.
        let radius = from * (to / from).powf(f64::from(part) / f64::from(parts));
        let share = if part == parts {
            1.0
        } else {
            ((radius - radii[0]) / (radii[1] - radii[0])).clamp(0.0, 1.0)
        };
        let at: AxisVector = start + (end - start) * share;
        let outer = spindle::radius_mm(line, &at);
        spindle::follow_radius(line, outer.max(inner));
        inner = outer;
        line.state.path.position = if part == parts { target } else { at };
        motion::line_to(line, kind)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::testing::{assert_items, blocks, ends, messages, run, short, shown};

    #[test]
    fn x_is_a_diameter_where_it_is_said() {
        assert_eq!(
            ends("G7 G0 X10\nG91 X4\nG8 X4\nG90 G0 X1"),
            [
                ["5", "0", "0"],
                ["7", "0", "0"],
                ["11", "0", "0"],
                ["1", "0", "0"]
            ]
        );
        // Parameters, I, J and K are radii.
        assert_eq!(ends("G7 G0 X10\nG0 Y#5420 Z#<_x>")[1], ["5", "5", "5"]);
        let arc = blocks("F60 G18 G7 G0 X10\nG2 X20 Z5 I5");
        assert_eq!(
            (arc[1].end[0], arc[1].arc.center_mm.map(short)),
            (10.0, ["0".into(), "10".into()])
        );
        assert_eq!(
            ends("G7 G0 X10\nG92 X20\nG0 X10\nG10 L2 P1 X4"),
            [["5", "0", "0"], ["0", "0", "0"]]
        );
    }

    #[test]
    fn the_spindle_follows_the_radius_and_never_turns_the_surface_faster() {
        // 100 m/min at a radius of 50 mm is 33.333 rad/s.
        assert_items(
            "G0 X50\nG96 S100 M3\nG0 X25\nG97 S60\nM5",
            &[
                "1: Rapid 0 to 50 0 0 0",
                "2: Dwell 1 to 50 0 0 0 for 0",
                "2: Spindle 0 33.333 before 2",
                "3: Rapid 2 to 25 0 0 0",
                "4: Spindle 0 6.283 before 3",
                "5: Dwell 3 to 25 0 0 0 for 0",
                "5: Spindle 0 0 before 4",
                "End",
            ],
        );
        let facing = run("G0 X50\nG96 S100 D1000 M3\nG95 F0.2 G1 X0\nM5");
        let all = blocks("G0 X50\nG96 S100 D1000 M3\nG95 F0.2 G1 X0\nM5");
        let cut: Vec<_> = all.iter().filter(|b| b.line == 3).collect();
        assert!(cut.len() > 20, "{}", cut.len());
        for block in &cut {
            let speed = block.spindle_rad_per_s;
            assert!(
                speed * block.start[0] <= 100_000.0 / 60.0 + 1e-6
                    && speed <= 1000.0 * std::f64::consts::PI / 30.0 + 1e-9
            );
            assert!(
                speed * block.start[0] > 0.9 * 100_000.0 / 60.0 || block.start[0] < 17.0,
                "{block:?}"
            );
            assert!((block.feed_mm_per_s - 0.2 * speed / std::f64::consts::TAU).abs() < 1e-9);
        }
        assert_eq!(cut.last().unwrap().end[0], 0.0);
        assert!(
            shown(&facing)
                .iter()
                .filter(|item| item.starts_with("3: Spindle"))
                .count()
                > 20
        );
    }

    #[test]
    fn what_lathe_words_need_is_said() {
        assert!(messages("G96 D100")[0].starts_with("1:1 [word-missing] G96 needs S"));
        assert!(messages("G95 F1 G1 X1")[0].contains("the spindle has no speed"));
        assert!(messages("S1 M3 G95 F1 G1 X1\nG94\nX2")[0].starts_with("3:1 [feed-missing]"));
    }
}
