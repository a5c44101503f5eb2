//! Clients of a controller by fine periods, and what they were told.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use serde_json::{Value, json};
use tandem_gcode::PersistentData;
use tandem_host::Registry;
use tandem_machine::Machine;
use tandem_session::controller::{Controller, Options, Persistence, ScriptLine};
use tandem_state::Change;

pub fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines")
}

pub fn machine(name: &str) -> Machine {
    machine_with(name, &[])
}

pub fn machine_with(name: &str, keys: &[(&str, &str)]) -> Machine {
    let keys = keys
        .iter()
        .map(|(key, value)| ((*key).to_string(), (*value).to_string()));
    Machine::read(&examples().join(name), &keys.collect::<Vec<_>>()).unwrap()
}

pub fn registry() -> Registry {
    let mut registry = Registry::default();
    for plugin in [tandem_look_ahead::PLUGIN, tandem_sim::PLUGIN] {
        registry.register(plugin).unwrap();
    }
    registry
}

/// What client 1 says, by ticks, with an id each.
#[derive(Default)]
pub struct Says {
    pub lines: Vec<ScriptLine>,
    pub tick: u64,
}

impl Says {
    pub fn new() -> Self {
        let mut says = Self::default();
        says.ask(100, "lease", json!({ "how": "take" }));
        says
    }

    /// Asks `ticks` after what was asked before; the id.
    pub fn ask(&mut self, ticks: u64, request: &str, mut with: Value) -> u64 {
        self.tick += ticks;
        let id = self.lines.len() as u64 + 1;
        (with["id"], with["request"]) = (json!(id), json!(request));
        self.lines.push(ScriptLine {
            tick: self.tick,
            client: 1,
            line: with.to_string(),
        });
        id
    }
}

/// What all clients were told.
pub struct Told(pub Vec<Value>);

impl Told {
    pub fn by(
        machine: &Machine,
        says: Says,
        options: impl FnOnce(&mut Options),
        persistence: Box<dyn Persistence>,
    ) -> Self {
        let registry = registry();
        let mut asked = Options::of_script(says.lines);
        options(&mut asked);
        let controller = Controller::open(machine, &registry, asked, persistence).unwrap();
        let mut told = vec![];
        controller
            .run(&mut |line| told.extend(serde_json::from_str(line).ok()))
            .unwrap();
        Self(told)
    }

    /// The one answer to the request `id`.
    pub fn answer(&self, id: u64) -> &Value {
        let is_answer =
            |told: &&Value| told["told"]["id"] == id && told["told"].get("event").is_none();
        let answers: Vec<_> = self.0.iter().filter(is_answer).collect();
        assert_eq!(
            answers.len(),
            1,
            "every request has one answer: {id} {answers:?}"
        );
        &answers[0]["told"]
    }

    pub fn ok(&self, id: u64) -> &Value {
        let answer = self.answer(id);
        assert!(answer.get("ok").is_some(), "{answer}");
        &answer["ok"]
    }

    pub fn why(&self, id: u64) -> &str {
        self.answer(id)["error"]["why"]
            .as_str()
            .unwrap_or_else(|| panic!("{}", self.answer(id)))
    }

    pub fn jobs(&self) -> Vec<(String, String)> {
        let events = self.0.iter().filter(|told| told["told"]["event"] == "job");
        let word = |job: &Value, key: &str| job[key].as_str().unwrap().to_string();
        events
            .map(|told| {
                (
                    word(&told["told"]["job"], "job"),
                    word(&told["told"]["job"], "outcome"),
                )
            })
            .collect()
    }

    /// The events of this name, in order.
    pub fn events(&self, name: &str) -> Vec<&Value> {
        let told = self.0.iter().map(|told| &told["told"]);
        told.filter(|told| told["event"] == name).collect()
    }

    pub fn states(&self) -> Vec<&str> {
        let events = self
            .0
            .iter()
            .filter(|told| told["told"]["event"] == "state");
        events
            .map(|told| told["told"]["state"].as_str().unwrap())
            .collect()
    }
}

/// Keeps what it is given: what lasts, and all of it.
#[derive(Clone, Default)]
pub struct Kept(
    pub Arc<Mutex<Vec<PersistentData>>>,
    pub Arc<Mutex<Vec<Change>>>,
);

impl Persistence for Kept {
    fn commit(&self, changes: Vec<Change>) -> Result<(), String> {
        for change in changes {
            self.record(change);
        }
        Ok(())
    }

    fn record(&self, change: Change) {
        if let Change::Program(persistent) = &change {
            self.0
                .lock()
                .unwrap()
                .push(PersistentData::clone(persistent));
        }
        self.1.lock().unwrap().push(change);
    }
}
