//! Whether the samples meet every programmed vertex.

use crate::{
    Options, Position,
    follow::{self, Followed},
    geometry::{distance, distance_to_chord},
    path::{Element, PathPosition, Shape},
};

/// Chords searched on each side of a vertex; only samples astray or all but at rest come in greater numbers.
const SEARCHED_CHORDS: usize = 1000;

/// A vertex and how far the samples stay away from it.
pub struct Vertex {
    /// Program line of the block that ends there.
    pub line: u32,
    /// The sample before it.
    pub sample: usize,
    /// Distance from the chords between samples, or from the samples where motion has to stop, mm.
    pub off_mm: f64,
    /// What is allowed, mm.
    pub limit_mm: f64,
    /// Motion has to stop there.
    pub exact_stop: bool,
}

/// Samples laid along a path, with lengths from its start.
struct Laid<'a> {
    followed: &'a Followed,
    elements: &'a [Element],
    lengths_mm: Vec<f64>,
    links_mm: Vec<f64>,
}

/// Every vertex up to where the samples end, the corners and the places where an arc is cut into pieces.
pub fn vertices(elements: &[Element], followed: &Followed, options: &Options) -> Vec<Vertex> {
    let laid = Laid::new(elements, followed);
    let (mut link, mut ranges) = (0, None);
    // Samples far off the path belong to no vertex; they must not widen the search either.
    let deviation_mm = if followed.misses.is_empty() {
        followed.deviation_mm
    } else {
        0.0
    };
    // A run that ended early may have come to rest just short of the end of its last piece.
    let last = elements.len().min(followed.end.element + 1) - 1;
    let passed = |index: usize| index < last || !options.ends_early || !elements[index].exact_stop;
    let reached = elements
        .iter()
        .enumerate()
        .take_while(|&(index, _)| end_of(index) <= followed.end && passed(index));
    let vertices = reached.filter_map(|(index, element)| {
        while link + 1 < followed.places.len() && followed.places[link + 1] <= end_of(index) {
            link += 1;
        }
        let limit_mm = limit_mm(elements, index, options);
        let mut off_mm = laid.distance_mm(index, link, 4.0 * (limit_mm + deviation_mm));
        if off_mm > limit_mm && followed.misses.is_empty() {
            let ranges = ranges.get_or_insert_with(|| {
                follow::ranges(elements, followed, options).unwrap_or_default()
            });
            // Where the path comes by again, a run that ended early may have ended the first time.
            if options.ends_early
                && ranges
                    .last()
                    .is_some_and(|(first, _)| *first < end_of(index))
            {
                return None;
            }
            off_mm = off_mm.min(laid.distance_of_all_mm(index, ranges));
        }
        let limit_mm = if off_mm > limit_mm {
            laid.limit_beside_corners_mm(index, options)
        } else {
            limit_mm
        };
        let (line, exact_stop) = (element.line, element.exact_stop);
        Some(Vertex {
            line,
            sample: followed.samples[link],
            off_mm,
            limit_mm,
            exact_stop,
        })
    });
    vertices.collect()
}

/// Length from the start of the path to the start of each element and to its end, mm.
pub fn lengths_mm(elements: &[Element]) -> Vec<f64> {
    let mut lengths_mm = vec![0.0];
    for element in elements {
        lengths_mm.push(lengths_mm[lengths_mm.len() - 1] + element.shape.length_mm());
    }
    lengths_mm
}

/// Length from the start of the path to a place, mm.
pub fn length_to_mm(lengths_mm: &[f64], place: PathPosition) -> f64 {
    let start_mm = lengths_mm[place.element];
    start_mm + place.fraction * (lengths_mm[place.element + 1] - start_mm)
}

/// Whether an element ends where its block is cut, and not at its end.
fn is_cut(elements: &[Element], index: usize) -> bool {
    let is_curved = |element: &Element| !matches!(element.shape, Shape::Line(_));
    let element = &elements[index];
    elements
        .get(index + 1)
        .is_some_and(|next| next.line == element.line && is_curved(element) && is_curved(next))
}

