//! What was found, as a page.

use std::fmt::Write as _;
use std::path::Path;

use tandem_batch::{Job, Lines, Scene, Tried, WorstDeviation, set_of, simulate_with};
use tandem_recorder::Output;
use tandem_report::{TuneParameter, TunePoint, TuneReport, TuneScene, TuneStep};

use super::{TuneRun, label, stated_value, verdict, with_unit};

/// Half of the width of the drawing of paths, as a multiple of the largest deviation in it.
const RADIUS_OF_DEVIATION: f64 = 14.0;
/// The smallest such drawing, mm.
const MIN_RADIUS_MM: f64 = 0.02;

/// Writes the page.
pub fn write(path: &Path, run: &TuneRun<'_>, chosen: usize) -> Result<(), String> {
    let report = report(run, chosen);
    let mut out = Output::create(path)?;
    report
        .write(&mut out)
        .map_err(|e| format!("{}: {e}", path.display()))?;
    out.finish()
}

fn report(run: &TuneRun<'_>, chosen: usize) -> TuneReport {
    let (task, tuned) = (run.task, run.tuned);
    let [first, second] = [label(&task.objective), label(&task.against)];
    let at = |point: &Tried| {
        Some([
            point.number(&task.objective)? * first.1,
            point.number(&task.against)? * second.1,
        ])
    };
    let limit = |key: &str, scale: f64| {
        let keep = task
            .keeps
            .iter()
            .find(|keep| keep.key == key && !keep.at_least);
        keep.map(|keep| keep.limit * scale)
    };
    let with_numbers = || tuned.points.iter().filter(|point| point.cause.is_none());
    let shown = shown_points(run, chosen);
    let mut marks = vec![];
    for (name, place, style) in [("as it is", 0, 2), ("chosen", chosen, 1)] {
        if let Some(at) = tuned.points[place]
            .cause
            .is_none()
            .then(|| at(&tuned.points[place]))
            .flatten()
        {
            marks.push((name.to_string(), at, style));
        }
    }
    TuneReport {
        title: format!("Settings of {}", run.machine.name),
        facts: facts(run),
        verdict: verdict(run, chosen),
        names: [first.0.clone(), second.0.clone()],
        points: with_numbers()
            .filter_map(|point| {
                Some(TunePoint {
                    at: at(point)?,
                    kept: point.is_kept(),
                    label: words(run, point),
                })
            })
            .collect(),
        front: tuned
            .front
            .iter()
            .filter_map(|place| at(&tuned.points[*place]))
            .collect(),
        marks,
        limits: [
            limit(&task.objective, first.1),
            limit(&task.against, second.1),
        ],
        parameters: (0..tuned.walks.len())
            .map(|index| parameter(run, index, chosen, &at))
            .collect(),
        scene: scene(run, &shown),
        table: table(run, &shown),
        notes: notes(run),
    }
}

fn facts(run: &TuneRun<'_>) -> Vec<(String, String)> {
    let mut facts = vec![
        ("programs".to_string(), run.programs.join(", ")),
        (
            "settings tried".to_string(),
            run.tuned.points.len().to_string(),
        ),
    ];
    for keep in &run.task.keeps {
        let sign = if keep.at_least { "≥" } else { "≤" };
        facts.push((
            keep.key.clone(),
            format!("{sign} {}", with_unit(&keep.key, keep.limit)),
        ));
    }
    facts
}

/// The settings of a point.
fn words(run: &TuneRun<'_>, point: &Tried) -> String {
    let set = set_of(&run.task.parameters, point.values.as_ref());
    if set.is_empty() {
        "the machine as it is".to_string()
    } else {
        tandem_batch::shown(&set)
    }
}

