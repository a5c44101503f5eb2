//! Which kind of control it is, from the times of polygons; and the fit of its model.

use std::collections::BTreeMap;

use tandem_sdk::MAX_AXES;

use crate::choice::Choice;
use crate::fit::{Goodness, least_squares, positive_parameters};
use crate::junction::Rule;
use crate::overlap::Constants;
use crate::polygon::Timed;
use crate::regression::{CORRECTED_LONG, Coefficients, Switch, long_terms};

/// Least share of the variance of the mean feeds that a model has to explain.
pub const MIN_R2: f64 = 0.99;
/// Greatest root mean square of the relative residuals of the times.
pub const MAX_RMS: f64 = 0.03;

/// Residuals are within this many times what readings may be off.
const READINGS: f64 = 1.5;
/// Residual above which planners are tried, too.
const LOOSE_RMS: f64 = 0.004;

/// By how much the fit may be worse with blocks of whole ticks, where the control's period is known.
const TICK_RMS: f64 = 1e-3;
/// Share of the residual of one acceleration for all axes that accelerations of their own have to leave, to be worth a third
/// constant.
const WORTH_OF_AXES: f64 = 0.8;
const MM_PER_MIN: f64 = 60.0;

/// A minimum feed measured between two long blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Turn, rad.
    pub turn_rad: f64,
    /// Programmed feed, mm/s.
    pub feed_mm_per_s: f64,
    /// Minimum feed, mm/s.
    pub min_mm_per_s: f64,
    /// How far the reading may be off, mm/s; 0 where nothing is known of that.
    pub reading_error_mm_per_s: f64,
}

impl Corner {
    /// How much it counts beside one that is known to a part in a thousand.
    fn weight(&self) -> f64 {
        let sure = 1e-3 * self.feed_mm_per_s;
        sure / self.reading_error_mm_per_s.max(sure)
    }
}

/// A model fitted to measurements.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The model.
    pub choice: Choice,
    /// Of the mean feeds, mm/s.
    pub feeds: Goodness,
    /// Relative residuals of the times, model over measurement less one, in the order of the measurements.
    pub residuals: Vec<f64>,
    /// Root of their mean square.
    pub rms: f64,
    /// Root of the mean square of the relative reading errors; 0 where none are known.
    pub reading: f64,
}

impl Fitted {
    /// `choice` against the times.
    pub fn new(choice: Choice, timed: &[Timed]) -> Self {
        let times = times_s(&choice, timed);
        Self::with_times(choice, &times, timed)
    }

    /// `choice`, under which they take `times`, s, against the times.
    pub fn with_times(choice: Choice, times: &[f64], timed: &[Timed]) -> Self {
        let feed = |t: &Timed, time_s: f64| t.mean_feed_mm_per_s() * t.time_s / time_s;
        let pairs: Vec<_> = timed
            .iter()
            .zip(times)
            .map(|(t, s)| (feed(t, *s), t.mean_feed_mm_per_s()))
            .collect();
        let residuals: Vec<_> = timed
            .iter()
            .zip(times)
            .map(|(t, s)| s / t.time_s - 1.0)
            .collect();
        let rms =
            (residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len().max(1) as f64).sqrt();
        Self {
            choice,
            feeds: Goodness::of(&pairs),
            residuals,
            rms,
            reading: (timed.iter().map(|t| t.reading_error().powi(2)).sum::<f64>()
                / timed.len().max(1) as f64)
                .sqrt(),
        }
    }

    /// Whether it describes the machine, as far as the readings let anybody see.
    pub fn is_good(&self) -> bool {
        self.feeds.r2 >= MIN_R2 && self.rms <= MAX_RMS.max(READINGS * self.reading)
    }

    /// Whether there may be a form that is closer: what is left is more than readings are off, where that is known.
    pub fn is_loose(&self) -> bool {
        !self.is_good() || self.rms > LOOSE_RMS.max(READINGS * self.reading)
    }

