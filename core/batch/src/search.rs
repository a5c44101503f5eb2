//! The search: points spread over the whole space first, then simplexes from the best few, then a walk along each parameter
//! through the best. It only asks which of two points is the better one, so that what is broken is worse than what is slow, and
//! what is broken less is better than what is broken more.
//!
//! Points are asked for in rounds whose size does not depend on the computer; so the same seed gives the same answer on any
//! number of cores.

use std::collections::BTreeMap;

use fastrand::Rng;

use crate::space::{Parameter, Values};

/// How good a point is; the lesser is the better one.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Score {
    /// By how much of themselves limits are broken, in sum; infinite where there are no numbers.
    pub broken: f64,
    /// The objective.
    pub objective: f64,
}

impl Score {
    /// Of a point that gave no numbers.
    pub const NOTHING: Self = Self {
        broken: f64::INFINITY,
        objective: f64::INFINITY,
    };

    /// Whether this one is better.
    pub fn is_better(&self, than: &Self) -> bool {
        self < than
    }
}

/// A point: the value of each parameter, as text.
pub type Point = Vec<String>;

/// What the search asks for: the scores of points, in their order; `None` where it is to stop.
pub type Ask<'a> = dyn FnMut(&[Point]) -> Option<Vec<Score>> + 'a;

/// What it found.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// Every point that was asked for, and its score, in that order.
    pub points: Vec<(Point, Score)>,
    /// For each parameter, places in `points` of a walk along it through the best; empty where the budget did not reach.
    pub walks: Vec<Vec<usize>>,
    /// It was stopped before its end.
    pub stopped: bool,
}

impl Found {
    /// The place of the best point, where any gave numbers.
    pub fn best(&self) -> Option<usize> {
        let of = |place: &usize| self.points[*place].1;
        let all = 0..self.points.len();
        let best = all.reduce(|best, place| {
            if of(&place).is_better(&of(&best)) {
                place
            } else {
                best
            }
        })?;
        of(&best).objective.is_finite().then_some(best)
    }
}

/// Values of each parameter that a walk looks at.
const WALK: u32 = 6;
/// Simplexes that go on at the same time.
const SIMPLEXES: usize = 3;
/// A simplex is at its end where its points differ by less than this share of each range.
const CLOSE: f64 = 0.002;

/// Looks for the best point of `parameters` with at most `budget` points, beginning with `first`.
pub fn search(
    parameters: &[Parameter],
    first: Option<&Point>,
    budget: usize,
    seed: u64,
    ask: &mut Ask<'_>,
) -> Found {
    let mut search = Search {
        parameters,
        known: BTreeMap::new(),
        found: Found::default(),
        budget,
        ask,
    };
    if search.run(first, Rng::with_seed(seed)).is_none() {
        search.found.stopped = true;
    }
    search.found
}

struct Search<'a, 'b> {
    parameters: &'a [Parameter],
    known: BTreeMap<Point, usize>,
    found: Found,
    budget: usize,
    ask: &'a mut Ask<'b>,
}

impl Search<'_, '_> {
    fn run(&mut self, first: Option<&Point>, mut rng: Rng) -> Option<()> {
        let dimensions = self.parameters.len();
        // A walk has the middle of its values in common with the best point.
        let walk: usize = self
            .parameters
            .iter()
            .map(|p| p.values.count().min(WALK) as usize)
            .sum();
        let walk = walk.min(self.budget / 3);
        self.scores(first.cloned().as_slice())?;
        let spread = (self.budget.saturating_sub(walk + 1) * 2 / 5).max(dimensions + 1);
        let spread = latin(spread, dimensions, &mut rng);
        self.scores(
            &spread
                .iter()
                .map(|point| self.text(point))
                .collect::<Vec<_>>(),
        )?;
        self.simplexes(self.budget.saturating_sub(walk), &mut rng)?;
        self.walks()
    }

    fn text(&self, shares: &[f64]) -> Point {
        let each = self.parameters.iter().zip(shares);
        each.map(|(parameter, share)| parameter.values.at(*share))
            .collect()
    }

    fn shares(&self, values: &Point) -> Vec<f64> {
        let each = self.parameters.iter().zip(values);
        each.map(|(parameter, value)| parameter.values.share_of(value))
            .collect()
    }

    fn left(&self) -> usize {
        self.budget.saturating_sub(self.found.points.len())
    }