/// Up to three points with their names: the fastest of the front, the chosen one, the most exact of the front.
fn shown_points(run: &TuneRun<'_>, chosen: usize) -> Vec<(&'static str, usize)> {
    let front = &run.tuned.front;
    let mut shown: Vec<(&str, usize)> = vec![("chosen", chosen)];
    for (name, place) in [
        ("least of all deviations", front.first()),
        ("shortest of all times", front.last()),
    ] {
        if let Some(place) = place.filter(|place| shown.iter().all(|(_, other)| other != *place)) {
            shown.push((name, *place));
        }
    }
    // In the order of the styles of their ways.
    shown.sort_by_key(|(name, _)| {
        ["least of all deviations", "chosen", "shortest of all times"]
            .iter()
            .position(|n| n == name)
    });
    shown
}

fn parameter(
    run: &TuneRun<'_>,
    index: usize,
    chosen: usize,
    at: &dyn Fn(&Tried) -> Option<[f64; 2]>,
) -> TuneParameter {
    let (parameter, tuned) = (&run.task.parameters[index], run.tuned);
    let steps: Vec<TuneStep> = tuned.walks[index]
        .iter()
        .map(|place| {
            let point = &tuned.points[*place];
            let value = point
                .values
                .as_ref()
                .map(|values| values[index].clone())
                .unwrap_or_default();
            TuneStep {
                share: parameter.values.share_of(&value),
                value,
                at: point.cause.is_none().then(|| at(point)).flatten(),
                kept: point.is_kept(),
                chosen: *place == chosen,
            }
        })
        .collect();
    TuneParameter {
        name: parameter.name(),
        worth: worth(run, &steps),
        steps,
    }
}

/// What a parameter is worth, from its least to its greatest effect.
fn worth(run: &TuneRun<'_>, steps: &[TuneStep]) -> String {
    let range = |index: usize| {
        let values = || steps.iter().filter_map(move |step| Some(step.at?[index]));
        let low = values().fold(f64::INFINITY, f64::min);
        let high = values().fold(0.0, f64::max);
        if low > 0.0 && high.is_finite() {
            100.0 * (high / low - 1.0)
        } else {
            0.0
        }
    };
    let name = |key: &str| {
        label(key)
            .0
            .split(", ")
            .next()
            .unwrap_or_default()
            .to_string()
    };
    let mut text = format!(
        "{} changes by {:.1} %, {} by {:.1} %.",
        name(&run.task.objective),
        range(0),
        name(&run.task.against),
        range(1)
    );
    let none = steps.iter().filter(|step| step.at.is_none()).count();
    if none > 0 {
        let _ = write!(text, " {none} of {} values cannot be driven.", steps.len());
    }
    text
}

fn table(run: &TuneRun<'_>, shown: &[(&'static str, usize)]) -> Vec<Vec<String>> {
    let (task, points) = (run.task, &run.tuned.points);
    let machine: toml::Table = run.machine.effective_toml().parse().unwrap_or_default();
    let head = ["", "as it is"]
        .into_iter()
        .chain(shown.iter().map(|(name, _)| *name));
    let mut rows = vec![head.map(str::to_string).collect::<Vec<_>>()];
    for (index, parameter) in task.parameters.iter().enumerate() {
        let as_it_is =
            stated_value(&machine, &parameter.keys[0]).unwrap_or_else(|| "not stated".to_string());
        let value = |place: usize| {
            points[place]
                .values
                .as_ref()
                .map_or(as_it_is.clone(), |values| values[index].clone())
        };
        rows.push(
            [parameter.name(), as_it_is.clone()]
                .into_iter()
                .chain(shown.iter().map(|(_, place)| value(*place)))
                .collect(),
        );
    }
    let mut keys = vec![&task.objective, &task.against];
    keys.extend(task.keeps.iter().map(|keep| &keep.key));
    let mut told: Vec<&String> = vec![];
    for key in keys {
        if told.contains(&key) {
            continue;
        }
        told.push(key);
        let value = |place: usize| {
            points[place]
                .number(key)
                .map_or("–".to_string(), |value| with_unit(key, value))
        };
        let name = label(key)
            .0
            .split(", ")
            .next()
            .unwrap_or_default()
            .to_string();
        rows.push(
            [name, value(0)]
                .into_iter()
                .chain(shown.iter().map(|(_, place)| value(*place)))
                .collect(),
        );
    }
    rows
}