    /// Its constants, in a line.
    pub fn constants(&self) -> String {
        match &self.choice {
            Choice::Simulate => String::new(),
            Choice::Planned(planned) => planned.constants(),
            Choice::Overlap(c) => format!("time constant {:.3} ms", c.time_constant_s * 1e3),
            Choice::LookAhead(
                Rule::Tangent {
                    acceleration_mm_per_s2,
                    period_s,
                    speed_difference_mm_per_s,
                },
                _,
            ) => {
                let a = acceleration_mm_per_s2.unwrap_or(f64::INFINITY);
                format!(
                    "junction max({:.3}/(1 - cos θ), {:.3}) mm/min, acceleration {a:.2} mm/s²",
                    a * period_s * MM_PER_MIN,
                    speed_difference_mm_per_s * MM_PER_MIN
                )
            }
            Choice::LookAhead(
                Rule::Axis {
                    acceleration_mm_per_s2,
                    speed_difference_mm_per_s,
                },
                _,
            ) => {
                let [x, y] = [acceleration_mm_per_s2[0], acceleration_mm_per_s2[1]];
                let acceleration = if x == y {
                    format!("{x:.2} mm/s²")
                } else {
                    format!("{x:.2} mm/s² along X and {y:.2} along Y")
                };
                format!(
                    "per axis speed difference {:.3} mm/min, acceleration {acceleration}",
                    speed_difference_mm_per_s[0] * MM_PER_MIN
                )
            }
            Choice::Regression(c) => format!(
                "F_m = {:.3} + {:.3} d + {:.3} θ mm/min up to the feed's way in the block time",
                c.short[0], c.short[1], c.short[2]
            ),
        }
    }
}

fn times_s(choice: &Choice, timed: &[Timed]) -> Vec<f64> {
    timed
        .iter()
        .map(|t| {
            choice
                .model()
                .map_or(f64::NAN, |mut model| t.under(model.as_mut()))
        })
        .collect()
}

/// What the measurements say by themselves.
#[derive(Clone, Copy, Debug)]
pub struct Evidence {
    /// By how much the block time differs between the sides up to 1 mm of one polygon, as a share of the least: the mean
    /// over the polygons.
    pub block_time_spread: f64,
    /// The same of the mean feed, at the longest side of each polygon against the shortest.
    pub feed_spread: f64,
}

impl Evidence {
    /// From the times.
    pub fn of(timed: &[Timed]) -> Self {
        let spread = |of: &dyn Fn(&Timed) -> f64| {
            let mut by_corners: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
            let counts = |t: &&Timed| t.polygon.side_mm <= 1.0 && !t.polygon.is_stroke();
            for t in timed.iter().filter(counts) {
                let [least, most] = by_corners
                    .entry(t.polygon.corners)
                    .or_insert([f64::INFINITY, 0.0]);
                (*least, *most) = (least.min(of(t)), most.max(of(t)));
            }
            by_corners
                .values()
                .map(|[least, most]| most / least - 1.0)
                .sum::<f64>()
                / by_corners.len().max(1) as f64
        };
        Self {
            block_time_spread: spread(&Timed::block_s),
            feed_spread: spread(&Timed::mean_feed_mm_per_s),
        }
    }

    /// Whether short blocks take the same time whatever their length.
    pub fn is_constant_time(&self) -> bool {
        self.block_time_spread < 0.15 && self.block_time_spread < self.feed_spread / 4.0
    }
}

/// Fits the forms that a control may have to the times. `tick_s` is the control's period where it is known.
pub fn fit_all(timed: &[Timed], tick_s: Option<f64>) -> Vec<Fitted> {
    let plain = Fitted::new(overlap(timed, None), timed);
    // The polygons hardly tell ticks from none; programs with long blocks do.
    let ticks = tick_s.map(|tick_s| Fitted::new(overlap(timed, Some(tick_s)), timed));
    let mut all = vec![
        ticks
            .filter(|ticks| ticks.rms <= plain.rms + TICK_RMS)
            .unwrap_or(plain),
    ];
    all.push(Fitted::new(tangent(timed), timed));
    let alike = by_axes(timed);
    let each = Fitted::new(by_each_axis(timed, &alike), timed);
    let alike = Fitted::new(alike, timed);
    all.push(if each.rms < WORTH_OF_AXES * alike.rms {
        each
    } else {
        alike
    });
    all
}

