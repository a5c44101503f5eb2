//! The requests of the protocol: their names, their keys, who may ask them and when. One table, from which refusals, the page and
//! the schema are made.

use serde_json::{Map, Value, json};

pub use crate::operator::Role;

/// What may be in a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A text.
    Text,
    /// Texts.
    Texts,
    /// A number.
    Number,
    /// A whole number, 0 or more.
    Whole,
    /// True or false.
    Switch,
    /// One of these words.
    OneOf(&'static [&'static str]),
    /// A number for each axis that is meant, under keys such as `x_mm` and `a_deg`; the name in the table stands for all.
    Axes,
}

/// A key of a request.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// Its name.
    pub name: &'static str,
    /// What may be in it.
    pub kind: Kind,
    /// The request is refused without it.
    pub needed: bool,
}

/// A request.
#[derive(Clone, Copy, Debug)]
pub struct Word {
    /// Its name.
    pub name: &'static str,
    /// In the order of [`super::ControllerState`], whether it is done (`+`) or which reason refuses it.
    pub states: &'static str,
    /// Who may ask it.
    pub role: Role,
    /// Whether the client must hold the control lease.
    pub lease: bool,
    /// Its keys.
    pub keys: &'static [Key],
    /// What it does, for the page; what is to be known of its keys.
    pub says: &'static str,
}

const fn need(name: &'static str, kind: Kind) -> Key {
    Key {
        name,
        kind,
        needed: true,
    }
}

const fn may(name: &'static str, kind: Kind) -> Key {
    Key {
        name,
        kind,
        needed: false,
    }
}

const fn word(
    name: &'static str,
    states: &'static str,
    (role, lease): (Role, bool),
    keys: &'static [Key],
    says: &'static str,
) -> Word {
    Word {
        name,
        states,
        role,
        lease,
        keys,
        says,
    }
}

/// Everybody may ask it, without the lease.
const FREE: (Role, bool) = (Role::Watch, false);
/// Who drives the machine.
const HELD: (Role, bool) = (Role::Operate, true);
/// Who sets it up.
const SETS: (Role, bool) = (Role::SetUp, true);

use Kind::{Axes, Number, OneOf, Switch, Text, Texts, Whole};

/// All requests. A jog that is let go has a row of its own, `jog-stop`.
#[rustfmt::skip]
pub const WORDS: [Word; 41] = [
    //                        E D N R J M P H S F
    word("status",           "++++++++++", FREE, &[], "everything that is shown of the machine"),
    word("subscribe",        "++++++++++", FREE, &[need("rate_hz", Number), may("fields", Texts), may("changes", Switch)],
        "`status` events, 0.01 to 100 a second, 0 for none; `fields` of the status alone, with `changes` those that are otherwise than before"),
    word("history",          "++++++++++", FREE, &[may("count", Whole)], "the last jobs and alarms, the latest first"),
    word("alarms",           "++++++++++", FREE, &[], "alarms that nobody has acknowledged"),
    word("list",             "++++++++++", FREE, &[], "the programs folder: name, bytes, when it was written (ms since 1970)"),
    word("machine",          "++++++++++", FREE, &[], "axes with their limits, plugins, the keep-alive, and what is refused in which state and to whom"),
    word("tables",           "++++++++++", FREE, &[], "work offsets and tools"),
    word("path",             "++++++++++", FREE, &[may("from", Whole), may("driven_from", Whole), may("packed", Switch)],
        "the programmed path in pieces, and where the machine was; [below](#path)"),
    word("text",             "++++++++++", FREE, &[may("from", Whole), may("lines", Whole)],
        "lines of the program that is loaded, at most 200 from line `from` on (1 without), and how many there are"),
    word("policy-parameters", "++++++++++", FREE, &[], "parameters of the policy script: those that are stated with their values, and all with their bounds and defaults"),
    word("scope",            "++++++++++", FREE, &[need("signals", Texts), may("every", Whole)],
        "`scope` events with these signals of every fine period, or of each `every`th; none end it; [below](#scope)"),
    word("capture",          "++++++++++", FREE, &[need("signals", Texts), may("before_s", Number), may("after_s", Number),
        may("when", Text), may("above", Number), may("below", Number)],
        "every sample around the instant in which the signal `when` goes `above` or `below`; without it, from now on"),
    word("captured",         "++++++++++", FREE, &[may("from", Whole)], "the rows of the capture that is done"),
    word("role",             "++++++++++", FREE, &[need("as", OneOf(&["watch", "operate"]))],
        "from here on this client may do no more than that; behind the answer the greeting comes once more"),
    word("lease",            "++++++++++", (Role::Operate, false), &[need("how", OneOf(&["take", "take-over", "release"]))],
        "the control lease"),
    word("hold",             "xxxx+++++x", FREE, &[], "a feed hold"),
    word("emergency-stop",   "++++++++++", FREE, &[], "the axes ramp out, the drives let go"),
    word("jog-stop",         "xxxx++++++", FREE, &[need("stop", Switch)], "`jog` with `stop`: the jog is let go"),
    word("load",             "++++bbbbs+", HELD, &[may("path", Text), may("text", Text), may("name", Text)],
        "`path` in the programs folder, or `text` and `name`; a refusal lists every error"),
    word("check",            "++++bbbbs+", HELD, &[may("path", Text), may("text", Text), may("name", Text)],
        "the same; what was loaded stays"),
    word("upload",           "++++++++++", HELD, &[need("name", Text), need("text", Text), may("more", Switch), may("replace", Switch)],
        "a file of the programs folder; with `more` another part follows; one that is there is replaced only with `replace`"),
    word("start",            "fdn+bbbbsf", HELD, &[], "drives the program that is loaded"),
    word("resume",           "xxxx++++sx", HELD, &[], "goes on behind a hold, or where a program waits"),
    word("abort",            "xxxx+++++x", HELD, &[], "to rest on the path; the job is over"),
    word("feed-override",    "++++++++++", HELD, &[need("ratio", Number)], "1 for the programmed feed"),
    word("rapid-override",   "++++++++++", HELD, &[need("ratio", Number)], "1 for the machine's rapid feed"),
    word("single-block",     "++++++++++", HELD, &[need("on", Switch)], "rests at the end of each block"),
    word("optional-stop",    "++++++++++", HELD, &[need("on", Switch)], "M1 waits"),
    word("block-delete",     "++++++++++", HELD, &[need("on", Switch)], "from the next job on, lines with / are left out"),
    word("mdi",              "fdn+b+bbsf", HELD, &[need("line", Text)],
        "answered when it is judged; the event `driven`, or `not-driven`, follows"),
    word("jog",              "fd+++bbbsf", HELD, &[need("axis", Text), may("feed_mm_per_min", Number), may("feed_deg_per_min", Number),
        may("distance_mm", Number), may("distance_deg", Number), may("direction", Number), may("again", Switch)],
        "by `distance`, or on in `direction` (1, -1), which is to be said again to keep it alive, with `again` where that must not begin a jog that is over"),
    word("home",             "fd++bbbbsf", HELD, &[may("axis", Text)], "one axis, or all"),
    word("reset",            "+kkkkkkks+", HELD, &[], "takes back a fault and enables the drives"),
    word("enable",           "f+eeeeeesf", HELD, &[], "has the drives hold"),
    word("disable",          "fo++bbbbsf", HELD, &[], "has the drives let go"),
    word("acknowledge",      "++++++++++", HELD, &[may("alarm", Whole)], "one alarm by its number, or all"),
    word("touch-off",        "fdn+bbbbsf", SETS, &[may("system", Text), need("x_mm", Axes)],
        "where the machine stands is called so, in `system` as in `G55`, else in the one in force"),
    word("set-offset",       "++++bbbbs+", SETS, &[may("system", Text), need("x_mm", Axes)], "the origin, machine coordinates"),
    word("set-tool",         "++++bbbbs+", SETS, &[need("number", Whole), may("x_mm", Axes), may("diameter_mm", Number), may("in_spindle", Switch)],
        "a tool's offsets and diameter"),
    word("set-parameter",    "++++bbbbs+", SETS, &[need("number", Whole), need("value", Number)], "a parameter from 31 to 5000"),
    word("set-policy-parameter", "++++bbbbs+", SETS, &[need("name", Text), need("value", Number)],
        "a parameter of the policy script, from the next job on"),
];