    /// The scores of points; those that are known cost nothing, and beyond the budget there are none. `None` to stop.
    fn scores(&mut self, points: &[Point]) -> Option<Vec<Option<Score>>> {
        let mut unknown: Vec<Point> = vec![];
        for point in points {
            if !self.known.contains_key(point)
                && !unknown.contains(point)
                && unknown.len() < self.left()
            {
                unknown.push(point.clone());
            }
        }
        if !unknown.is_empty() {
            let scores = (self.ask)(&unknown)?;
            for (point, score) in unknown.into_iter().zip(scores) {
                self.known.insert(point.clone(), self.found.points.len());
                self.found.points.push((point, score));
            }
        }
        let known = |point| {
            self.known
                .get(point)
                .map(|place| self.found.points[*place].1)
        };
        Some(points.iter().map(known).collect())
    }

    /// Nelder and Mead's simplexes from the best points that lie apart, each asking for one point a round.
    fn simplexes(&mut self, budget: usize, rng: &mut Rng) -> Option<()> {
        let until = |search: &Self| search.found.points.len() < budget;
        let mut began = vec![];
        let mut size = 0.2;
        let mut running: Vec<Simplex> = vec![];
        let mut idle = 0;
        while until(self) && idle < 20 {
            while running.len() < SIMPLEXES {
                let start = self.start(&mut began, rng);
                running.push(Simplex::around(&start, size, rng));
            }
            let before = self.found.points.len();
            let asked: Vec<Vec<f64>> = running.iter().map(Simplex::wants).collect();
            let texts: Vec<Point> = asked.iter().map(|point| self.text(point)).collect();
            let scores = self.scores(&texts)?;
            for ((simplex, point), score) in running.iter_mut().zip(asked).zip(scores) {
                simplex.take(point, score.unwrap_or(Score::NOTHING));
            }
            let ended = running.iter().filter(|simplex| simplex.is_small()).count();
            running.retain(|simplex| !simplex.is_small());
            if ended > 0 {
                size = f64::max(0.5 * size, 0.02);
            }
            // In a space of few points there may be no new one.
            idle = if self.found.points.len() > before {
                0
            } else {
                idle + 1
            };
        }
        Some(())
    }

    /// The best point that no simplex began at.
    fn start(&self, began: &mut Vec<Vec<f64>>, rng: &mut Rng) -> Vec<f64> {
        let mut places: Vec<usize> = (0..self.found.points.len()).collect();
        let score = |place: &usize| self.found.points[*place].1;
        places.sort_by(|a, b| {
            score(a)
                .partial_cmp(&score(b))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 0.05);
        let points = places
            .iter()
            .map(|place| self.shares(&self.found.points[*place].0));
        let free = points
            .into_iter()
            .find(|point| began.iter().all(|other| apart(point, other)));
        let start = free.unwrap_or_else(|| self.parameters.iter().map(|_| rng.f64()).collect());
        began.push(start.clone());
        start
    }

    /// Along each parameter through the best point, until none of them finds a better one or the budget is spent.
    fn walks(&mut self) -> Option<()> {
        while let Some(best) = self.found.best() {
            let centre = self.found.points[best].0.clone();
            let mut walks = vec![];
            for (index, parameter) in self.parameters.iter().enumerate() {
                let mut values = walk_values(&parameter.values, &centre[index]);
                values.dedup();
                let with = |value: String| {
                    let mut point = centre.clone();
                    point[index] = value;
                    point
                };
                walks.push(values.into_iter().map(with).collect::<Vec<_>>());
            }
            self.scores(&walks.concat())?;
            let known = |walk: &Vec<Point>| {
                walk.iter()
                    .filter_map(|point| self.known.get(point).copied())
                    .collect()
            };
            self.found.walks = walks.iter().map(known).collect();
            if self.found.best() == Some(best) || self.left() == 0 {
                return Some(());
            }
        }
        Some(())
    }
}

/// Values spread over the whole parameter, with `centre` among them.
fn walk_values(values: &Values, centre: &str) -> Vec<String> {
    let mut spread = values.spread(WALK);
    if !spread.iter().any(|value| value == centre) {
        let share = values.share_of(centre);
        let place = spread
            .iter()
            .filter(|value| values.share_of(value) < share)
            .count();
        spread.insert(place, centre.to_string());
    }
    spread
}

/// `count` points of a Latin hypercube: in each dimension one in each of `count` equal parts.
fn latin(count: usize, dimensions: usize, rng: &mut Rng) -> Vec<Vec<f64>> {
    let mut points = vec![vec![0.0; dimensions]; count];
    for dimension in 0..dimensions {
        let mut parts: Vec<usize> = (0..count).collect();
        rng.shuffle(&mut parts);
        for (point, part) in points.iter_mut().zip(parts) {
            point[dimension] = (part as f64 + rng.f64()) / count as f64;
        }
    }
    points
}

/// A simplex of Nelder and Mead, one question at a time.
struct Simplex {
    /// Corners with their scores, the best first; those without are asked for first.
    corners: Vec<(Vec<f64>, Option<Score>)>,
    step: Step,
}

#[derive(Clone)]
enum Step {
    Reflect,
    Expand(Vec<f64>, Score),
    Contract,
}

impl Simplex {
    /// Around `start`: a corner further along each parameter, by `size` of its range.
    fn around(start: &[f64], size: f64, rng: &mut Rng) -> Self {
        let mut corners = vec![(start.to_vec(), None)];
        for dimension in 0..start.len() {
            let mut corner = start.to_vec();
            let up = if corner[dimension] + size > 1.0 {
                false
            } else {
                corner[dimension] - size < 0.0 || rng.bool()
            };
            corner[dimension] += if up { size } else { -size };
            corners.push((corner, None));
        }
        Self {
            corners,
            step: Step::Reflect,
        }
    }

