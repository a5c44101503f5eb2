//! Estimates as text: a table for people, a list for programs.

use std::fmt::Write as _;

use serde_json::{Value, json};
use tandem_estimate::measured::{Beside, causes};
use tandem_estimate::measurements::ProgramTime;
use tandem_estimate::{Estimate, Part};

/// The table, with a row for each tool where there are several.
pub fn table(estimates: &[Estimate]) -> String {
    if estimates.is_empty() {
        return String::new();
    }
    let widest = estimates
        .iter()
        .map(|e| e.program.chars().count())
        .max()
        .unwrap_or(0)
        .max(7);
    let mut text = format!(
        "{:widest$}  {:10} {:>11} {:>11} {:>6} {:>9} {:>11} {:>9} {:>9} {:>9} {:>9}\n",
        "program",
        "model",
        "nominal, s",
        "estimate, s",
        "ratio",
        "rapid, s",
        "cutting, s",
        "dwell, s",
        "blocks",
        "long",
        "short"
    );
    for estimate in estimates {
        let tally = &estimate.tally;
        let (long, short) = tally.long_and_short();
        let _ = writeln!(
            text,
            "{:widest$}  {:10} {:11.3} {:11.3} {:6.3} {:9.3} {:11.3} {:9.3} {:9} {long:9} {short:9}",
            estimate.program,
            estimate.model,
            tally.all.nominal_s,
            estimate.estimated_s,
            share(estimate.estimated_s, tally.all.nominal_s),
            tally.rapid.time_s,
            tally.cutting.time_s,
            tally.dwell.time_s,
            tally.all.blocks
        );
        for (tool, part) in tally.tools.iter().filter(|_| tally.tools.len() > 1) {
            let percent = 100.0 * share(part.time_s, tally.all.time_s);
            let tool = format!("  tool {tool}: {percent:.1} %");
            let _ = writeln!(
                text,
                "{tool:widest$}  {:10} {:11.3} {:11.3}",
                "", part.nominal_s, part.time_s
            );
        }
    }
    if let [_, _, ..] = estimates {
        let sum = |of: &dyn Fn(&Estimate) -> f64| estimates.iter().map(of).sum::<f64>();
        let (nominal, estimated) = (sum(&|e| e.tally.all.nominal_s), sum(&|e| e.estimated_s));
        let _ = writeln!(
            text,
            "{:widest$}  {:10} {nominal:11.3} {estimated:11.3}",
            "all", ""
        );
    }
    text
}

/// The estimates beside what was measured, where anything was, and what the differences come from.
pub fn beside(estimates: &[Estimate], measured: &[ProgramTime]) -> String {
    let pairs: Vec<(&Estimate, Beside)> = estimates
        .iter()
        .filter_map(|estimate| Some((estimate, Beside::of(estimate, measured)?)))
        .collect();
    if pairs.is_empty() {
        return String::new();
    }
    let widest = pairs
        .iter()
        .map(|(estimate, _)| estimate.program.chars().count())
        .max()
        .unwrap_or(0)
        .max(7);
    let mut text = format!(
        "\n{:widest$}  {:>11} {:>11} {:>8}\n",
        "program", "measured, s", "estimate, s", "off, %"
    );
    for (estimate, beside) in &pairs {
        let within = if beside.is_within_reading() {
            "  within the reading"
        } else {
            ""
        };
        let _ = writeln!(
            text,
            "{:widest$}  {:11.3} {:11.3} {:+8.2}{within}",
            estimate.program,
            beside.measured_s,
            beside.estimated_s,
            100.0 * beside.residual()
        );
    }
    match causes(&pairs) {
        Ok(causes) => {
            for cause in causes {
                let _ = writeln!(
                    text,
                    "{}: {:+.3} ms for each {}",
                    cause.name,
                    1e3 * cause.missing_s,
                    cause.unit
                );
            }
        }
        Err(_) => {
            text.push_str("these programs are too few, or too much alike, to tell causes apart\n");
        }
    }
    text
}

/// The list as JSON.
pub fn json(estimates: &[Estimate], measured: &[ProgramTime]) -> String {
    let list: Vec<Value> = estimates
        .iter()
        .map(|estimate| {
            let mut value = object(estimate);
            if let Some(beside) = Beside::of(estimate, measured) {
                value["measured_s"] = beside.measured_s.into();
                value["reading_error_s"] = beside.reading_error_s.into();
            }
            value
        })
        .collect();
    format!("{:#}\n", Value::Array(list))
}

fn object(estimate: &Estimate) -> Value {
    let tally = &estimate.tally;
    let (long, short) = tally.long_and_short();
    let all_s = tally.all.time_s;
    let part = |part: &Part| {
        json!({ "time_s": part.time_s, "nominal_s": part.nominal_s, "blocks": part.blocks,
            "share": share(part.time_s, all_s) })
    };
    let with = |mut value: Value, entries: &[(&str, u32)]| {
        for (key, number) in entries {
            value[key] = (*number).into();
        }
        value
    };
    let tools: Vec<_> = tally
        .tools
        .iter()
        .map(|(tool, p)| with(part(p), &[("tool", *tool)]))
        .collect();
    let lines: Vec<_> = tally
        .lines()
        .map(|(first, last, p)| with(part(p), &[("first_line", first), ("last_line", last)]))
        .collect();
    json!({
        "program": estimate.program,
        "model": estimate.model,
        "nominal_s": tally.all.nominal_s,
        "estimated_s": estimate.estimated_s,
        "rapid_s": tally.rapid.time_s,
        "cutting_s": tally.cutting.time_s,
        "dwell_s": tally.dwell.time_s,
        "blocks": tally.all.blocks,
        "length_mm": tally.length_mm,
        "cases": {
            "1": tally.cases[0], "2": tally.cases[1], "3": tally.cases[2], "4": tally.cases[3],
            "long": long, "short": short,
        },
        "shares": {
            "rapid": share(tally.rapid.time_s, all_s),
            "cutting": share(tally.cutting.time_s, all_s),
            "dwell": share(tally.dwell.time_s, all_s),
            "tools": tools,
            "lines": lines,
        },
    })
}

/// A part of a whole; nothing of nothing is none of it.
pub fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}
