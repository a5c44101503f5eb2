//! From what the TOML reader gives to nodes that know their place.

use toml::de::{DeFloat, DeInteger, DeTable, DeValue};

use crate::node::{Node, Table, Value};
use crate::problems::{Origin, Problems};
use crate::shown::{dotted, shorten};

/// Deeper than any configuration, far from what would exhaust the stack.
pub const MAX_DEPTH: usize = 64;

/// Turns the tables and values of one source into nodes; what does not fit is reported.
pub struct Convert<'a> {
    source: usize,
    problems: &'a Problems,
    path: Vec<String>,
    depth: usize,
}

impl<'a> Convert<'a> {
    /// For the text numbered `source`, at the dotted path where its values belong.
    pub fn new(source: usize, problems: &'a Problems, path: Vec<String>) -> Self {
        Self {
            source,
            problems,
            path,
            depth: 0,
        }
    }

    /// A table.
    pub fn table(&mut self, table: &DeTable<'_>) -> Table {
        let mut nodes = Table::with_capacity(table.len());
        for (key, value) in table {
            let origin = Origin {
                source: self.source,
                offset: key.span().start,
            };
            self.path.push(key.get_ref().to_string());
            let value = self.value(value.get_ref(), origin);
            self.path.pop();
            nodes.insert(key.get_ref().to_string(), Node { origin, value });
        }
        nodes
    }

    /// A value whose key stands at `origin`.
    pub fn value(&mut self, value: &DeValue<'_>, origin: Origin) -> Value {
        match value {
            DeValue::String(text) => Value::Text(text.to_string()),
            DeValue::Integer(number) => self.integer(number, origin),
            DeValue::Float(number) => self.float(number, origin),
            DeValue::Boolean(truth) => Value::Bool(*truth),
            DeValue::Datetime(date) => Value::Date(*date),
            DeValue::Array(_) | DeValue::Table(_) => self.nested(value, origin),
        }
    }

    fn nested(&mut self, value: &DeValue<'_>, origin: Origin) -> Value {
        if self.depth >= MAX_DEPTH {
            self.report(origin, format!("nested more than {MAX_DEPTH} levels deep"));
            return Value::Wrong;
        }
        self.depth += 1;
        let nodes = match value {
            DeValue::Table(table) => Value::Table(self.table(table)),
            value => Value::Array(self.elements(value)),
        };
        self.depth -= 1;
        nodes
    }

    fn elements(&mut self, value: &DeValue<'_>) -> Vec<Node> {
        let array = value.as_array().into_iter().flatten();
        let nodes = array.map(|element| {
            let origin = Origin {
                source: self.source,
                offset: element.span().start,
            };
            Node {
                origin,
                value: self.value(element.get_ref(), origin),
            }
        });
        nodes.collect()
    }

    fn integer(&self, number: &DeInteger<'_>, origin: Origin) -> Value {
        if let Ok(value) = i64::from_str_radix(number.as_str(), number.radix()) {
            return Value::Integer(value);
        }
        self.report(
            origin,
            format!(
                "the integer {} has more than 64 bits",
                shorten(number.as_str())
            ),
        );
        Value::Wrong
    }

    fn float(&self, number: &DeFloat<'_>, origin: Origin) -> Value {
        let text = number.as_str();
        let value = text.parse().unwrap_or(f64::NAN);
        if f64::is_infinite(value) && !text.contains("inf") {
            self.report(
                origin,
                format!("the number {} is out of range", shorten(text)),
            );
            return Value::Wrong;
        }
        Value::Float(value)
    }

    fn report(&self, origin: Origin, what: String) {
        self.problems.report(origin, &dotted(&self.path), what);
    }
}