    fn is_small(&self) -> bool {
        let (first, others) = (&self.corners[0].0, &self.corners[1..]);
        let near = |corner: &(Vec<f64>, Option<Score>)| {
            corner
                .0
                .iter()
                .zip(first)
                .all(|(a, b)| (a - b).abs() < CLOSE)
        };
        self.corners.iter().all(|(_, score)| score.is_some()) && others.iter().all(near)
    }

    /// The point beyond the middle of all but the worst, seen from the worst, `by` times as far.
    fn beyond(&self, by: f64) -> Vec<f64> {
        let (worst, others) = self.corners.split_last().expect("a simplex has corners");
        let count = others.len() as f64;
        let along = |i: usize| {
            let middle = others.iter().map(|(corner, _)| corner[i]).sum::<f64>() / count;
            (middle + by * (middle - worst.0[i])).clamp(0.0, 1.0)
        };
        (0..worst.0.len()).map(along).collect()
    }

    /// What it wants to know next.
    fn wants(&self) -> Vec<f64> {
        if let Some((corner, _)) = self.corners.iter().find(|(_, score)| score.is_none()) {
            return corner.clone();
        }
        match &self.step {
            Step::Reflect => self.beyond(1.0),
            Step::Expand(..) => self.beyond(2.0),
            Step::Contract => self.beyond(-0.5),
        }
    }

    fn take(&mut self, point: Vec<f64>, score: Score) {
        if let Some(corner) = self.corners.iter_mut().find(|(_, score)| score.is_none()) {
            corner.1 = Some(score);
            self.sort();
            return;
        }
        let scores: Vec<Score> = self
            .corners
            .iter()
            .filter_map(|(_, score)| *score)
            .collect();
        let (best, worst) = (scores[0], scores[scores.len() - 1]);
        let second_worst = scores[scores.len().saturating_sub(2)];
        match std::mem::replace(&mut self.step, Step::Reflect) {
            Step::Reflect if score.is_better(&best) => self.step = Step::Expand(point, score),
            Step::Reflect if score.is_better(&second_worst) => self.replace_worst(point, score),
            Step::Reflect => {
                if score.is_better(&worst) {
                    self.replace_worst(point, score);
                }
                self.step = Step::Contract;
            }
            Step::Expand(reflected, of_reflected) => {
                let further = score.is_better(&of_reflected);
                let (point, score) = if further {
                    (point, score)
                } else {
                    (reflected, of_reflected)
                };
                self.replace_worst(point, score);
            }
            Step::Contract if score.is_better(&worst) => self.replace_worst(point, score),
            Step::Contract => self.shrink(),
        }
    }

    fn replace_worst(&mut self, point: Vec<f64>, score: Score) {
        if let Some(worst) = self.corners.last_mut() {
            *worst = (point, Some(score));
        }
        self.sort();
    }

    /// All corners half way to the best one, and asked for again.
    fn shrink(&mut self) {
        let best = self.corners[0].0.clone();
        for (corner, score) in &mut self.corners[1..] {
            for (value, best) in corner.iter_mut().zip(&best) {
                *value = 0.5 * (*value + best);
            }
            *score = None;
        }
    }