fn notes(run: &TuneRun<'_>) -> Vec<String> {
    let mut notes = vec![];
    let broken: Vec<&str> = run
        .tuned
        .points
        .iter()
        .filter_map(|point| point.cause.as_deref())
        .collect();
    if let Some(cause) = broken.first() {
        notes.push(format!(
            "{} settings could not be driven, the first because of: {cause}",
            broken.len()
        ));
    }
    notes
}

/// The ways of the shown points around the place where one of them leaves the path furthest.
fn scene(run: &TuneRun<'_>, shown: &[(&'static str, usize)]) -> Option<TuneScene> {
    let places = shown
        .iter()
        .flat_map(|(_, point)| run.tuned.points[*point].worst.iter().enumerate());
    let (program, worst): (usize, &WorstDeviation) =
        places.max_by(|(_, a), (_, b)| a.deviation_mm.total_cmp(&b.deviation_mm))?;
    if worst.deviation_mm <= 0.0 {
        return None;
    }
    let radius_mm = (RADIUS_OF_DEVIATION * worst.deviation_mm).max(MIN_RADIUS_MM);
    let mut scenes = vec![];
    for (name, point) in shown {
        let job = Job {
            program: run.task.programs[program].clone(),
            machine: run.task.machine.clone(),
            set: set_of(
                &run.task.parameters,
                run.tuned.points[*point].values.as_ref(),
            ),
            block_delete: run.task.block_delete,
        };
        let mut scene = Scene::new(run.machine, &worst.at_mm, radius_mm);
        // A point that was driven once is driven again, to the bit.
        simulate_with(&job, run.inputs, run.plugins, &mut scene).ok()?;
        scenes.push((*name, scene));
    }
    let letters = scenes[0].1.letters();
    if letters.is_empty() {
        return None;
    }
    let plane = plane(&scenes[0].1);
    let middle = |axis: usize| {
        worst
            .at_mm
            .get(&letters[axis].to_ascii_lowercase())
            .copied()
            .unwrap_or(0.0)
    };
    let flat = |lines: &Lines| -> Vec<Vec<[f64; 2]>> {
        let point = |point: &Vec<f64>| plane.map(|axis| point[axis]);
        lines
            .iter()
            .map(|line| line.iter().map(point).collect())
            .collect()
    };
    let deviation = |place: usize| {
        let mm = run.tuned.points[place]
            .worst
            .get(program)
            .map_or(0.0, |worst| worst.deviation_mm);
        format!("{:.1} µm off at most", 1e3 * mm)
    };
    Some(TuneScene {
        place: format!(
            "{}, around line {}, where {:.1} µm off the path was the most",
            run.programs[program],
            worst.line,
            1e3 * worst.deviation_mm
        ),
        axes: plane.map(|axis| letters[axis].to_string()),
        centre_mm: plane.map(middle),
        radius_mm,
        programmed: flat(&scenes[0].1.programmed),
        ways: scenes
            .iter()
            .zip(shown)
            .map(|((name, scene), (_, place))| {
                (
                    format!("{name}, {}", deviation(*place)),
                    flat(&scene.driven),
                )
            })
            .collect(),
    })
}

/// The two axes that move most there.
fn plane(scene: &Scene) -> [usize; 2] {
    let count = scene.letters().len();
    let extent = |axis: usize| {
        let values = || {
            scene
                .programmed
                .iter()
                .chain(&scene.driven)
                .flatten()
                .map(|point| point[axis])
        };
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    let mut axes: Vec<usize> = (0..count).collect();
    axes.sort_by(|a, b| extent(*b).total_cmp(&extent(*a)));
    let mut plane = [
        axes.first().copied().unwrap_or(0),
        axes.get(1).or(axes.first()).copied().unwrap_or(0),
    ];
    plane.sort_unstable();
    plane
}
