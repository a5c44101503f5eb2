//! Requests of the protocol of a controller, line by line.

use serde_json::{Map, Value};

/// One line of a client, read.
#[derive(Clone, Debug)]
pub struct Asked {
    /// The client's number for it; the answer bears it.
    pub id: u64,
    /// What is asked for.
    pub request: String,
    /// The other keys.
    pub with: Map<String, Value>,
}

/// Reads a line.
///
/// # Errors
/// What is wrong with it, with its id where it has one.
pub fn read(text: &str) -> Result<Asked, (Option<u64>, String)> {
    let value: Value =
        serde_json::from_str(text).map_err(|e| (None, format!("it is no JSON: {e}")))?;
    let Value::Object(mut with) = value else {
        return Err((None, "it is no JSON object".to_string()));
    };
    let id = with.remove("id").and_then(|id| id.as_u64());
    let Some(id) = id else {
        return Err((
            None,
            "it has no \"id\", a whole number that its answer bears".to_string(),
        ));
    };
    match with.remove("request") {
        Some(Value::String(request)) => Ok(Asked { id, request, with }),
        _ => Err((
            Some(id),
            "it has no \"request\", the name of what is asked for".to_string(),
        )),
    }
}

impl Asked {
    /// The name of its row: the stop of a jog has one of its own.
    pub fn name(&self) -> &str {
        if self.request == "jog" && self.with.contains_key("stop") {
            "jog-stop"
        } else {
            &self.request
        }
    }

    /// Whether it stops what moves: it waits for nothing.
    pub fn is_stop(&self) -> bool {
        ["hold", "abort", "emergency-stop", "jog-stop"].contains(&self.name())
    }

    /// The text of `key`.
    ///
    /// # Errors
    /// It is not there, or no text.
    pub fn text(&self, key: &str) -> Result<&str, String> {
        self.with
            .get(key)
            .and_then(Value::as_str)
            .ok_or_else(|| format!("{} needs \"{key}\", a text", self.request))
    }

    /// The number of `key`.
    ///
    /// # Errors
    /// It is not there, or no number.
    pub fn number(&self, key: &str) -> Result<f64, String> {
        let number = self.with.get(key).and_then(Value::as_f64);
        number.ok_or_else(|| format!("{} needs \"{key}\", a number", self.request))
    }

    /// The number of `key`, if it is there.
    ///
    /// # Errors
    /// It is no number.
    pub fn number_if_any(&self, key: &str) -> Result<Option<f64>, String> {
        if self.with.contains_key(key) {
            self.number(key).map(Some)
        } else {
            Ok(None)
        }
    }

    /// The switch `on`.
    ///
    /// # Errors
    /// It is not there, or neither true nor false.
    pub fn on(&self) -> Result<bool, String> {
        let on = self.with.get("on").and_then(Value::as_bool);
        on.ok_or_else(|| format!("{} needs \"on\", true or false", self.request))
    }

    /// The text of `key`, if it is there.
    pub fn text_if_any(&self, key: &str) -> Option<&str> {
        self.with.get(key).and_then(Value::as_str)
    }

    /// The texts of `key`; none where it is not there.
    pub fn texts(&self, key: &str) -> Vec<&str> {
        let all = self.with.get(key).and_then(Value::as_array);
        all.map_or(vec![], |all| all.iter().filter_map(Value::as_str).collect())
    }

    /// The whole number of `key`, if it is there.
    pub fn whole_if_any(&self, key: &str) -> Option<u64> {
        self.with.get(key).and_then(Value::as_u64)
    }

    /// Whether the switch `key` is there and on.
    pub fn is_on(&self, key: &str) -> bool {
        self.with.get(key).and_then(Value::as_bool) == Some(true)
    }
}
