//! The search for the best settings of a machine over programs, each point a job a program.

use std::collections::BTreeMap;

use crate::job::Job;
use crate::local::Bench;
use crate::result::Ended;
use crate::search::{Point, Score, search};
use crate::space::Parameter;

/// What people call the time of a run.
const TIME: &str = "time";
/// Its key in the summary.
const TIME_KEY: &str = "motion_time_s";

/// What is asked.
pub struct Task {
    /// Hash of the machine.
    pub machine: String,
    /// Hashes of the programs.
    pub programs: Vec<String>,
    /// Lines that begin with `/` are left out.
    pub block_delete: bool,
    /// What varies.
    pub parameters: Vec<Parameter>,
    /// The values of the machine as it is, where it states all of them.
    pub stated: Option<Point>,
    /// The number that is to be small.
    pub objective: String,
    /// What must be kept.
    pub keeps: Vec<Keep>,
    /// The number that the objective is drawn against.
    pub against: String,
    /// Points at most.
    pub budget: usize,
    /// Where the search draws from.
    pub seed: u64,
}

/// A limit on a number.
#[derive(Clone, Debug, PartialEq)]
pub struct Keep {
    /// The number.
    pub key: String,
    /// The number is to be at most this; at least, where `at_least`.
    pub limit: f64,
    /// The other way round.
    pub at_least: bool,
}

impl Keep {
    /// Reads `key<=1` or `key>=1`.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn read(text: &str) -> Result<Self, String> {
        let (parts, at_least) = match text.split_once("<=") {
            Some(parts) => (Some(parts), false),
            None => (text.split_once(">="), true),
        };
        let (key, limit) = parts.ok_or_else(|| format!("{text}: it has the form key<=number"))?;
        let number = limit
            .trim()
            .parse()
            .ok()
            .filter(|limit: &f64| limit.is_finite());
        Ok(Self {
            key: key_of(key.trim()),
            limit: number.ok_or_else(|| format!("{text}: {} is no number", limit.trim()))?,
            at_least,
        })
    }

    /// By how much of itself the limit is broken; zero where it is kept.
    fn broken_by(&self, value: f64) -> f64 {
        let beyond = if self.at_least {
            self.limit - value
        } else {
            value - self.limit
        };
        beyond.max(0.0) / self.limit.abs().max(1e-9)
    }
}

/// The key of a number that people may call by another name.
pub fn key_of(name: &str) -> String {
    if name == TIME { TIME_KEY } else { name }.to_string()
}

/// A point, and what all programs came to with it.
#[derive(Clone, Debug)]
pub struct Tried {
    /// The value of each parameter; none for the machine as it is.
    pub values: Option<Point>,
    /// Numbers of all programs together: the largest of what is a largest, the sum of the rest.
    pub numbers: BTreeMap<String, f64>,
    /// For each program its largest path deviation, and where: the line, and the linear axes by letter, mm.
    pub worst: Vec<WorstDeviation>,
    /// Why there are no numbers.
    pub cause: Option<String>,
    /// How good it is.
    pub score: Score,
}

/// Where a program left its path furthest.
#[derive(Clone, Debug, Default)]
pub struct WorstDeviation {
    /// By how much, mm.
    pub deviation_mm: f64,
    /// The line.
    pub line: u32,
    /// The place.
    pub at_mm: BTreeMap<char, f64>,
}

impl Tried {
    /// Whether it gave numbers and keeps all limits.
    pub fn is_kept(&self) -> bool {
        self.score.broken == 0.0
    }

    /// A number of it.
    pub fn number(&self, key: &str) -> Option<f64> {
        self.numbers.get(key).copied()
    }
}

/// What was found.
pub struct Tuned {
    /// Every point; the first is the machine as it is.
    pub points: Vec<Tried>,
    /// For each parameter, places in `points` of the walk along it through the best.
    pub walks: Vec<Vec<usize>>,
    /// The chosen point: the best that keeps all limits, or the one that breaks least where none does.
    pub chosen: Option<usize>,
    /// Places of the points that no other one beats in objective and in the number it is drawn against, by that number. What they
    /// are drawn against may be beyond its limit there; other limits are kept.
    pub front: Vec<usize>,
    /// It was stopped before its end.
    pub stopped: bool,
}

