//! What grbl or grblHAL answers to `$$`.

use std::collections::BTreeMap;

use super::draft::{Draft, DraftAxis, number as shown};
use super::new::number;
use super::{AtLine, Taken};

/// Axes in the order of grbl's settings.
const AXES: &str = "xyzabcuvw";
/// First settings of what each axis has: steps a mm, highest rate, acceleration, travel.
const STEPS: u32 = 100;
const RATE: u32 = 110;
const ACCELERATION: u32 = 120;
const TRAVEL: u32 = 130;

/// A setting: its line and its value.
type Settings<'a> = BTreeMap<u32, (usize, &'a str)>;

/// Reads a dump.
///
/// # Errors
/// The lines that are wrong, and why.
pub fn read(text: &str, name: &str) -> Result<Taken, Vec<AtLine>> {
    let settings = settings(text)?;
    let mut wrong = vec![];
    let mut draft = Draft::new(name, "Taken over from grbl by tandem machine import.");
    for (letter, at) in AXES.chars().zip(0..) {
        if [RATE, ACCELERATION, TRAVEL]
            .iter()
            .any(|first| settings.contains_key(&(first + at)))
        {
            match axis(&settings, letter, at) {
                Ok(axis) => draft.axes.push(axis),
                Err(mut more) => wrong.append(&mut more),
            }
        }
    }
    if draft.axes.is_empty() && wrong.is_empty() {
        wrong.push(AtLine::new(
            1,
            "there is no $110, $120 and $130, the limits of x: this is no dump of $$",
        ));
    }
    let speed = |setting: u32| {
        let found = value(&settings, setting)?;
        found
            .filter(|(_, rpm)| *rpm > 0.0)
            .map_or(Ok(None), |(line, rpm)| {
                if rpm > 1e6 {
                    Err(AtLine::new(
                        line,
                        format!("${setting}={rpm} rpm is no speed of a spindle"),
                    ))
                } else {
                    Ok(Some(rpm))
                }
            })
    };
    match (speed(30), speed(31)) {
        (Ok(most), Ok(least)) => {
            draft.max_rpm = most;
            draft.min_rpm = least.filter(|least| most.is_none_or(|most| *least < most));
        }
        (most, least) => wrong.extend([most.err(), least.err()].into_iter().flatten()),
    }
    if !wrong.is_empty() {
        return Err(wrong);
    }
    homing(&settings, &mut draft);
    Ok(Taken {
        left: left(&settings, &draft),
        draft,
    })
}

/// The settings of a dump; a line of talk between is none.
fn settings(text: &str) -> Result<Settings<'_>, Vec<AtLine>> {
    let mut settings = BTreeMap::new();
    let mut wrong = vec![];
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.trim();
        let is_talk = ["ok", "$$", ">", "[", "<", "Grbl", "grbl", ";", "#"]
            .iter()
            .any(|talk| line.starts_with(talk));
        if line.is_empty() || is_talk {
            continue;
        }
        let setting = line.strip_prefix('$').and_then(|line| {
            let (setting, value) = line.split_once('=')?;
            Some((setting.trim().parse::<u32>().ok()?, value))
        });
        let Some((setting, value)) = setting else {
            wrong.push(AtLine::new(
                number,
                format!("{line:?} is no setting as $110=5000 is one"),
            ));
            continue;
        };
        // Older ones say behind the value what it is.
        let value = value.split('(').next().unwrap_or_default().trim();
        if let Some((before, _)) = settings.insert(setting, (number, value)) {
            wrong.push(AtLine::new(
                number,
                format!("${setting} is there twice, first in line {before}"),
            ));
        }
    }
    if wrong.is_empty() {
        Ok(settings)
    } else {
        Err(wrong)
    }
}

/// A setting as a number, with its line.
fn value(settings: &Settings<'_>, setting: u32) -> Result<Option<(usize, f64)>, AtLine> {
    let Some((line, text)) = settings.get(&setting) else {
        return Ok(None);
    };
    number(text)
        .map(|value| Some((*line, value)))
        .map_err(|why| AtLine::new(*line, format!("${setting}={text}: {why}")))
}

fn axis(settings: &Settings<'_>, letter: char, at: u32) -> Result<DraftAxis, Vec<AtLine>> {
    let somewhere = [RATE, ACCELERATION, TRAVEL]
        .iter()
        .find_map(|first| settings.get(&(first + at)))
        .map_or(1, |(line, _)| *line);
    let needed = |setting: u32| match value(settings, setting) {
        Err(wrong) => Err(wrong),
        Ok(Some((_, value))) if value > 0.0 => Ok(value),
        Ok(Some((line, value))) => Err(AtLine::new(
            line,
            format!("${setting}={value}: it is not above zero"),
        )),
        Ok(None) => Err(AtLine::new(
            somewhere,
            format!("axis {letter} has no ${setting}"),
        )),
    };
    match (
        needed(RATE + at),
        needed(ACCELERATION + at),
        // grblHAL shows the travel as the negative number that it is.
        needed(TRAVEL + at),
    ) {
        (Ok(rate), Ok(acceleration), Ok(travel)) => {
            // grbl's machine coordinates end at 0 and go to minus.
            Ok(DraftAxis::new(letter, [-travel, 0.0], rate, acceleration))
        }
        (rate, acceleration, travel) => Err([rate.err(), acceleration.err(), travel.err()]
            .into_iter()
            .flatten()
            .collect()),
    }
}

