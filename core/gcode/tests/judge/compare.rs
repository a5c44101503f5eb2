//! What this interpreter says of a program, in the form in which the judge says it.

use std::path::{Path, PathBuf};

use tandem_gcode::{Config, Item, ProbeResult, Program, Stream, check};
use tandem_sdk::BlockKind;

/// What both say of a program, in machine coordinates of X Y Z, mm.
#[derive(Clone, Debug, PartialEq)]
pub enum Move {
    /// Its end.
    Rapid([f64; 3]),
    /// Its end.
    Line([f64; 3]),
    /// End, the distance of the centre from it in the two axes of the plane, and how far the centre moves where an interpreter
    /// makes the radii at both ends equal.
    Arc([f64; 3], [f64; 2], f64),
    /// Seconds.
    Dwell(f64),
}

/// Half a unit of the last decimal that the judge prints, in inches, with the sum of some offsets.
const SAME_MM: f64 = 0.02;

impl Move {
    pub fn end(&self) -> Option<[f64; 3]> {
        match self {
            Self::Rapid(end) | Self::Line(end) | Self::Arc(end, ..) => Some(*end),
            Self::Dwell(_) => None,
        }
    }

    pub fn is_like(&self, other: &Self) -> bool {
        let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < SAME_MM);
        match (self, other) {
            (Self::Rapid(a), Self::Rapid(b)) | (Self::Line(a), Self::Line(b)) => near(a, b),
            (Self::Arc(a, c, unlike), Self::Arc(b, d, other)) => {
                let apart = (c[0] - d[0]).hypot(c[1] - d[1]);
                near(a, b) && apart < SAME_MM + unlike.max(*other)
            }
            (Self::Dwell(a), Self::Dwell(b)) => (a - b).abs() < 1e-3,
            _ => false,
        }
    }
}

/// Leaves out moves that go nowhere.
pub fn moving(moves: Vec<Move>) -> Vec<Move> {
    let mut at = [0.0; 3];
    let mut kept = Vec::new();
    for step in moves {
        let still = match &step {
            Move::Rapid(end) | Move::Line(end) => {
                end.iter().zip(&at).all(|(a, b)| (a - b).abs() < SAME_MM)
            }
            Move::Arc(..) => false,
            Move::Dwell(seconds) => *seconds == 0.0,
        };
        at = step.end().unwrap_or(at);
        if !still {
            kept.push(step);
        }
    }
    kept
}

/// What this interpreter says of a program.
pub struct Driven {
    pub moves: Vec<Move>,
    /// Everything is in `moves`: no probe or input was met, whose answers the two do not share, and no curve, which the judge
    /// prints as something else.
    pub whole: bool,
}

/// What this interpreter says; the first message where it refuses.
pub fn ours(path: &Path, config: &Config) -> Result<Driven, String> {
    let mut program = Program::open(path).map_err(|e| e.to_string())?;
    let report = check(&mut program, config, &mut |_, _| Ok(())).map_err(|e| e.to_string())?;
    if let Some(first) = report.diagnostics.first() {
        return Err(first.to_string());
    }
    let mut stream = Stream::new(program, config).map_err(|e| e.to_string())?;
    let (mut items, mut moves) = (Vec::new(), Vec::new());
    while stream.next_items(&mut items).map_err(|e| e.to_string())? {
        for item in items.drain(..) {
            match item {
                Item::Block(block, _) if item_is_probe(&block) => {
                    stream.provide_probe(&ProbeResult {
                        touched: Some(block.end),
                        rest: block.end,
                    });
                    return Ok(Driven {
                        moves: moving(moves),
                        whole: false,
                    });
                }
                Item::Wait(_) | Item::Command(_) | Item::Block(_, Some(_)) => {
                    return Ok(Driven {
                        moves: moving(moves),
                        whole: false,
                    });
                }
                Item::Block(block, None) => moves.push(step(&block)),
                Item::Event(_) | Item::Stated { .. } | Item::End => {}
            }
        }
    }
    assert_eq!(
        moves.len() as u64,
        report.blocks,
        "both passes make the same blocks"
    );
    Ok(Driven {
        moves: moving(moves),
        whole: true,
    })
}

fn item_is_probe(block: &tandem_sdk::Block) -> bool {
    Item::Block(*block, None).is_probe()
}

fn step(block: &tandem_sdk::Block) -> Move {
    let end = [block.end[0], block.end[1], block.end[2]];
    match block.kind {
        BlockKind::Rapid => Move::Rapid(end),
        BlockKind::Dwell => Move::Dwell(block.dwell_s),
        BlockKind::Arc => {
            let [a, b] = block.arc.plane.map(|axis| axis as usize);
            Move::Arc(
                end,
                [
                    block.arc.center_mm[0] - end[a],
                    block.arc.center_mm[1] - end[b],
                ],
                0.0,
            )
        }
        _ => Move::Line(end),
    }
}

/// The first move in which the two part, in words; `None` where they say the same as far as it can be compared.
pub fn parting(mine: &Driven, theirs: &[Move]) -> Option<String> {
    let same = mine
        .moves
        .iter()
        .zip(theirs)
        .take_while(|(a, b)| a.is_like(b))
        .count();
    let all = same == mine.moves.len() && (same == theirs.len() || !mine.whole);
    (!all).then(|| {
        format!(
            "move {same}: here {:?}, judge {:?}",
            mine.moves.get(same),
            theirs.get(same)
        )
    })
}

/// The judge: named by `RS274`, on the path, or where `tests/judge/install` has put it.
pub fn judge() -> Option<PathBuf> {
    if let Some(path) = std::env::var_os("RS274") {
        return Some(path.into());
    }
    let installed = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/rs274");
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path)
        .chain([installed])
        .map(|folder| folder.join("rs274"))
        .find(|file| file.is_file())
}
