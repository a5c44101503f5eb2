//! A walk along the path that keeps up with the samples.
//!
//! Each sample is given a place within tolerance of it, and places never go back. Always taking the first such place
//! decides whether any assignment exists: whoever is further along has fewer places left to choose from. So a path
//! that turns back on itself or crosses itself fools nobody. A walk may not jump: what it leaves behind between two
//! samples has to lie beside the chord that joins them.

use crate::{
    Options, Position,
    geometry::{distance, distance_to_chord},
    path::{Element, PathPosition},
    places,
};

/// After a sample off the path, the path is searched this many times as far as the samples have moved since.
const SEARCH_AHEAD: f64 = 4.0;
/// The samples move on by this factor between two such searches, to keep the effort linear.
const SEARCH_AGAIN: f64 = 1.1;

/// Places whose distances from a sample differ by less are equally near, mm.
const ROUNDED_MM: f64 = 1e-9;

/// A path, and how far from it samples may lie.
pub struct Walker<'a> {
    elements: &'a [Element],
    sample_tolerance_mm: Option<f64>,
    /// Tolerances are cut down to this, to find the smallest with which the walk succeeds.
    cap_mm: f64,
    reach_mm: f64,
}

/// A walk that went on past samples off the path.
pub struct Walk {
    /// One place for each sample.
    pub places: Vec<PathPosition>,
    /// Samples off the path, with their distance from it.
    pub misses: Vec<(usize, f64)>,
}

impl<'a> Walker<'a> {
    pub fn new(elements: &'a [Element], options: &Options) -> Self {
        let widest = widest(elements);
        let sample_mm = options.sample_tolerance_mm.unwrap_or(widest);
        let vertex_mm = options.vertex_tolerance_mm.unwrap_or(widest);
        Self {
            elements,
            sample_tolerance_mm: options.sample_tolerance_mm,
            cap_mm: f64::INFINITY,
            reach_mm: vertex_mm + 3.0 * sample_mm,
        }
    }

    /// The same walker with no tolerance above a cap.
    pub fn capped(&self, cap_mm: f64) -> Self {
        Self { cap_mm, ..*self }
    }

    /// The widest tolerance of any sample.
    pub fn widest_mm(&self) -> f64 {
        self.sample_tolerance_mm
            .unwrap_or_else(|| widest(self.elements))
            .min(self.cap_mm)
    }

    /// The first places of all samples, if each has one.
    pub fn strict(
        &self,
        from: PathPosition,
        samples: impl Iterator<Item = Position>,
    ) -> Option<Vec<PathPosition>> {
        let mut places = Vec::with_capacity(samples.size_hint().0);
        let (mut place, mut previous) = (from, None);
        for sample in samples {
            place = self
                .next(place, &previous.unwrap_or(sample), &sample)
                .ok()?;
            previous = Some(sample);
            places.push(place);
        }
        Some(places)
    }

    /// A place of every sample, if there are any at all: not always the first ones, which may lead nowhere.
    pub fn any(&self, samples: &[Position]) -> Option<Vec<PathPosition>> {
        Some(
            self.known(samples)?
                .nearest(self.elements, samples, self.reach_mm),
        )
    }

    /// Between which places each sample may be then.
    pub fn any_ranges(&self, samples: &[Position]) -> Option<Vec<(PathPosition, PathPosition)>> {
        Some(
            self.known(samples)?
                .ranges(self.elements, samples, self.reach_mm),
        )
    }

    fn known(&self, samples: &[Position]) -> Option<places::Known> {
        places::find(
            self.elements,
            samples,
            |element| self.tolerance_mm(element),
            self.reach_mm,
        )
    }

