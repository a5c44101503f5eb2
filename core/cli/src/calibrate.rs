//! `tandem calibrate`.

use std::error::Error;
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

use tandem_estimate::diagnose::{Evidence, Fitted, LinearFit, MAX_RMS, MIN_R2, fit_all, linear};
use tandem_estimate::experiment::{Experiment, Measured};
use tandem_estimate::planned::{self, PlannerKind};
use tandem_estimate::polygon::{STROKE, Timed};
use tandem_estimate::{Choice, measurements, model_file};
use tandem_host::with_stand_ins;
use tandem_machine::Machine;
use tandem_recorder::Output;

use crate::args::{self, Form};
use crate::{FAULT, REFUSED, built_in, clock};

/// Blocks to each polygon where the control's own clock measures.
const BLOCKS_MEASURED: u32 = 400;
/// Blocks to each polygon where a person measures: as many as in the paper.
const BLOCKS_TIMED: u32 = 2000;

/// Runs the experiment, or takes its times from a file, and fits a model.
pub fn calibrate(options: &args::Calibrate) -> Result<u8, Box<dyn Error>> {
    let machine = Machine::read(&options.machine.file.path, &options.machine.file.overrides)?;
    if let Some(path) = &options.program {
        return program(path, &machine);
    }
    let measured = measure(options, &machine)?;
    let elsewhere = options.from.is_some() || options.log.is_some();
    let tick_s = (!elsewhere).then_some(machine.fine_period_s);
    let mut fits = fit_all(&measured.timed, tick_s);
    fits.extend(planners(options, &machine, &measured, &fits)?);
    let evidence = Evidence::of(&measured.timed);
    print(&table(&measured, &evidence, &fits));
    match chosen(options, &measured, &evidence, &fits) {
        Ok(fitted) => {
            print(&residuals(&fitted, &measured.timed));
            if let Err(cause) = write(options, &machine, &fitted) {
                // The experiment is over, and what it has found stands above.
                say!("error: {cause}");
                return Ok(FAULT);
            }
            Ok(0)
        }
        Err(cause) => {
            say!("refused: {cause}");
            Ok(REFUSED)
        }
    }
}

/// Fits of the planners here, where one is asked for or no closed form comes close.
fn planners(
    options: &args::Calibrate,
    machine: &Machine,
    measured: &Measured,
    closed: &[Fitted],
) -> Result<Vec<Fitted>, Box<dyn Error>> {
    let kinds: &[PlannerKind] = match options.model {
        Some(Form::Smooth) => &[PlannerKind::Smooth],
        Some(Form::BlockOverlap) => &[PlannerKind::BlockOverlap],
        None if closed.iter().all(Fitted::is_loose) => &PlannerKind::ALL,
        _ => &[],
    };
    let registry = built_in::registry()?;
    let mut fits = vec![];
    for kind in kinds {
        say!(
            "fitting {}: it plans the polygons again and again",
            kind.name()
        );
        let (planned, times_s) = planned::fit(machine, &registry, &measured.timed, *kind)?;
        let choice = Choice::Planned(planned);
        fits.push(Fitted::with_times(choice, &times_s, &measured.timed));
    }
    Ok(fits)
}

/// A reader that has gone away (a closed pipe) is no reason to fail.
fn print(text: &str) {
    let _ = std::io::stdout().write_all(text.as_bytes());
}

/// Writes the experiment as a program.
fn program(path: &Path, machine: &Machine) -> Result<u8, Box<dyn Error>> {
    let experiment = Experiment::new(machine, BLOCKS_TIMED)?;
    let mut out = Output::create(path)?;
    out.write_all(experiment.program(true).as_bytes())?;
    out.finish()?;
    let (count, name) = (experiment.polygons.len(), path.display());
    print(&format!(
        "{name}: {count} polygons and lines there and back, an M0 before each; write what they take to a CSV file with the columns\n\
         n,side_mm,repetitions,seconds,reading_error_s,feed_mm_per_min,axis,exact_stop\n(a line there and back has n 2, and its axis is X or Y; reading_error_s may be left out, and a feed of 5000)\nand come back with --from, or with --log where the control logs times and lines\n"
    ));
    left_out(&experiment);
    Ok(0)
}

fn left_out(experiment: &Experiment) {
    if !experiment.left_out.is_empty() {
        say!(
            "{} polygons do not fit into the travel and are left out",
            experiment.left_out.len()
        );
    }
}

