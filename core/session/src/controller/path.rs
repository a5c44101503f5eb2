//! The programmed path, and where the machine was, for those who draw it.

use std::collections::VecDeque;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use tandem_recorder::polyline;
use tandem_sdk::{Axes, AxisVector, Block, BlockKind, Curve, MAX_AXES};

/// Points that are kept of a path at most; of a longer program the pieces behind them are counted only, of lines by hand the
/// oldest pieces go.
const MAX_POINTS: usize = 400_000;
/// Rough periods of motion of which the place is kept.
const MAX_DRIVEN: usize = 50_000;
/// Numbers in one answer at most, so that it fits what may wait for a client.
const MAX_NUMBERS: usize = 4000;
/// The same of a packed answer, bytes before they are written as text.
const MAX_PACKED_BYTES: usize = 48 * 1024;
/// How far the points may stand off the path, mm: less than a screen shows.
const CHORD_ERROR_MM: f64 = 0.005;

/// A block, as it is drawn.
struct Piece {
    block: u64,
    line: u32,
    rapid: bool,
    /// Where it starts, if not where the piece before ends.
    from: Option<AxisVector>,
    points: Vec<AxisVector>,
    /// Number of its first point, the start among them where it has one.
    first_point: u64,
}

impl Piece {
    /// Its points with what each is in a packed answer: the end of a line that is driven at feed (0) or as a rapid (1), or a place
    /// to which no line leads (2).
    fn kinds(&self) -> impl Iterator<Item = (u8, &AxisVector)> {
        let kind = u8::from(self.rapid);
        let start = self.from.iter().map(|start| (2, start));
        start.chain(self.points.iter().map(move |point| (kind, point)))
    }
}

/// A path as it is planned, and as it is driven.
pub struct DrawnPath {
    axes: Axes,
    /// Changes where the pieces are those of another path.
    generation: u64,
    of: String,
    /// The oldest pieces go where there are too many; else the last ones are not kept.
    streams: bool,
    pieces: VecDeque<Piece>,
    /// Number of the first piece that is kept.
    first: u64,
    /// Pieces that were not kept.
    beyond: u64,
    points: usize,
    /// Points that there were, those that are not kept any more among them.
    all_points: u64,
    end: Option<AxisVector>,
    /// The box around what is driven at feed, and around the rest where nothing is.
    fed: Option<Extent>,
    rapid: Option<Extent>,
    driven: VecDeque<AxisVector>,
    first_driven: u64,
}

impl DrawnPath {
    /// Nothing yet.
    pub fn new(axes: Axes) -> Self {
        Self {
            axes,
            generation: 0,
            of: String::new(),
            streams: false,
            pieces: VecDeque::new(),
            first: 0,
            beyond: 0,
            points: 0,
            all_points: 0,
            end: None,
            fed: None,
            rapid: None,
            driven: VecDeque::new(),
            first_driven: 0,
        }
    }

    /// Another path begins, that of `of`: of one that `streams` nobody knows how long it becomes.
    pub fn begin(&mut self, of: &str, streams: bool) {
        let axes = self.axes;
        let generation = self.generation + 1;
        *self = Self {
            generation,
            of: of.to_string(),
            streams,
            ..Self::new(axes)
        };
    }

    /// The path is `other` from now on, that of `of`.
    pub fn become_that_of(&mut self, other: Self, of: &str) {
        let generation = self.generation + 1;
        *self = Self {
            generation,
            of: of.to_string(),
            ..other
        };
    }

    /// The next block of it. Allocates.
    pub fn block(&mut self, block: &Block, curve: Option<Curve<'_>>) {
        let points = polyline(&self.axes, block, curve, CHORD_ERROR_MM);
        if points.is_empty() {
            return;
        }
        if self.points + points.len() > MAX_POINTS && !self.streams {
            self.beyond += 1;
            return;
        }
        self.points += points.len();
        let from = (self.end != Some(block.start)).then_some(block.start);
        self.end = Some(block.end);
        let rapid = block.kind == BlockKind::Rapid;
        let extent = if rapid {
            &mut self.rapid
        } else {
            &mut self.fed
        };
        for point in [&block.start].into_iter().chain(&points) {
            *extent = Some(Extent::with(*extent, point));
        }
        let first_point = self.all_points;
        self.all_points += points.len() as u64 + u64::from(from.is_some());
        self.pieces.push_back(Piece {
            block: block.index,
            line: block.line,
            rapid,
            from,
            points,
            first_point,
        });
        while self.points > MAX_POINTS {
            let Some(piece) = self.pieces.pop_front() else {
                return;
            };
            self.points -= piece.points.len();
            self.first += 1;
        }
    }

    /// The machine is at `position`; places that are the last one again are left out.
    pub fn drive(&mut self, position: &AxisVector) {
        if self.driven.back() == Some(position) {
            return;
        }
        self.driven.push_back(*position);
        if self.driven.len() > MAX_DRIVEN {
            self.driven.pop_front();
            self.first_driven += 1;
        }
    }

