//! Jobs and alarms: as clients ask for them, and as they last.

use std::collections::VecDeque;

use serde_json::{Value, json};
use tandem_host::JobOutcome;
use tandem_state::{Alarm, Change, Driven, Job, JobEnd, JobKind, Outcome};

use super::dispatcher::{Dispatcher, Mode};
use super::persistence::{HELD, Remembered};
use super::request::Asked;

/// What was driven, and what went wrong.
pub struct History {
    /// The oldest first.
    jobs: VecDeque<Job>,
    alarms: VecDeque<Alarm>,
    next_job: u64,
    next_alarm: u64,
    /// The job that is driven.
    open: Option<Job>,
    /// The line that the process before drove last.
    driven: Option<Driven>,
}

impl History {
    /// What there was before.
    pub fn of(remembered: &Remembered) -> Self {
        let Remembered { jobs, alarms, .. } = remembered;
        Self {
            jobs: jobs.iter().rev().cloned().collect(),
            alarms: alarms.iter().rev().cloned().collect(),
            next_job: jobs.iter().map(|job| job.id).max().unwrap_or(0) + 1,
            next_alarm: alarms.iter().map(|alarm| alarm.id).max().unwrap_or(0) + 1,
            open: None,
            driven: remembered.driven.clone(),
        }
    }

    /// A job begins.
    pub fn begin(&mut self, kind: JobKind, program: &str, hash: &str, now_unix_ms: i64) -> Job {
        let job = Job {
            id: self.next_job,
            kind,
            program: program.to_string(),
            hash: hash.to_string(),
            started_unix_ms: now_unix_ms,
            end: None,
        };
        self.next_job += 1;
        self.open = Some(job.clone());
        job
    }

    /// The number of the job that is driven.
    pub fn open(&self) -> Option<u64> {
        self.open.as_ref().map(|job| job.id)
    }

    /// It has ended; its number and its end, where one was open.
    pub fn end(
        &mut self,
        outcome: &JobOutcome,
        how: Outcome,
        now_unix_ms: i64,
    ) -> Option<(u64, JobEnd)> {
        let mut job = self.open.take()?;
        let end = JobEnd {
            at_unix_ms: now_unix_ms,
            outcome: how,
            motion_s: outcome.summary.motion_time_s,
            limited_by_s: outcome.summary.limited_by_s.clone().into_iter().collect(),
            stops: outcome.summary.stop_count,
        };
        job.end = Some(end.clone());
        let id = job.id;
        hold(&mut self.jobs, job);
        Some((id, end))
    }

    /// Something has gone wrong.
    pub fn raise(&mut self, code: &str, text: &str, now_unix_ms: i64) -> Alarm {
        let alarm = Alarm {
            id: self.next_alarm,
            raised_unix_ms: now_unix_ms,
            code: code.to_string(),
            text: text.to_string(),
            job: self.open(),
            acknowledged_unix_ms: None,
        };
        self.next_alarm += 1;
        hold(&mut self.alarms, alarm.clone());
        alarm
    }

    /// Alarms that an acknowledgement of `which` is for: one by its number, or all.
    ///
    /// # Errors
    /// There is no such alarm that nobody has acknowledged.
    pub fn open_alarms_of(&self, which: Option<u64>) -> Result<Vec<u64>, String> {
        let open = self.alarms.iter().filter(|alarm| is_open(alarm));
        let meant = open.filter(|alarm| which.is_none_or(|which| which == alarm.id));
        let numbers: Vec<u64> = meant.map(|alarm| alarm.id).collect();
        match which {
            Some(which) if numbers.is_empty() => Err(format!(
                "there is no alarm {which} that nobody has acknowledged"
            )),
            _ => Ok(numbers),
        }
    }

    /// Somebody has seen these alarms.
    pub fn acknowledge(&mut self, numbers: &[u64], now_unix_ms: i64) {
        for alarm in &mut self.alarms {
            if numbers.contains(&alarm.id) {
                alarm.acknowledged_unix_ms = Some(now_unix_ms);
            }
        }
    }

    /// Alarms that nobody has acknowledged, the oldest first.
    pub fn open_alarms(&self) -> Vec<Value> {
        let open = self.alarms.iter().filter(|alarm| is_open(alarm));
        open.map(alarm_shown).collect()
    }