/// Looks for the best settings. `tell` hears of the points after each round.
///
/// # Errors
/// A number that is asked for is in no summary; results cannot be recorded.
pub fn tune(
    task: &Task,
    bench: &Bench<'_>,
    tell: &mut dyn FnMut(&[Tried]),
) -> Result<Tuned, String> {
    let mut points: Vec<Tried> = vec![];
    let mut failed = None;
    let base = [None];
    let Some(as_it_is) = try_points(task, bench, &base)? else {
        return Ok(conclude(task, points, vec![], true));
    };
    points.extend(as_it_is);
    check_names(task, &points[0])?;
    tell(&points);
    let mut ask = |asked: &[Point]| {
        let asked: Vec<Option<Point>> = asked.iter().cloned().map(Some).collect();
        match try_points(task, bench, &asked) {
            Ok(Some(tried)) => {
                let scores = tried.iter().map(|tried| tried.score).collect();
                points.extend(tried);
                tell(&points);
                Some(scores)
            }
            Ok(None) => None,
            Err(error) => {
                failed = Some(error);
                None
            }
        }
    };
    let found = search(
        &task.parameters,
        task.stated.as_ref(),
        task.budget.saturating_sub(1),
        task.seed,
        &mut ask,
    );
    if let Some(error) = failed {
        return Err(error);
    }
    // Behind the machine as it is.
    let walks = found
        .walks
        .iter()
        .map(|walk| walk.iter().map(|place| place + 1).collect())
        .collect();
    Ok(conclude(task, points, walks, found.stopped))
}

fn conclude(task: &Task, points: Vec<Tried>, walks: Vec<Vec<usize>>, stopped: bool) -> Tuned {
    let with_numbers = |place: &usize| points[*place].cause.is_none();
    let all = || (0..points.len()).filter(with_numbers);
    let chosen = all().reduce(|best, place| {
        if points[place].score.is_better(&points[best].score) {
            place
        } else {
            best
        }
    });
    let front = front(task, &points);
    Tuned {
        points,
        walks,
        chosen,
        front,
        stopped,
    }
}