fn end_of(element: usize) -> PathPosition {
    PathPosition {
        element,
        fraction: 1.0,
    }
}

fn limit_mm(elements: &[Element], index: usize, options: &Options) -> f64 {
    if elements[index].exact_stop {
        return options.exact_stop_tolerance_mm;
    }
    let next = elements.get(index + 1).unwrap_or(&elements[index]);
    options
        .vertex_tolerance_mm
        .unwrap_or_else(|| elements[index].tolerance_mm.max(next.tolerance_mm))
}

impl<'a> Laid<'a> {
    fn new(elements: &'a [Element], followed: &'a Followed) -> Self {
        let lengths_mm = lengths_mm(elements);
        let links_mm = followed
            .places
            .iter()
            .map(|&place| length_to_mm(&lengths_mm, place))
            .collect();
        Self {
            followed,
            elements,
            lengths_mm,
            links_mm,
        }
    }

    /// Distance of a vertex from the chords that belong to the path around it; `link` is the last one before it.
    fn distance_mm(&self, vertex: usize, link: usize, span_mm: f64) -> f64 {
        let element = &self.elements[vertex];
        let point = element.shape.at(1.0);
        let at_mm = self.lengths_mm[vertex + 1];
        let chord = |from| self.chord_mm(from, &point, element.exact_stop);
        // Samples off the path wait where the walk lost them: all of these belong to the vertices around.
        let (last_mm, next_mm) = (
            self.links_mm[link],
            self.links_mm
                .get(link + 1)
                .map_or(at_mm, |&mm| mm.max(at_mm)),
        );
        let near_before = (0..=link)
            .rev()
            .take_while(|&from| from == link || last_mm - self.links_mm[from + 1] <= span_mm);
        let near_after = (link + 1..self.links_mm.len())
            .take_while(|&from| self.links_mm[from] - next_mm <= span_mm);
        let near = near_before
            .take(SEARCHED_CHORDS)
            .chain(near_after.take(SEARCHED_CHORDS));
        near.map(chord).fold(f64::INFINITY, f64::min)
    }

    /// The same from every chord that may belong to the vertex, by the places between which each link may be.
    fn distance_of_all_mm(&self, vertex: usize, ranges: &[(PathPosition, PathPosition)]) -> f64 {
        let element = &self.elements[vertex];
        let (point, end) = (element.shape.at(1.0), end_of(vertex));
        let first = ranges
            .partition_point(|(_, last)| *last < end)
            .saturating_sub(1);
        let behind = ranges.partition_point(|(first, _)| *first <= end);
        (first..behind)
            .map(|from| self.chord_mm(from, &point, element.exact_stop))
            .fold(f64::INFINITY, f64::min)
    }

    /// What is allowed where a block is cut: near one of its ends no less than is left of what is allowed there. Where the motion passes
    /// the corner to a block of a wider tolerance as far off as it may, it is as far off the last of the narrower one.
    fn limit_beside_corners_mm(&self, vertex: usize, options: &Options) -> f64 {
        let mut limit_mm = limit_mm(self.elements, vertex, options);
        if !is_cut(self.elements, vertex) {
            return limit_mm;
        }
        let is_end = |index: &usize| !is_cut(self.elements, *index);
        let corners = [
            (vertex + 1..self.elements.len()).find(is_end),
            (0..vertex).rev().find(is_end),
        ];
        for corner in corners.into_iter().flatten() {
            let way_mm = (self.lengths_mm[corner + 1] - self.lengths_mm[vertex + 1]).abs();
            limit_mm = limit_mm.max(self::limit_mm(self.elements, corner, options) - way_mm);
        }
        limit_mm
    }

    fn chord_mm(&self, from: usize, point: &Position, samples_only: bool) -> f64 {
        let chain = &self.followed.chain;
        let to = (from + 1).min(chain.len() - 1);
        if samples_only {
            distance(point, &chain[from]).min(distance(point, &chain[to]))
        } else {
            distance_to_chord(point, &chain[from], &chain[to])
        }
    }
}