fn measure(options: &args::Calibrate, machine: &Machine) -> Result<Measured, Box<dyn Error>> {
    if let Some(path) = &options.from {
        let corners = options.corners.as_deref();
        let corners = corners.map(measurements::read_corners).transpose()?;
        return Ok(Measured {
            timed: measurements::read(path)?,
            corners: corners.unwrap_or_default(),
        });
    }
    if let Some(path) = &options.log {
        let experiment = Experiment::new(machine, BLOCKS_TIMED)?;
        let timed = experiment.timed(&measurements::read_log(path)?);
        return Ok(Measured {
            timed: timed.map_err(|cause| format!("{}: {cause}", path.display()))?,
            ..Measured::default()
        });
    }
    let experiment = Experiment::new(machine, BLOCKS_MEASURED)?;
    left_out(&experiment);
    let registry = built_in::registry()?;
    let (machine, notes) = with_stand_ins(machine, &registry, None)
        .map_err(|refused| format!("{refused}: state one, or give its times with --from"))?;
    for note in &notes {
        say!("{note}");
    }
    let clock = clock::of(options.clock, &machine, &registry);
    Ok(experiment.run(&machine, &registry, clock)?)
}

fn table(measured: &Measured, evidence: &Evidence, fits: &[Fitted]) -> String {
    let is_stroke = |timed: &&Timed| timed.polygon.is_stroke();
    let strokes = measured.timed.iter().filter(is_stroke).count();
    let (polygons, corners) = (measured.timed.len() - strokes, measured.corners.len());
    let mut text = format!(
        "measured: {polygons} polygons, {strokes} lines there and back, {corners} minimum feeds at corners\n"
    );
    let percent = |share: f64| 100.0 * share;
    let _ = writeln!(
        text,
        "sides up to 1 mm: the time of a block differs by {:.1} % with the side, the mean feed by {:.0} %",
        percent(evidence.block_time_spread),
        percent(evidence.feed_spread)
    );
    let reading = fits.first().map_or(0.0, |fit| fit.reading);
    if reading > 0.0 {
        let _ = writeln!(
            text,
            "readings may be off by {:.2} % (rms): no form can be told to be better than that",
            percent(reading)
        );
    }
    let _ = writeln!(
        text,
        "{:13} {:>10} {:>9} {:>9}  constants",
        "form", "R2", "rms, %", "worst, %"
    );
    for fit in fits {
        let worst = fit
            .residuals
            .iter()
            .fold(0.0, |most, r| f64::max(most, r.abs()));
        let (name, r2, rms) = (fit.choice.name(), fit.feeds.r2, percent(fit.rms));
        let _ = writeln!(
            text,
            "{name:13} {r2:10.6} {rms:9.3} {:9.3}  {}",
            percent(worst),
            fit.constants()
        );
    }
    text
}

/// What a fit leaves. A planner has more constants, with which it comes a little closer to readings that are off.
fn simple_first(fit: &Fitted) -> f64 {
    match fit.choice {
        Choice::Planned(_) => 1.15 * fit.rms,
        _ => fit.rms,
    }
}

/// What the machine is, in words.
fn kind(evidence: &Evidence, fits: &[Fitted]) -> &'static str {
    if evidence.is_constant_time() {
        return "an overlap control: a short block takes the same time whatever its length";
    }
    let look_ahead = fits
        .iter()
        .any(|fit| matches!(fit.choice, Choice::LookAhead(..)) && fit.is_good());
    let closest = fits
        .iter()
        .min_by(|a, b| simple_first(a).total_cmp(&simple_first(b)));
    let closest = closest.filter(|fit| fit.is_good()).map(|fit| &fit.choice);
    if let Some(Choice::Planned(planned)) = closest {
        return match planned.kind {
            PlannerKind::Smooth => {
                "a control that bounds jerk and rounds corners within a tolerance"
            }
            PlannerKind::BlockOverlap => "a control whose blocks overlap within a tolerance",
        };
    }
    if look_ahead {
        "a look-ahead control: the feed at a corner depends on the turn, not on the length of the block"
    } else {
        "neither an overlap nor a look-ahead control of a form that is known here"
    }
}

/// The model to be written; why there is none.
fn chosen(
    options: &args::Calibrate,
    measured: &Measured,
    evidence: &Evidence,
    fits: &[Fitted],
) -> Result<Fitted, String> {
    let (form, kind) = (options.model, kind(evidence, fits));
    print(&format!("this is {kind}\n"));
    if form == Some(Form::Regression) {
        return regression(measured, evidence, fits, kind);
    }
    let of_form = |fit: &&Fitted| match (form, &fit.choice) {
        (Some(Form::Overlap), choice) => matches!(choice, Choice::Overlap(_)),
        (Some(Form::LookAhead), choice) => matches!(choice, Choice::LookAhead(..)),
        (Some(Form::Smooth | Form::BlockOverlap), choice) => matches!(choice, Choice::Planned(_)),
        _ => true,
    };
    let best = fits
        .iter()
        .filter(of_form)
        .min_by(|a, b| simple_first(a).total_cmp(&simple_first(b)))
        .ok_or("there is nothing to fit")?;
    if best.is_good() {
        return Ok(best.clone());
    }
    let name = best.choice.name();
    if options.accept {
        say!(
            "accepted: {name} is off by {:.1} % (rms) of the times that were measured, and so will be what it estimates",
            100.0 * best.rms
        );
        return Ok(best.clone());
    }
    Err(format!(
        "the best fit is {name}, with R2 {:.4} and a residual of {:.1} % (rms), where {MIN_R2} and {:.0} % are asked for: \
         this is {kind}. A machine that Tandem drives is estimated exactly with --model simulate; --accept takes the fit as it is.",
        best.feeds.r2,
        100.0 * best.rms,
        100.0 * MAX_RMS
    ))
}