    /// The last `count` jobs and alarms, the latest first.
    pub fn show(&self, count: usize) -> Value {
        let open = self.open.iter().chain(self.jobs.iter().rev());
        let driven = self.driven.as_ref().map(|driven| {
            json!({ "number": driven.job, "hash": driven.hash, "line": driven.line, "epoch": driven.epoch })
        });
        json!({
            "jobs": open.take(count).map(job_shown).collect::<Vec<_>>(),
            "alarms": self.alarms.iter().rev().take(count).map(alarm_shown).collect::<Vec<_>>(),
            "driven_before": driven,
        })
    }
}

impl Dispatcher {
    /// What is driven from now on, for the history. The loop that drives.
    pub fn begin_history(&self, mode: Mode, name: &str) {
        let kind = match mode {
            Mode::Program => JobKind::Program,
            Mode::Homing => JobKind::Homing,
            Mode::Mdi => JobKind::Mdi,
            Mode::Jog => JobKind::Jog,
            Mode::Idle | Mode::Enabling => return,
        };
        let mut inner = self.lock();
        let loaded = inner.loaded.as_ref().filter(|_| mode == Mode::Program);
        let hash = loaded.map_or(String::new(), |program| program.hash.clone());
        let job = inner.history.begin(kind, name, &hash, self.now_unix_ms());
        drop(inner);
        self.persistence.record(Change::JobBegan(Box::new(job)));
    }

    /// Number and hash of the program or the lines that are driven, for the journal.
    pub fn journal(&self) -> Option<(u64, String)> {
        let inner = self.lock();
        let number = inner.history.open()?;
        let hash = inner.loaded.as_ref().map(|program| program.hash.clone());
        match inner.mode {
            Mode::Program => Some((number, hash.unwrap_or_default())),
            Mode::Mdi => Some((number, String::new())),
            _ => None,
        }
    }

    /// An alarm that stops nothing. Host.
    pub fn raise(&self, code: &str, words: &str) {
        let now_unix_ms = self.now_unix_ms();
        let alarm = self.lock().history.raise(code, words, now_unix_ms);
        self.send(
            None,
            &json!({ "event": "alarm", "raised": alarm_shown(&alarm) }),
        );
        self.persistence.record(Change::Raised(Box::new(alarm)));
    }

    /// Somebody has seen alarms; it is on disk when this returns.
    pub fn acknowledge(&self, asked: &Asked) -> Result<Value, String> {
        let which = asked.whole_if_any("alarm");
        let numbers = self.lock().history.open_alarms_of(which)?;
        let at_unix_ms = self.now_unix_ms();
        let changes = numbers.iter().map(|id| Change::Acknowledged {
            id: *id,
            at_unix_ms,
        });
        self.persistence.commit(changes.collect())?;
        self.lock().history.acknowledge(&numbers, at_unix_ms);
        self.send(None, &json!({ "event": "alarm", "acknowledged": numbers }));
        Ok(json!({ "acknowledged": numbers }))
    }
}

fn is_open(alarm: &Alarm) -> bool {
    alarm.acknowledged_unix_ms.is_none()
}

fn hold<T>(all: &mut VecDeque<T>, one: T) {
    all.push_back(one);
    if all.len() > HELD {
        all.pop_front();
    }
}

/// An alarm as clients are told it.
pub fn alarm_shown(alarm: &Alarm) -> Value {
    json!({
        "alarm": alarm.id, "code": alarm.code, "text": alarm.text, "number": alarm.job,
        "raised_unix_ms": alarm.raised_unix_ms, "acknowledged_unix_ms": alarm.acknowledged_unix_ms,
    })
}

fn job_shown(job: &Job) -> Value {
    let name = match job.kind {
        JobKind::Homing => "home",
        other => other.word(),
    };
    let mut shown = json!({
        "number": job.id, "job": name, "name": job.program, "hash": job.hash,
        "started_unix_ms": job.started_unix_ms,
    });
    if let Some(end) = &job.end {
        shown["ended_unix_ms"] = json!(end.at_unix_ms);
        shown["outcome"] = json!(end.outcome.word());
        shown["time_s"] = json!(end.motion_s);
        shown["limited_by_s"] = json!(end.limited_by_s);
        shown["stops"] = json!(end.stops);
    }
    shown
}