    /// The first places of all samples; where a sample has none, the walk waits until the samples come back.
    pub fn recovering(&self, samples: &[Position]) -> Walk {
        let mut walk = Walk {
            places: Vec::with_capacity(samples.len()),
            misses: Vec::new(),
        };
        let mut place = PathPosition::default();
        let (mut astray_mm, mut search_at_mm) = (0.0, f64::INFINITY);
        for (index, sample) in samples.iter().enumerate() {
            let previous = &samples[index.saturating_sub(1)];
            astray_mm += distance(previous, sample);
            let mut next = self.next(place, previous, sample);
            if next.is_err() && astray_mm >= search_at_mm {
                search_at_mm = SEARCH_AGAIN * astray_mm;
                next = next.or_else(|off_mm| self.ahead(place, astray_mm, sample).ok_or(off_mm));
            }
            match next {
                Ok(found) => (place, astray_mm, search_at_mm) = (found, 0.0, f64::INFINITY),
                Err(off_mm) => {
                    walk.misses.push((index, off_mm));
                    if search_at_mm.is_infinite() {
                        search_at_mm = astray_mm;
                    }
                }
            }
            walk.places.push(place);
        }
        walk
    }

    /// Where the walk ends: the end of the path if the last sample has reached it, else the place nearest to it; the first of those
    /// that rounding tells apart, where the path comes by again.
    pub fn end(&self, from: PathPosition, sample: &Position) -> PathPosition {
        let (mut best, mut best_mm, mut low) = (from, f64::INFINITY, from.fraction);
        for (index, element) in self.elements.iter().enumerate().skip(from.element) {
            let nearer_mm = best_mm - ROUNDED_MM;
            if let Some((fraction, off_mm)) = element.shape.nearer(sample, (low, 1.0), nearer_mm) {
                (best, best_mm) = (
                    PathPosition {
                        element: index,
                        fraction,
                    },
                    off_mm,
                );
            }
            let to_vertex_mm = distance(&element.shape.at(1.0), sample);
            if to_vertex_mm > self.reach_mm {
                return best;
            }
            if index + 1 == self.elements.len() && to_vertex_mm <= self.tolerance_mm(element) {
                return PathPosition {
                    element: index,
                    fraction: 1.0,
                };
            }
            low = 0.0;
        }
        best
    }

    /// Whether a place is the end of the path.
    pub fn is_at_end(&self, place: PathPosition) -> bool {
        place.element + 1 == self.elements.len() && place.fraction >= 1.0
    }

    /// Whether a sample lies where the path ends.
    pub fn may_end_at(&self, sample: &Position) -> bool {
        self.elements.last().is_some_and(|element| {
            distance(&element.shape.at(1.0), sample) <= self.tolerance_mm(element)
        })
    }

    fn tolerance_mm(&self, element: &Element) -> f64 {
        self.sample_tolerance_mm
            .unwrap_or(element.tolerance_mm)
            .min(self.cap_mm)
    }

    fn next(
        &self,
        from: PathPosition,
        previous: &Position,
        sample: &Position,
    ) -> Result<PathPosition, f64> {
        self.search(from, sample, |vertex| {
            distance_to_chord(vertex, previous, sample) <= self.reach_mm
        })
    }

    fn ahead(&self, from: PathPosition, astray_mm: f64, sample: &Position) -> Option<PathPosition> {
        let mut left_mm = SEARCH_AHEAD * astray_mm + self.reach_mm;
        let mut before = self.elements[from.element].shape.at(from.fraction);
        let go_on = |vertex: &Position| {
            left_mm -= distance(&before, vertex);
            before = *vertex;
            left_mm > 0.0
        };
        self.search(from, sample, go_on).ok()
    }

    /// The first place from `from` on that is within tolerance of a sample, or the distance to what was searched.
    fn search(
        &self,
        from: PathPosition,
        sample: &Position,
        mut may_pass: impl FnMut(&Position) -> bool,
    ) -> Result<PathPosition, f64> {
        let (mut nearest_mm, mut low) = (f64::INFINITY, from.fraction);
        for (index, element) in self.elements.iter().enumerate().skip(from.element) {
            if let Some(fraction) =
                element
                    .shape
                    .first_within(sample, self.tolerance_mm(element), low)
            {
                return Ok(PathPosition {
                    element: index,
                    fraction,
                });
            }
            nearest_mm = element
                .shape
                .nearer(sample, (low, 1.0), nearest_mm)
                .map_or(nearest_mm, |(_, off_mm)| off_mm);
            if !may_pass(&element.shape.at(1.0)) {
                break;
            }
            low = 0.0;
        }
        Err(nearest_mm)
    }
}

fn widest(elements: &[Element]) -> f64 {
    elements
        .iter()
        .map(|element| element.tolerance_mm)
        .fold(0.0, f64::max)
}