fn regression(
    measured: &Measured,
    evidence: &Evidence,
    fits: &[Fitted],
    kind: &str,
) -> Result<Fitted, String> {
    let block_time_s = fits
        .iter()
        .filter(|fit| fit.is_good())
        .find_map(|fit| match &fit.choice {
            Choice::Overlap(constants) => Some(constants.time_constant_s),
            _ => None,
        });
    let LinearFit {
        coefficients,
        short,
        long,
    } = linear(&measured.timed, &measured.corners, block_time_s)?;
    print(&format!(
        "equation (9): R2 {:.6}, rms {:.2}, worst {:.2} mm/min\n",
        short.r2, short.rms, short.max
    ));
    if let Some(long) = long {
        print(&format!(
            "equation (11): R2 {:.6}, rms {:.2}, worst {:.2} mm/min\n",
            long.r2, long.rms, long.max
        ));
    } else {
        print("equation (11): no corners were measured; the published coefficients stay\n");
    }
    if short.r2 < MIN_R2
        || long.is_some_and(|long| long.r2 < MIN_R2)
        || !evidence.is_constant_time()
    {
        return Err(format!(
            "the linear regression does not describe this machine: equation (9) explains R2 = {:.3} of the minimum feeds, \
             where {MIN_R2} is asked for. It holds where a short block takes the same time whatever its length; here that \
             time differs by {:.0} % between sides of one polygon. This is {kind}. Leave --model out for the form that fits.",
            short.r2,
            100.0 * evidence.block_time_spread
        ));
    }
    Ok(Fitted::new(
        Choice::Regression(coefficients),
        &measured.timed,
    ))
}

/// Residuals of the times in %, a row for each number of corners, a column for each side.
fn residuals(fitted: &Fitted, timed: &[Timed]) -> String {
    let mut sides: Vec<f64> = timed.iter().map(|t| t.polygon.side_mm).collect();
    let row = |timed: &Timed| (timed.polygon.corners, timed.polygon.along);
    let mut rows: Vec<_> = timed.iter().map(row).collect();
    sides.sort_by(f64::total_cmp);
    sides.dedup();
    rows.sort_by_key(|(corners, along)| (*corners, along.letter()));
    rows.dedup();
    let mut text = format!(
        "residuals of {}, % of the time\n  n \\ side, mm",
        fitted.choice.name()
    );
    for side in &sides {
        let _ = write!(text, " {side:8}");
    }
    for (corners, along) in rows {
        let name = match corners {
            STROKE => format!("{corners}, along {}", along.letter()),
            _ => corners.to_string(),
        };
        let _ = write!(text, "\n{name:>13}");
        for side in &sides {
            let at = timed
                .iter()
                .position(|t| row(t) == (corners, along) && t.polygon.side_mm == *side);
            let _ = match at.map(|index| 100.0 * fitted.residuals[index]) {
                Some(percent) => write!(text, " {percent:8.3}"),
                None => write!(text, " {:>8}", "-"),
            };
        }
    }
    text + "\n"
}

fn write(
    options: &args::Calibrate,
    machine: &Machine,
    fitted: &Fitted,
) -> Result<(), Box<dyn Error>> {
    let Some(path) = &options.out else {
        return Ok(());
    };
    let source = options
        .from
        .as_ref()
        .or(options.log.as_ref())
        .map_or_else(|| machine.name.clone(), |from| from.display().to_string());
    let (r2, rms) = (fitted.feeds.r2, 100.0 * fitted.rms);
    let accepted = if fitted.is_good() { "" } else { ", accepted" };
    let calibrated = format!(
        "{source}: {} polygons, R2 {r2:.6}, rms {rms:.3} %{accepted}",
        fitted.residuals.len()
    );
    let text = model_file::write(&fitted.choice, &calibrated).ok_or("this model has no file")?;
    let mut out = Output::create(path)?;
    out.write_all(text.as_bytes())?;
    out.finish()?;
    print(&format!(
        "model: {} ({}, {})\n",
        path.display(),
        fitted.choice.name(),
        fitted.constants()
    ));
    Ok(())
}
