//! Whether there is any way to lay samples along a path, where taking the first place of each leads nowhere.
//!
//! Where features of the path are as small as its tolerance, the first place lags far behind the samples, until what it leaves
//! behind lies beside no chord any more. So every element on which a sample may be is kept, each with the first place there:
//! whoever is there earlier has more places left on it.

use crate::{
    Position,
    geometry::distance_to_chord,
    path::{Element, PathPosition},
};

/// Looks at elements after which it is given up.
const MAX_LOOKS: usize = 50_000_000;

/// The elements on which each sample may be, with the first fraction.
pub struct Known {
    places: Vec<(usize, f64)>,
    /// Where those of each sample begin.
    begins: Vec<usize>,
}

/// The places of samples along `elements`, each within `tolerance_mm` of its sample, and the vertices that are passed from one to
/// the next within `reach_mm` of the chord between them; none where there are none.
pub fn find(
    elements: &[Element],
    samples: &[Position],
    tolerance_mm: impl Fn(&Element) -> f64,
    reach_mm: f64,
) -> Option<Known> {
    let mut known = Known {
        places: vec![(0, 0.0)],
        begins: vec![0],
    };
    let mut looks = 0;
    for (index, sample) in samples.iter().enumerate() {
        let (from, to) = (known.begins[index], known.places.len());
        let previous = &samples[index.saturating_sub(1)];
        let (mut at, mut passes, mut element) = (from, false, known.places[from].0);
        while element < elements.len() && (passes || at < to) {
            let here = known.places[at..to]
                .first()
                .copied()
                .filter(|(of, _)| *of == element);
            at += usize::from(here.is_some());
            if !passes && here.is_none() {
                element = known.places[at].0;
                continue;
            }
            let low = here.map_or(0.0, |(_, fraction)| if passes { 0.0 } else { fraction });
            let Element { shape, .. } = &elements[element];
            if let Some(fraction) =
                shape.first_within(sample, tolerance_mm(&elements[element]), low)
            {
                known.places.push((element, fraction));
            }
            passes = distance_to_chord(&shape.at(1.0), previous, sample) <= reach_mm;
            element += 1;
            looks += 1;
        }
        if known.places.len() == to || looks > MAX_LOOKS {
            return None;
        }
        known.begins.push(to);
    }
    // The first of all is where the walk begins.
    known.begins.remove(0);
    Some(known)
}

impl Known {
    /// One place for each sample: from the last one back, the nearest from which the one behind it is reached.
    pub fn nearest(
        &self,
        elements: &[Element],
        samples: &[Position],
        reach_mm: f64,
    ) -> Vec<PathPosition> {
        let mut places: Vec<PathPosition> = Vec::with_capacity(samples.len());
        for (index, sample) in samples.iter().enumerate().rev() {
            let until = self
                .begins
                .get(index + 1)
                .copied()
                .unwrap_or(self.places.len());
            let behind = places.last().copied();
            let next = &samples[(index + 1).min(samples.len() - 1)];
            let is_passed = |of: &usize| {
                distance_to_chord(&elements[*of].shape.at(1.0), sample, next) <= reach_mm
            };
            let mut best = (PathPosition::default(), f64::INFINITY);
            for &(element, first) in self.places[self.begins[index]..until].iter().rev() {
                let last = match behind {
                    Some(behind) if element > behind.element => continue,
                    Some(behind) if element == behind.element && first > behind.fraction => {
                        continue;
                    }
                    Some(behind) if element == behind.element => behind.fraction,
                    Some(behind) if !(element..behind.element).all(|of| is_passed(&of)) => break,
                    _ => 1.0,
                };
                if let Some((fraction, off_mm)) =
                    elements[element]
                        .shape
                        .nearer(sample, (first, last), best.1)
                {
                    best = (PathPosition { element, fraction }, off_mm);
                }
            }
            places.push(best.0);
        }
        places.reverse();
        places
    }

    /// The first element and the last on which each sample may be so that those behind it have places too.
    pub fn ranges(
        &self,
        elements: &[Element],
        samples: &[Position],
        reach_mm: f64,
    ) -> Vec<(PathPosition, PathPosition)> {
        let mut ranges = Vec::with_capacity(samples.len());
        let mut behind: Vec<usize> = Vec::new();
        for (index, sample) in samples.iter().enumerate().rev() {
            let until = self
                .begins
                .get(index + 1)
                .copied()
                .unwrap_or(self.places.len());
            let here = &self.places[self.begins[index]..until];
            let next = &samples[(index + 1).min(samples.len() - 1)];
            let mut alive = Vec::new();
            let (mut goes_on, mut of) = (false, behind.last().copied().unwrap_or(usize::MAX));
            for &(element, first) in here.iter().rev() {
                // From the last element behind down to this one: whether something behind is reached from there.
                while of > element && of != usize::MAX {
                    goes_on |= behind.binary_search(&of).is_ok();
                    of -= 1;
                    goes_on &=
                        distance_to_chord(&elements[of].shape.at(1.0), sample, next) <= reach_mm;
                }
                let stays = behind.binary_search(&element).is_ok();
                if index + 1 == samples.len() || stays || goes_on && of == element {
                    alive.push((element, first));
                }
            }
            alive.reverse();
            let place = |&(element, fraction): &(usize, f64)| PathPosition { element, fraction };
            let first = alive.first().map(place).unwrap_or_default();
            let last = alive.last().map_or(first, |(element, _)| PathPosition {
                element: *element,
                fraction: 1.0,
            });
            ranges.push((first, last));
            behind = alive.into_iter().map(|(element, _)| element).collect();
        }
        ranges.reverse();
        ranges
    }
}