/// Gauss-Newton needs a start near enough: the best of a few accelerations, mm/s².
fn start<const N: usize>(
    timed: &[Timed],
    from: impl Fn(f64) -> [f64; N],
    with: impl Fn(&[f64; N]) -> Choice,
) -> [f64; N] {
    let starts = [50.0, 200.0, 800.0, 3200.0].map(|a| {
        let parameters = from(a);
        (
            ratios(&with(&parameters), timed)
                .iter()
                .map(|r| r * r)
                .sum::<f64>(),
            parameters,
        )
    });
    starts
        .into_iter()
        .min_by(|(a, _), (b, _)| a.total_cmp(b))
        .expect("there is a start")
        .1
}

/// Logarithms of the ratios of times: a residual that means the same for long and for short times.
fn ratios(choice: &Choice, timed: &[Timed]) -> Vec<f64> {
    times_s(choice, timed)
        .iter()
        .zip(timed)
        .map(|(s, t)| (s / t.time_s).ln() * t.weight())
        .collect()
}

fn overlap(timed: &[Timed], tick_s: Option<f64>) -> Choice {
    let with = |time_constant_s: f64, tick_s| {
        let rapid_acceleration_mm_per_s2 = None;
        Choice::Overlap(Constants {
            time_constant_s,
            obeys_program: false,
            tick_s,
            rapid_acceleration_mm_per_s2,
        })
    };
    let least = timed
        .iter()
        .map(Timed::block_s)
        .fold(f64::INFINITY, f64::min);
    let [time_constant_s] = positive_parameters([least], |[s]| ratios(&with(*s, None), timed));
    let whole_s = tick_s.map(|tick_s| (time_constant_s / tick_s).round().max(1.0) * tick_s);
    with(whole_s.unwrap_or(time_constant_s), tick_s)
}

fn tangent(timed: &[Timed]) -> Choice {
    let with = |[a, period_s, v]: &[f64; 3]| {
        let rule = Rule::Tangent {
            acceleration_mm_per_s2: Some(*a),
            period_s: *period_s,
            speed_difference_mm_per_s: *v,
        };
        Choice::LookAhead(rule, None)
    };
    with(&positive_parameters(
        start(timed, |a| [a, 1e-3, 2.0], with),
        |p| ratios(&with(p), timed),
    ))
}

fn by_axes(timed: &[Timed]) -> Choice {
    let with = |[a, v]: &[f64; 2]| {
        let (acceleration_mm_per_s2, speed_difference_mm_per_s) = ([*a; MAX_AXES], [*v; MAX_AXES]);
        Choice::LookAhead(
            Rule::Axis {
                acceleration_mm_per_s2,
                speed_difference_mm_per_s,
            },
            None,
        )
    };
    with(&positive_parameters(
        start(timed, |a| [a, 2.0], with),
        |p| ratios(&with(p), timed),
    ))
}

/// The same with an acceleration for X and one for Y; further axes, which the polygons do not move, have the lesser. From where
/// `alike`, with one for all, fits best.
fn by_each_axis(timed: &[Timed], alike: &Choice) -> Choice {
    let with = |[x, y, v]: &[f64; 3]| {
        let mut acceleration_mm_per_s2 = [x.min(*y); MAX_AXES];
        (acceleration_mm_per_s2[0], acceleration_mm_per_s2[1]) = (*x, *y);
        let rule = Rule::Axis {
            acceleration_mm_per_s2,
            speed_difference_mm_per_s: [*v; MAX_AXES],
        };
        Choice::LookAhead(rule, None)
    };
    let (a, v) = match alike {
        Choice::LookAhead(
            Rule::Axis {
                acceleration_mm_per_s2,
                speed_difference_mm_per_s,
            },
            _,
        ) => (acceleration_mm_per_s2[0], speed_difference_mm_per_s[0]),
        _ => (800.0, 2.0),
    };
    let square = |p: &[f64; 3]| ratios(&with(p), timed).iter().map(|r| r * r).sum::<f64>();
    let found = [[a / 2.0, 2.0 * a, v], [2.0 * a, a / 2.0, v]]
        .map(|start| positive_parameters(start, |p| ratios(&with(p), timed)));
    let best = found
        .into_iter()
        .min_by(|one, other| square(one).total_cmp(&square(other)));
    with(&best.unwrap_or([a, a, v]))
}

