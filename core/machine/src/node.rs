//! TOML values that know where they were written.

use toml::map::Map;
use toml::value::Datetime;

use crate::problems::Origin;

/// A table: keys in the order in which they were written.
pub type Table = Map<String, Node>;

/// A value and the place of its key (of itself in an array).
#[derive(Clone, Debug)]
pub struct Node {
    pub origin: Origin,
    pub value: Value,
}

#[derive(Clone, Debug)]
pub enum Value {
    Text(String),
    Integer(i64),
    Float(f64),
    Bool(bool),
    Date(Datetime),
    Array(Vec<Node>),
    Table(Table),
    /// Something that does not fit, which is reported: nobody reports it again.
    Wrong,
}

impl Node {
    /// The kind of value, with its article.
    pub fn kind(&self) -> &'static str {
        match self.value {
            Value::Text(_) => "a string",
            Value::Integer(_) | Value::Float(_) => "a number",
            Value::Bool(_) => "a boolean",
            Value::Date(_) => "a date",
            Value::Array(_) => "an array",
            Value::Table(_) => "a table",
            Value::Wrong => "what it is",
        }
    }

    /// The table, where it is one.
    pub fn table(&self) -> Option<&Table> {
        if let Value::Table(table) = &self.value {
            Some(table)
        } else {
            None
        }
    }

    /// The text, where it is one.
    pub fn text(&self) -> Option<&str> {
        if let Value::Text(text) = &self.value {
            Some(text)
        } else {
            None
        }
    }

    /// The number, where it is a whole one that is not negative.
    pub fn whole(&self) -> Option<u32> {
        if let Value::Integer(number) = self.value {
            u32::try_from(number).ok()
        } else {
            None
        }
    }

    /// The elements, where it is an array.
    pub fn array(&self) -> Option<&[Node]> {
        if let Value::Array(array) = &self.value {
            Some(array)
        } else {
            None
        }
    }

    fn plain(&self) -> toml::Value {
        match &self.value {
            Value::Text(text) => toml::Value::String(text.clone()),
            Value::Integer(number) => toml::Value::Integer(*number),
            Value::Float(number) => toml::Value::Float(*number),
            Value::Bool(truth) => toml::Value::Boolean(*truth),
            Value::Wrong => toml::Value::Boolean(false),
            Value::Date(date) => toml::Value::Datetime(*date),
            Value::Array(array) => toml::Value::Array(array.iter().map(Self::plain).collect()),
            Value::Table(table) => toml::Value::Table(plain(table)),
        }
    }
}

/// The table without the places.
pub fn plain(table: &Table) -> toml::Table {
    table
        .iter()
        .map(|(key, node)| (key.clone(), node.plain()))
        .collect()
}

/// Lays `over` over `base`: tables are joined, anything else is replaced where it stands.
pub fn merge(base: &mut Table, over: Table) {
    for (key, node) in over {
        match (base.get_mut(&key), node.value) {
            (
                Some(Node {
                    origin,
                    value: Value::Table(below),
                }),
                Value::Table(above),
            ) => {
                *origin = node.origin;
                merge(below, above);
            }
            (_, value) => {
                _ = base.insert(
                    key,
                    Node {
                        origin: node.origin,
                        value,
                    },
                );
            }
        }
    }
}
