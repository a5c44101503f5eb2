//! The protocol as a schema and as the table of the page, made from the table of requests.

use std::fmt::Write as _;

use serde_json::{Map, Value, json};

use super::states::ControllerState;
use super::words::{Key, Kind, WORDS, Word};

/// Keys of axes as a schema has them: a letter and a unit.
const AXIS_KEYS: &str = "^[xyzabcuvw]_(mm|deg)$";

/// JSON schema (2020-12) of every line of the protocol: `$defs/request` of what clients say, `$defs/told` of what they are told.
/// Allocates.
pub fn schema() -> Value {
    let requests: Vec<Value> = WORDS.iter().map(request).collect();
    let states: Vec<_> = ControllerState::ALL
        .iter()
        .map(|state| state.name())
        .collect();
    let id = json!({ "type": "integer", "minimum": 0 });
    let answer = json!({
        "type": "object",
        "required": ["id", "ok"],
        "properties": { "id": id, "ok": true },
        "additionalProperties": false,
    });
    let refusal = json!({
        "type": "object",
        "required": ["id", "error"],
        "properties": {
            "id": { "type": ["integer", "null"] },
            "error": {
                "type": "object",
                "required": ["what", "why"],
                "properties": {
                    "what": { "type": "string" },
                    "why": { "type": "string" },
                    "where": { "type": "string" },
                    "state": { "$ref": "#/$defs/state" },
                },
            },
        },
        "additionalProperties": false,
    });
    let greeting = json!({
        "type": "object",
        "required": ["tandem"],
        "properties": { "tandem": {
            "type": "object",
            "required": ["protocol", "version", "machine", "client", "state", "role"],
            "properties": {
                "protocol": { "const": 2 },
                "version": { "type": "string" },
                "machine": { "type": "string" },
                "client": id,
                "state": { "$ref": "#/$defs/state" },
                "role": { "enum": ["watch", "operate", "set-up"] },
            },
        } },
        "additionalProperties": false,
    });
    let event = json!({
        "type": "object",
        "required": ["event"],
        "properties": { "event": { "enum": EVENTS.map(|(name, _)| name) } },
    });
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Tandem, protocol 2: a JSON line a message",
        "anyOf": [{ "$ref": "#/$defs/request" }, { "$ref": "#/$defs/told" }],
        "$defs": {
            "state": { "enum": states },
            "request": { "oneOf": requests },
            "told": { "oneOf": [greeting, answer, refusal, event] },
        },
    })
}

/// What clients are told that they have not asked for in this moment.
pub const EVENTS: [(&str, &str); 12] = [
    (
        "state",
        "the machine's state is another one, or a held machine has come to rest: then it is `at_rest`",
    ),
    (
        "job",
        "what became of a job, its summary, and where the machine stands",
    ),
    ("driven", "the line `id` is driven"),
    ("not-driven", "it is not going to be"),
    (
        "waits",
        "the program waits on `line` (M0, M1, M6): `resume` goes on",
    ),
    ("refused", "a job could not begin, or a jog was refused"),
    ("alarm", "an alarm was raised, or acknowledged"),
    ("lease", "the control lease was asked for, or lost"),
    ("status", "what was subscribed to; `lost` lines before it"),
    ("scope", "samples; `lost` frames before it"),
    ("captured", "a capture is done"),
    ("end", "the controller ends"),
];

/// The name under which a request is sent: that of a jog for the one that lets it go.
fn sent_as(word: &Word) -> &'static str {
    if word.name == "jog-stop" {
        "jog"
    } else {
        word.name
    }
}

fn request(word: &Word) -> Value {
    let mut properties = Map::new();
    properties.insert("id".to_string(), json!({ "type": "integer", "minimum": 0 }));
    properties.insert("request".to_string(), json!({ "const": sent_as(word) }));
    let mut required = vec!["id", "request"];
    let mut patterns = Map::new();
    for key in word.keys {
        if key.kind == Kind::Axes {
            patterns.insert(AXIS_KEYS.to_string(), key.kind.schema());
            continue;
        }
        properties.insert(key.name.to_string(), key.kind.schema());
        if key.needed {
            required.push(key.name);
        }
    }
    let mut request = json!({
        "title": word.name,
        "description": word.says,
        "type": "object",
        "required": required,
        "properties": properties,
        "additionalProperties": false,
    });
    if !patterns.is_empty() {
        request["patternProperties"] = Value::Object(patterns);
    }
    request
}

/// Requests and events as the page prints them. Allocates.
pub fn requests_table() -> String {
    let mut text = "| request | with | may ask | |\n|---|---|---|---|".to_string();
    for word in WORDS {
        let keys: Vec<_> = word.keys.iter().map(key).collect();
        let lease = if word.lease { ", lease" } else { "" };
        let _ = write!(
            text,
            "\n| `{}` | {} | {}{lease} | {} |",
            word.name,
            keys.join(", "),
            word.role.name(),
            word.says
        );
    }
    text.push_str("\n\n| event | |\n|---|---|");
    for (name, says) in EVENTS {
        let _ = write!(text, "\n| `{name}` | {says} |");
    }
    text.push('\n');
    text
}

fn key(key: &Key) -> String {
    let name = match key.kind {
        Kind::Axes => "`x_mm`, `a_deg` …".to_string(),
        Kind::OneOf(words) => format!("`{}`: {}", key.name, words.join(", ")),
        Kind::Switch => format!("`{}`: true, false", key.name),
        _ => format!("`{}`", key.name),
    };
    if key.needed {
        name
    } else {
        format!("[{name}]")
    }
}