/// The points that no other one beats, by the number that the objective is drawn against.
fn front(task: &Task, points: &[Tried]) -> Vec<usize> {
    let at = |place: usize| {
        let point = &points[place];
        Some((point.number(&task.against)?, point.number(&task.objective)?))
    };
    let others_kept = |place: &usize| {
        let broken = |keep: &&Keep| {
            let value = points[*place].number(&keep.key);
            keep.key != task.against && value.is_none_or(|value| keep.broken_by(value) > 0.0)
        };
        task.keeps.iter().find(broken).is_none()
    };
    let mut places: Vec<usize> = (0..points.len())
        .filter(|place| points[*place].cause.is_none() && at(*place).is_some())
        .filter(others_kept)
        .collect();
    places.sort_by(|a, b| {
        at(*a)
            .partial_cmp(&at(*b))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    let mut least = f64::INFINITY;
    places.retain(|place| {
        let objective = at(*place).map_or(f64::INFINITY, |(_, objective)| objective);
        let beats = objective < least;
        least = least.min(objective);
        beats
    });
    places
}

/// What is asked for must be among the numbers.
fn check_names(task: &Task, as_it_is: &Tried) -> Result<(), String> {
    if as_it_is.numbers.is_empty() {
        // The machine as it is may be refused where another one is not.
        return Ok(());
    }
    let asked = [&task.objective, &task.against];
    for key in asked
        .into_iter()
        .chain(task.keeps.iter().map(|keep| &keep.key))
    {
        if !as_it_is.numbers.contains_key(key) {
            let known: Vec<&str> = as_it_is.numbers.keys().map(String::as_str).collect();
            let meant = tandem_machine::meant(key, &known);
            let meant = meant.map_or_else(
                || format!("there are {}", known.join(", ")),
                |name| format!("did you mean {name}?"),
            );
            return Err(format!("{key}: no run has a number of this name; {meant}"));
        }
    }
    Ok(())
}

/// Simulates every program at every point; none where it is to stop.
fn try_points(
    task: &Task,
    bench: &Bench<'_>,
    points: &[Option<Point>],
) -> Result<Option<Vec<Tried>>, String> {
    let job = |values: &Option<Point>, program: &String| Job {
        program: program.clone(),
        machine: task.machine.clone(),
        set: set_of(&task.parameters, values.as_ref()),
        block_delete: task.block_delete,
    };
    let each = |values| {
        task.programs
            .iter()
            .map(move |program| job(values, program))
    };
    let jobs: Vec<Job> = points.iter().flat_map(each).collect();
    let results = bench.run(&jobs)?;
    let Some(results) = results.into_iter().collect::<Option<Vec<_>>>() else {
        return Ok(None);
    };
    let ended: Vec<Ended> = results.into_iter().map(|result| result.ended).collect();
    let of_points = ended.chunks(task.programs.len()).zip(points);
    Ok(Some(
        of_points
            .map(|(ended, values)| tried(task, values.clone(), ended))
            .collect(),
    ))
}

/// The keys that make a point.
pub fn set_of(parameters: &[Parameter], values: Option<&Point>) -> Vec<(String, String)> {
    let Some(values) = values else { return vec![] };
    parameters
        .iter()
        .zip(values)
        .flat_map(|(parameter, value)| parameter.set(value))
        .collect()
}

fn tried(task: &Task, values: Option<Point>, ended: &[Ended]) -> Tried {
    let cause = ended.iter().find_map(Ended::cause).map(str::to_string);
    let mut numbers: BTreeMap<String, f64> = BTreeMap::new();
    let mut worst = vec![];
    for of_program in ended
        .iter()
        .filter_map(Ended::numbers)
        .filter(|_| cause.is_none())
    {
        worst.push(place(of_program));
        for (key, number) in of_program {
            let all = numbers.entry(key.clone()).or_insert(if is_largest(key) {
                f64::NEG_INFINITY
            } else {
                0.0
            });
            *all = if is_largest(key) {
                all.max(*number)
            } else {
                *all + number
            };
        }
    }
    let score = match numbers.get(&task.objective) {
        Some(objective) => Score {
            broken: task
                .keeps
                .iter()
                .map(|keep| {
                    numbers
                        .get(&keep.key)
                        .map_or(f64::INFINITY, |value| keep.broken_by(*value))
                })
                .sum(),
            objective: *objective,
        },
        None => Score::NOTHING,
    };
    Tried {
        values,
        numbers,
        worst,
        cause,
        score,
    }
}

/// Whether of several runs the largest counts; of the rest it is the sum.
fn is_largest(key: &str) -> bool {
    key.starts_with("max_") || key.starts_with("worst_of_limits") || key.ends_with("_period_s")
}

fn place(numbers: &BTreeMap<String, f64>) -> WorstDeviation {
    let number = |key: &str| numbers.get(key).copied().unwrap_or(0.0);
    let letter = |(key, at): (&String, &f64)| {
        Some((key.strip_prefix("deviation_at_mm.")?.chars().next()?, *at))
    };
    WorstDeviation {
        deviation_mm: number("max_path_deviation_mm"),
        line: number("deviation_at_line") as u32,
        at_mm: numbers.iter().filter_map(letter).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_read_and_broken_by_shares() {
        let keep = Keep::read("max_path_deviation_mm<=0.02").unwrap();
        assert_eq!(keep.key, "max_path_deviation_mm");
        assert_eq!(keep.broken_by(0.01), 0.0);
        assert!((keep.broken_by(0.03) - 0.5).abs() < 1e-12);
        let least = Keep::read("time >= 10").unwrap();
        assert_eq!(least.key, "motion_time_s");
        assert_eq!(least.broken_by(5.0), 0.5);
        assert!(Keep::read("time=3").is_err() && Keep::read("time<=x").is_err());
    }
}