    /// Pieces and places from these numbers on, as many as one answer holds. Allocates.
    pub fn show(&self, from: u64, driven_from: u64) -> Value {
        let axes = self.axes.count();
        let mut numbers = 0;
        let from = from.max(self.first);
        let mut pieces = vec![];
        for piece in self.pieces.iter().skip((from - self.first) as usize) {
            let is_first = pieces.is_empty();
            numbers += (piece.points.len() + 1) * axes;
            if numbers > MAX_NUMBERS && !is_first {
                break;
            }
            let points: Vec<_> = piece.points.iter().map(|p| self.point(p)).collect();
            let mut shown = json!({ "block": piece.block, "line": piece.line, "points": points });
            if piece.rapid {
                shown["rapid"] = json!(true);
            }
            if let Some(start) = &piece.from {
                shown["from"] = self.point(start);
            }
            pieces.push(shown);
        }
        let driven_from = driven_from.max(self.first_driven);
        let room = (MAX_NUMBERS.saturating_sub(numbers) / axes).max(200);
        let places = self.driven.iter();
        let places: Vec<_> = places
            .skip((driven_from - self.first_driven) as usize)
            .take(room)
            .map(|p| self.point(p))
            .collect();
        json!({
            "generation": self.generation,
            "of": self.of,
            "axes": self.names(),
            "from": from,
            "pieces": pieces,
            "count": self.first + self.pieces.len() as u64,
            "beyond": self.beyond,
            "driven_from": driven_from,
            "driven": places,
            "driven_count": self.first_driven + self.driven.len() as u64,
        })
    }

    /// Points and places from these numbers on as packed numbers, as many as one answer holds: a path of hundreds of thousands of
    /// points is there in a second. Allocates.
    pub fn show_packed(&self, from: u64, driven_from: u64) -> Value {
        let axes = self.axes.count();
        let oldest = self
            .pieces
            .front()
            .map_or(self.all_points, |piece| piece.first_point);
        let from = from.clamp(oldest, self.all_points);
        let at = self
            .pieces
            .partition_point(|piece| piece.first_point <= from)
            .saturating_sub(1);
        let skipped = self
            .pieces
            .get(at)
            .map_or(0, |piece| from - piece.first_point);
        let room = MAX_PACKED_BYTES / (4 * axes + 1);
        let (mut kinds, mut points) = (vec![], vec![]);
        let all = self.pieces.iter().skip(at).flat_map(Piece::kinds);
        for (kind, point) in all.skip(skipped as usize).take(room) {
            kinds.push(kind);
            self.pack(point, &mut points);
        }
        let driven_from = driven_from.max(self.first_driven);
        let mut driven = vec![];
        let places = self
            .driven
            .iter()
            .skip((driven_from - self.first_driven) as usize);
        for place in places.take((room - kinds.len()).max(room / 8)) {
            self.pack(place, &mut driven);
        }
        let extent = self.fed.or(self.rapid);
        let corner = |of: Option<AxisVector>| of.map(|of| self.point(&of));
        json!({
            "generation": self.generation,
            "of": self.of,
            "axes": self.names(),
            "from": from,
            "points": STANDARD.encode(&points),
            "kinds": STANDARD.encode(&kinds),
            "count": self.all_points,
            "low": corner(extent.map(|of| of.low)),
            "high": corner(extent.map(|of| of.high)),
            "beyond": self.beyond,
            "driven_from": driven_from,
            "driven": STANDARD.encode(&driven),
            "driven_count": self.first_driven + self.driven.len() as u64,
        })
    }

    /// Adds the coordinates, mm and deg, in single precision, which is finer than any screen.
    fn pack(&self, position: &AxisVector, bytes: &mut Vec<u8>) {
        for axis in 0..self.axes.count() {
            bytes.extend_from_slice(&(self.coordinate(position, axis) as f32).to_le_bytes());
        }
    }

    /// What a status says of it.
    pub fn brief(&self) -> Value {
        json!({
            "generation": self.generation,
            "count": self.first + self.pieces.len() as u64,
            "points": self.all_points,
            "driven_count": self.first_driven + self.driven.len() as u64,
        })
    }

    fn names(&self) -> Vec<String> {
        let name = |axis: usize| {
            let unit = if self.axes.is_rotary(axis) {
                "deg"
            } else {
                "mm"
            };
            format!("{}_{unit}", self.axes.letter(axis).to_ascii_lowercase())
        };
        (0..self.axes.count()).map(name).collect()
    }

    /// Coordinates in the order of the axes, to a tenth of a micrometre: for drawing.
    fn point(&self, position: &AxisVector) -> Value {
        let shown = |axis: usize| (self.coordinate(position, axis) * 1e4).round() / 1e4;
        json!((0..self.axes.count()).map(shown).collect::<Vec<_>>())
    }

    /// mm or deg.
    fn coordinate(&self, position: &AxisVector, axis: usize) -> f64 {
        if self.axes.is_rotary(axis) {
            position[axis].to_degrees()
        } else {
            position[axis]
        }
    }
}

/// A box along the axes.
#[derive(Clone, Copy)]
struct Extent {
    low: AxisVector,
    high: AxisVector,
}

impl Extent {
    fn with(of: Option<Self>, point: &AxisVector) -> Self {
        let mut extent = of.unwrap_or(Self {
            low: *point,
            high: *point,
        });
        for axis in 0..MAX_AXES {
            extent.low[axis] = extent.low[axis].min(point[axis]);
            extent.high[axis] = extent.high[axis].max(point[axis]);
        }
        extent
    }
}