/// What grbl has of homing, for a table that still lacks the inputs.
fn homing(settings: &Settings<'_>, draft: &mut Draft) {
    let of = |setting: u32| {
        value(settings, setting)
            .ok()
            .flatten()
            .map(|(_, value)| value)
    };
    if of(22).is_none_or(|on| on == 0.0) {
        return;
    }
    let towards_minus = of(23).unwrap_or_default() as u64;
    for (at, axis) in draft.axes.iter_mut().enumerate() {
        let unit = if axis.rotary { "deg" } else { "mm" };
        let (sign, edge) = if towards_minus >> at & 1 == 1 {
            (-1.0, axis.travel[0])
        } else {
            (1.0, axis.travel[1])
        };
        let mut add = |key: String, value: Option<f64>| {
            if let Some(value) = value {
                axis.homing.push((key, shown(value)));
            }
        };
        add(format!("search_{unit}_per_min"), of(25).map(|v| sign * v));
        add(format!("latch_{unit}_per_min"), of(24));
        add(format!("back_off_{unit}"), of(27));
        add(format!("switch_{unit}"), Some(edge));
    }
}

/// The settings that have no place in the machine file, by line.
fn left(settings: &Settings<'_>, draft: &Draft) -> Vec<AtLine> {
    let axes = draft.axes.len() as u32;
    let mut left: Vec<AtLine> = settings
        .iter()
        .filter(|(setting, _)| {
            let of_axis = [RATE, ACCELERATION, TRAVEL]
                .iter()
                .any(|first| (*first..first + axes.max(9)).contains(*setting));
            !of_axis && ![30, 31].contains(*setting)
        })
        .map(|(setting, (line, value))| {
            AtLine::new(*line, format!("${setting}={value}: {}", reason(*setting)))
        })
        .collect();
    left.sort_by_key(|at| at.line);
    left
}

fn reason(setting: u32) -> &'static str {
    match setting {
        0..=9 | 29 | 37 => "steps, pins and their polarity are a matter of the driver",
        10 | 13 => "how the position is reported is a matter of the client",
        11 => "corners are driven within motion.path_tolerance_mm, not by a junction deviation",
        12 => "arcs are driven as arcs, not as chords",
        20 => "the travel is always kept",
        21 => "a limit switch is an input with the role limit (docs/faults.md)",
        22..=27 | 43..=47 => {
            "homing needs the input of each switch: the file has its speeds as remarks (docs/homing.md)"
        }
        32 => "there is no laser mode: M3 and S act where the path reaches them",
        STEPS..=109 => "steps a unit are a matter of the driver",
        _ => "it has no counterpart here",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DUMP: &str = "Grbl 1.1h ['$' for help]\n$$\n$11=0.010\n$22=1\n$23=1\n$24=25.000\n$25=500.000\n$27=1.000\n$30=12000\n$31=0\n\
                        $100=250.000\n$110=5000.000 (x max rate, mm/min)\n$111=4000\n$120=500.000\n$121=400.5\n$130=300.000\n$131=200.000\nok\n";

    #[test]
    fn limits_are_taken_over_and_the_rest_is_said() {
        let Ok(Taken { draft, left }) = read(DUMP, "router") else {
            panic!("it is refused")
        };
        let axes: Vec<_> = draft
            .axes
            .iter()
            .map(|a| (a.letter, a.travel, a.feed, a.acceleration))
            .collect();
        assert_eq!(
            axes,
            [
                ('x', [-300.0, 0.0], 5000.0, 500.0),
                ('y', [-200.0, 0.0], 4000.0, 400.5)
            ]
        );
        assert_eq!((draft.max_rpm, draft.min_rpm), (Some(12000.0), None));
        let lines: Vec<usize> = left.iter().map(|at| at.line).collect();
        assert_eq!(lines, [3, 4, 5, 6, 7, 8, 11]);
        assert!(left[0].why.contains("path_tolerance"));
        let searches: Vec<_> = draft.axes.iter().map(|a| a.homing[0].1.as_str()).collect();
        assert_eq!(searches, ["-500", "500"]);
        assert_eq!(draft.planner(), "block-overlap");
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        for (dump, line, why) in [
            ("$110=fast\n$120=1\n$130=1\n", 1, "\"fast\" is no number"),
            ("$110=1\n$120=0\n$130=1\n", 2, "not above zero"),
            ("$110=1\n\n$120=5\n", 1, "axis x has no $130"),
            ("hello\n", 1, "is no setting"),
            ("$110=1\n$110=2\n", 2, "twice, first in line 1"),
            ("ok\n", 1, "no dump"),
            (
                "$110=1e99\n$120=1\n$130=1\n",
                1,
                "no number that a machine has",
            ),
            (
                "$110=1\n$120=1\n$130=1\n$30=1e8\n",
                4,
                "no speed of a spindle",
            ),
        ] {
            let Err(wrong) = read(dump, "m") else {
                panic!("{dump:?} is taken")
            };
            assert!(
                wrong
                    .iter()
                    .any(|at| at.line == line && at.why.contains(why)),
                "{dump:?}: {wrong:?}"
            );
        }
    }
}