/// The request with this name.
pub fn word_of(name: &str) -> Option<&'static Word> {
    WORDS.iter().find(|word| word.name == name)
}

impl Word {
    /// Whether `with` has the keys that the request needs, no others, and in each what may be there.
    ///
    /// # Errors
    /// What is missing, too much or of another kind.
    pub fn check(&self, with: &Map<String, Value>) -> Result<(), String> {
        for key in self
            .keys
            .iter()
            .filter(|key| key.needed && key.kind != Axes)
        {
            if !with.contains_key(key.name) {
                return Err(format!(
                    "{} needs \"{}\", {}",
                    self.name,
                    key.name,
                    key.kind.words()
                ));
            }
        }
        for (name, value) in with {
            let known = self.keys.iter().find(|key| key.is_called(name));
            let Some(key) = known else {
                let all: Vec<_> = self.keys.iter().map(|key| key.name).collect();
                let all = if all.is_empty() {
                    "nothing else".to_string()
                } else {
                    all.join(", ")
                };
                return Err(format!(
                    "{} does not know \"{name}\"; it knows {all}",
                    self.name
                ));
            };
            if !key.kind.takes(value) {
                return Err(format!("{}: \"{name}\" is {}", self.name, key.kind.words()));
            }
        }
        Ok(())
    }
}

impl Key {
    fn is_called(&self, name: &str) -> bool {
        let is_axis = || {
            let (letter, unit) = name.split_once('_').unwrap_or_default();
            letter.len() == 1 && "xyzabcuvw".contains(letter) && ["mm", "deg"].contains(&unit)
        };
        self.name == name || (self.kind == Axes && is_axis())
    }
}

impl Kind {
    fn takes(self, value: &Value) -> bool {
        match self {
            Text => value.is_string(),
            Texts => value
                .as_array()
                .is_some_and(|all| all.iter().all(Value::is_string)),
            Number | Axes => value.as_f64().is_some_and(f64::is_finite),
            Whole => value.as_u64().is_some(),
            Switch => value.is_boolean(),
            OneOf(words) => value.as_str().is_some_and(|text| words.contains(&text)),
        }
    }

    fn words(self) -> String {
        match self {
            Text => "a text".to_string(),
            Texts => "a list of texts".to_string(),
            Number | Axes => "a number".to_string(),
            Whole => "a whole number, 0 or more".to_string(),
            Switch => "true or false".to_string(),
            OneOf(words) => words.join(" or "),
        }
    }

    /// What may be in it as a JSON schema.
    pub fn schema(self) -> Value {
        match self {
            Text => json!({ "type": "string" }),
            Texts => json!({ "type": "array", "items": { "type": "string" } }),
            Number | Axes => json!({ "type": "number" }),
            Whole => json!({ "type": "integer", "minimum": 0 }),
            Switch => json!({ "type": "boolean" }),
            OneOf(words) => json!({ "enum": words }),
        }
    }
}
