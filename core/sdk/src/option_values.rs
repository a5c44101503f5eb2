//! What may stand for an option, found out by asking its type to read itself.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, Visitor};

/// What a value of `T` looks like: `number`, `text`, or the words to choose from.
pub fn values<'de, T: Deserialize<'de>>() -> String {
    match T::deserialize(Asked) {
        Err(Answer(text)) => text,
        Ok(_) => String::new(),
    }
}

/// Gives no value, and says in its error what was asked for.
struct Asked;

#[derive(Debug)]
struct Answer(String);

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Answer {}

impl Error for Answer {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self(message.to_string())
    }
}

macro_rules! answers {
    ($($method:ident: $text:literal;)*) => {
        $(fn $method<V: Visitor<'de>>(self, _visitor: V) -> Result<V::Value, Answer> {
            Err(Answer($text.to_string()))
        })*
    };
}

impl<'de> Deserializer<'de> for Asked {
    type Error = Answer;

    answers! {
        deserialize_any: "any value";
        deserialize_bool: "true or false";
        deserialize_i8: "whole number";
        deserialize_i16: "whole number";
        deserialize_i32: "whole number";
        deserialize_i64: "whole number";
        deserialize_u8: "whole number from 0";
        deserialize_u16: "whole number from 0";
        deserialize_u32: "whole number from 0";
        deserialize_u64: "whole number from 0";
        deserialize_f32: "number";
        deserialize_f64: "number";
        deserialize_char: "character";
        deserialize_str: "text";
        deserialize_string: "text";
        deserialize_bytes: "list";
        deserialize_byte_buf: "list";
        deserialize_unit: "nothing";
        deserialize_seq: "list";
        deserialize_map: "table";
        deserialize_identifier: "text";
        deserialize_ignored_any: "any value";
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Answer> {
        visitor.visit_some(self)
    }

    fn deserialize_unit_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: V,
    ) -> Result<V::Value, Answer> {
        Err(Answer("nothing".to_string()))
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Answer> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, length: usize, _: V) -> Result<V::Value, Answer> {
        Err(Answer(format!("list of {length}")))
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        length: usize,
        _: V,
    ) -> Result<V::Value, Answer> {
        Err(Answer(format!("list of {length}")))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        _: V,
    ) -> Result<V::Value, Answer> {
        Err(Answer(format!("table with {}", fields.join(", "))))
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        _: V,
    ) -> Result<V::Value, Answer> {
        let words: Vec<String> = variants.iter().map(|word| format!("{word:?}")).collect();
        Err(Answer(words.join(" | ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(serde::Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Junction {
        Axis,
        Tangent,
    }

    #[test]
    fn a_type_says_what_it_reads() {
        assert_eq!(values::<Junction>(), "\"axis\" | \"tangent\"");
        assert!(matches!(
            (Junction::Axis, Junction::Tangent),
            (Junction::Axis, Junction::Tangent)
        ));
        assert_eq!(values::<Option<f64>>(), "number");
        assert_eq!(values::<u32>(), "whole number from 0");
        assert_eq!(values::<[f64; 3]>(), "list of 3");
        assert_eq!(values::<bool>(), "true or false");
    }
}