/// The linear regression (9) with the minimum feeds of (7) and (8), and (11) where corners were measured.
#[derive(Clone, Debug)]
pub struct LinearFit {
    /// The coefficients.
    pub coefficients: Coefficients,
    /// Of equation (9), mm/min.
    pub short: Goodness,
    /// Of equation (11), mm/min, where corners were measured.
    pub long: Option<Goodness>,
}

/// Fits the published regression. `block_time_s` is what short blocks take: longer ones do not enter equation (9), nor do strokes,
/// for it was published for turns of up to 120°.
///
/// # Errors
/// Too few measurements.
pub fn linear(
    timed: &[Timed],
    corners: &[Corner],
    block_time_s: Option<f64>,
) -> Result<LinearFit, String> {
    let mut coefficients = Coefficients {
        rapid_acceleration_mm_per_s2: None,
        ..Coefficients::default()
    };
    let a = coefficients.acceleration_mm_per_s2;
    let short = |t: &&Timed| {
        !t.polygon.is_stroke()
            && block_time_s.is_none_or(|s| t.polygon.side_mm <= 0.999 * s * t.polygon.feed_mm_per_s)
    };
    let (rows, feeds): (Vec<_>, Vec<_>) = timed
        .iter()
        .filter(short)
        .map(|t| {
            (
                [1.0, t.polygon.side_mm / 2.0, t.polygon.turn_rad()],
                t.minimum_feed_mm_per_s(a) * MM_PER_MIN,
            )
        })
        .unzip();
    coefficients.short = least_squares(&rows, &feeds).map_err(|e| format!("equation (9): {e}"))?;
    if let Some(block_time_s) = block_time_s {
        (coefficients.switch, coefficients.ramp_s) =
            (Switch::Moving(block_time_s), Some(block_time_s));
    }
    let pair =
        |(row, feed): (&[f64; 3], &f64)| (coefficients.short_mm_per_min(row[1], row[2]), *feed);
    let short = Goodness::of(&rows.iter().zip(&feeds).map(pair).collect::<Vec<_>>());
    let long = (!corners.is_empty())
        .then(|| long_form(&mut coefficients, corners))
        .transpose()?;
    Ok(LinearFit {
        coefficients,
        short,
        long,
    })
}

fn long_form(coefficients: &mut Coefficients, corners: &[Corner]) -> Result<Goodness, String> {
    coefficients.long = CORRECTED_LONG;
    let weighted = |c: &Corner| {
        let terms = long_terms(c.turn_rad, c.feed_mm_per_s * MM_PER_MIN);
        terms.map(|term| term * c.weight())
    };
    let rows: Vec<_> = corners.iter().map(weighted).collect();
    let feeds: Vec<_> = corners
        .iter()
        .map(|c| c.min_mm_per_s * MM_PER_MIN)
        .collect();
    let targets: Vec<_> = corners
        .iter()
        .zip(&feeds)
        .map(|(c, feed)| feed * c.weight())
        .collect();
    coefficients.long =
        least_squares(&rows, &targets).map_err(|e| format!("equation (11): {e}"))?;
    let pair = |(c, feed): (&Corner, &f64)| {
        (
            coefficients.long_mm_per_min(c.turn_rad, c.feed_mm_per_s * MM_PER_MIN),
            *feed,
        )
    };
    Ok(Goodness::of(
        &corners.iter().zip(&feeds).map(pair).collect::<Vec<_>>(),
    ))
}