    fn sort(&mut self) {
        if self.corners.iter().all(|(_, score)| score.is_some()) {
            let order = |a: &Option<Score>, b: &Option<Score>| {
                a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal)
            };
            self.corners.sort_by(|a, b| order(&a.1, &b.1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters(count: usize) -> Vec<Parameter> {
        (0..count)
            .map(|i| Parameter::read(&format!("p{i}=0.0..1.0")).unwrap())
            .collect()
    }

    fn numbers(point: &Point) -> Vec<f64> {
        point.iter().map(|value| value.parse().unwrap()).collect()
    }

    /// A bowl with a wall: the lowest point that the wall leaves is on the wall.
    fn walled(point: &[f64], lowest: &[f64]) -> Score {
        let objective: f64 = point.iter().zip(lowest).map(|(a, b)| (a - b).powi(2)).sum();
        let broken = (point[0] - 0.6).max(0.0);
        Score {
            broken,
            objective: 1.0 + objective,
        }
    }

    #[test]
    fn random_bowls_behind_walls_are_found() {
        let mut rng = Rng::new();
        let seed = rng.get_seed();
        for dimensions in 1..=3 {
            for _ in 0..20 {
                let lowest: Vec<f64> = (0..dimensions).map(|_| rng.f64()).collect();
                let mut ask = |points: &[Point]| {
                    Some(
                        points
                            .iter()
                            .map(|p| walled(&numbers(p), &lowest))
                            .collect(),
                    )
                };
                let first = vec!["1.0".to_string(); dimensions];
                let found = search(
                    &parameters(dimensions),
                    Some(&first),
                    40 * dimensions,
                    rng.u64(..),
                    &mut ask,
                );
                let best = found.points[found.best().unwrap()].1;
                let mut behind = lowest.clone();
                behind[0] = behind[0].min(0.6);
                let least = walled(&behind, &lowest).objective;
                assert!(
                    best.broken == 0.0 && best.objective < least + 0.02,
                    "seed {seed}: {lowest:?}: {best:?}"
                );
                assert!(found.points.len() <= 40 * dimensions);
            }
        }
    }

    #[test]
    fn the_same_seed_asks_the_same_and_no_point_twice() {
        let run = |seed| {
            let mut ask = |points: &[Point]| {
                Some(
                    points
                        .iter()
                        .map(|p| walled(&numbers(p), &[0.3, 0.7]))
                        .collect(),
                )
            };
            search(
                &parameters(2),
                Some(&vec!["0.5".into(), "0.5".into()]),
                60,
                seed,
                &mut ask,
            )
            .points
        };
        assert_eq!(run(7), run(7));
        assert_ne!(run(7), run(8));
        let mut points: Vec<Point> = run(7).into_iter().map(|(point, _)| point).collect();
        let asked = points.len();
        points.sort();
        points.dedup();
        assert_eq!(points.len(), asked);
    }

    #[test]
    fn a_small_space_is_asked_for_whole_and_then_it_ends() {
        let parameters = ["a=1,2,3", "b=true,false"].map(|text| Parameter::read(text).unwrap());
        let mut ask = |points: &[Point]| {
            let score = |p: &Point| Score {
                broken: 0.0,
                objective: p[0].parse::<f64>().unwrap(),
            };
            Some(points.iter().map(score).collect())
        };
        let found = search(&parameters, None, 1000, 1, &mut ask);
        assert!(found.points.len() <= 6 && !found.stopped);
        assert_eq!(found.points[found.best().unwrap()].0[0], "1");
        assert_eq!(found.walks[0].len(), 3);
    }

    #[test]
    fn what_is_broken_loses_and_what_gives_nothing_is_no_best() {
        let score = |broken, objective| Score { broken, objective };
        assert!(score(0.0, 9.0).is_better(&score(0.1, 1.0)));
        assert!(score(0.1, 9.0).is_better(&score(0.2, 1.0)));
        assert!(score(0.2, 9.0).is_better(&Score::NOTHING));
        let mut ask = |points: &[Point]| Some(vec![Score::NOTHING; points.len()]);
        let found = search(&parameters(1), None, 20, 1, &mut ask);
        assert_eq!(found.best(), None);
        let mut ask = |_: &[Point]| None;
        assert!(search(&parameters(1), None, 20, 1, &mut ask).stopped);
    }
}
