//! Which place of the programmed path each sample belongs to.

use crate::{
    Options, Position,
    path::{Element, Path, PathPosition},
    walk::Walker,
};

/// Deviations below this are rounding, and are not resolved further.
const SMALLEST_DEVIATION_MM: f64 = 1e-13;
/// How often the tolerance is halved before samples count as off the path.
const NARROWER: u32 = 16;
/// How closely the smallest sufficient tolerance is found.
const RESOLUTION: f64 = 1.05;

/// The samples laid along the path.
pub struct Followed {
    /// The samples without repetitions.
    pub chain: Vec<Position>,
    /// The first sample of each link of the chain.
    pub samples: Vec<usize>,
    /// The link of each sample.
    pub links: Vec<usize>,
    /// The place of each link; places never go back.
    pub places: Vec<PathPosition>,
    /// Links off the path, with their distance from it.
    pub misses: Vec<(usize, f64)>,
    /// Where the walk ended.
    pub end: PathPosition,
    /// Greatest distance of a sample from the path, mm.
    pub deviation_mm: f64,
}

/// Lays samples along a path that has at least one element.
pub fn follow(path: &Path, commands: &[Position], options: &Options) -> Followed {
    let mut followed = Followed::chain(commands);
    let walker = Walker::new(&path.elements, options);
    let Some(last) = followed.chain.last().copied() else {
        return followed;
    };
    let Some((cap_mm, first)) = smallest_tolerance(&walker, &followed.chain) else {
        if let Some(places) = walker.any(&followed.chain) {
            followed.end = walker.end(places.last().copied().unwrap_or_default(), &last);
            followed.settle(&path.elements, &places, &places);
            return followed;
        }
        let walk = walker.recovering(&followed.chain);
        followed.end = walker.end(walk.places.last().copied().unwrap_or_default(), &last);
        followed.deviation_mm = walk
            .misses
            .iter()
            .map(|&(_, off_mm)| off_mm)
            .fold(0.0, f64::max);
        (followed.places, followed.misses) = (walk.places, walk.misses);
        return followed;
    };
    followed.end = walker.end(first.last().copied().unwrap_or_default(), &last);
    // Where a motion to and fro is as short as a period, the first places may lag behind by whole turns of it. A run that ended
    // early need not have come to the end of the path, though it may have stopped near it.
    if !options.ends_early
        && !walker.is_at_end(followed.end)
        && walker.may_end_at(&last)
        && let Some(places) = walker.any(&followed.chain)
    {
        let end = walker.end(places.last().copied().unwrap_or_default(), &last);
        if walker.is_at_end(end) {
            followed.end = end;
            followed.settle(&path.elements, &places, &places);
            return followed;
        }
    }
    let latest = latest(
        &path.elements,
        followed.end,
        &followed.chain,
        cap_mm,
        options,
    );
    followed.settle(&path.elements, &first, latest.as_deref().unwrap_or(&first));
    followed
}

/// Between which places each link may be where all of the tolerance is used, as far as the path can be followed with so much;
/// none where it cannot. The places that the smallest tolerance leaves may be those of another part of the path, where that has
/// features smaller than the tolerance.
pub fn ranges(
    elements: &[Element],
    followed: &Followed,
    options: &Options,
) -> Option<Vec<(PathPosition, PathPosition)>> {
    let walker = Walker::new(elements, options);
    let Some((cap_mm, first)) = widest_tolerance(&walker, &followed.chain) else {
        return walker.any_ranges(&followed.chain);
    };
    if let Some(last) = latest(elements, followed.end, &followed.chain, cap_mm, options) {
        return Some(first.into_iter().zip(last).collect());
    }
    // The way back may dawdle too, whatever is left of the tolerance.
    walker.any_ranges(&followed.chain)
}

impl Followed {
    fn chain(commands: &[Position]) -> Self {
        let (mut chain, mut samples, mut links) = (Vec::<Position>::new(), Vec::new(), Vec::new());
        for (index, command) in commands.iter().enumerate() {
            if chain.last() != Some(command) {
                chain.push(*command);
                samples.push(index);
            }
            links.push(chain.len() - 1);
        }
        let (places, misses) = (Vec::new(), Vec::new());
        Self {
            chain,
            samples,
            links,
            places,
            misses,
            end: PathPosition::default(),
            deviation_mm: 0.0,
        }
    }

    /// Takes the nearest place between the first and the last that a sample may have.
    fn settle(&mut self, elements: &[Element], first: &[PathPosition], latest: &[PathPosition]) {
        let mut before = PathPosition::default();
        for ((sample, &first), &latest) in self.chain.iter().zip(first).zip(latest) {
            let low = if first > before { first } else { before };
            let (place, off_mm) = nearest_between(
                elements,
                low,
                if latest > low { latest } else { low },
                sample,
            );
            self.deviation_mm = self.deviation_mm.max(off_mm);
            self.places.push(place);
            before = place;
        }
    }
}

/// The smallest tolerance with which the walk succeeds, and that walk; none where the allowed one is too small.
fn smallest_tolerance(walker: &Walker, chain: &[Position]) -> Option<(f64, Vec<PathPosition>)> {
    let walk = |cap_mm| {
        walker
            .capped(cap_mm)
            .strict(PathPosition::default(), chain.iter().copied())
    };
    let (mut high_mm, mut places) = widest_tolerance(walker, chain)?;
    let mut low_mm = SMALLEST_DEVIATION_MM;
    while high_mm > RESOLUTION * low_mm {
        let middle_mm = (low_mm * high_mm).sqrt();
        match walk(middle_mm) {
            Some(found) => (places, high_mm) = (found, middle_mm),
            None => low_mm = middle_mm,
        }
    }
    Some((high_mm, places))
}

/// The widest tolerance with which the walk succeeds, and that walk. With a wide one it may dawdle on a piece that the samples
/// have left, until the next vertex is out of reach; one that keeps closer to the samples does not. Each of them that succeeds
/// is a proof.
fn widest_tolerance(walker: &Walker, chain: &[Position]) -> Option<(f64, Vec<PathPosition>)> {
    let walk = |cap_mm| {
        walker
            .capped(cap_mm)
            .strict(PathPosition::default(), chain.iter().copied())
    };
    let mut caps = (0..NARROWER).map(|times| walker.widest_mm() / f64::from(1u32 << times));
    caps.find_map(|cap_mm| Some((cap_mm, walk(cap_mm)?)))
}

/// The last places that samples may have: the first ones on the way back.
fn latest(
    elements: &[Element],
    end: PathPosition,
    chain: &[Position],
    cap_mm: f64,
    options: &Options,
) -> Option<Vec<PathPosition>> {
    let back: Vec<Element> = elements[..=end.element]
        .iter()
        .rev()
        .map(reversed)
        .collect();
    let start = PathPosition {
        element: 0,
        fraction: 1.0 - end.fraction,
    };
    let mut places = Walker::new(&back, options)
        .capped(cap_mm)
        .strict(start, chain.iter().rev().copied())?;
    for place in &mut places {
        *place = PathPosition {
            element: end.element - place.element,
            fraction: 1.0 - place.fraction,
        };
    }
    places.reverse();
    Some(places)
}

fn reversed(element: &Element) -> Element {
    Element {
        shape: element.shape.reversed(),
        ..element.clone()
    }
}

fn nearest_between(
    elements: &[Element],
    low: PathPosition,
    high: PathPosition,
    sample: &Position,
) -> (PathPosition, f64) {
    let mut best = (low, f64::INFINITY);
    for (index, element) in elements
        .iter()
        .enumerate()
        .take(high.element + 1)
        .skip(low.element)
    {
        let from = if index == low.element {
            low.fraction
        } else {
            0.0
        };
        let to = if index == high.element {
            high.fraction
        } else {
            1.0
        };
        if let Some((fraction, off_mm)) = element.shape.nearer(sample, (from, to), best.1) {
            best = (
                PathPosition {
                    element: index,
                    fraction,
                },
                off_mm,
            );
        }
    }
    best
}
