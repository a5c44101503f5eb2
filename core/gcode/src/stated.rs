//! What a program states for somebody who watches for it: `name = value` in a comment, or a named parameter.
//!
//! CAM systems write what they know into comments, `(T1 D=6. CR=0.5 - FLAT END MILL)`, `(MATERIAL: STEEL)`. Comments are read
//! for the names that are watched only, so that whatever else they say stays a comment.

use crate::item::Item;

/// A name that somebody watches for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Watched {
    /// Lower case: letters, digits and `_`. A named parameter `#<_name>` counts as `#<name>`.
    pub name: String,
    /// Words, lower case, that stand for 0, 1, 2 … beside numbers.
    pub words: Vec<String>,
}

impl Watched {
    /// The value that `text` states; `None` where it is no number and no word of these.
    fn value(&self, text: &str) -> Option<f64> {
        let word = self
            .words
            .iter()
            .position(|word| word.eq_ignore_ascii_case(text));
        let number = || text.parse().ok().filter(|number: &f64| number.is_finite());
        word.map(|place| place as f64).or_else(number)
    }
}

/// A comment states for a watched name what is no number and no word of its.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Unknown {
    pub line: u32,
    pub message: String,
}

/// Appends what the comments of `line` state of `watched`, in their order; the first statement that cannot be read.
pub(crate) fn of_comments(
    line: &[u8],
    watched: &[Watched],
    out: &mut dyn FnMut(Item),
) -> Option<String> {
    let mut unknown = None;
    for comment in comments(line) {
        let text = String::from_utf8_lossy(comment);
        for (which, watched) in watched.iter().enumerate() {
            for stated in values_of(&text, &watched.name) {
                let value = watched.value(stated);
                if value.is_none() {
                    unknown.get_or_insert_with(|| complaint(watched, stated));
                }
                out(Item::Stated {
                    which,
                    value: value.unwrap_or(f64::NAN),
                });
            }
        }
    }
    unknown
}

/// Which of `watched` a named parameter is, if any.
pub(crate) fn of_parameter(name: &[u8], watched: &[Watched]) -> Option<usize> {
    let name = name.strip_prefix(b"_").unwrap_or(name);
    watched
        .iter()
        .position(|watched| watched.name.as_bytes() == name)
}

fn complaint(watched: &Watched, stated: &str) -> String {
    let Watched { name, words } = watched;
    let expected = if words.is_empty() {
        "a number".to_string()
    } else {
        format!("a number, nor one of {}", words.join(", "))
    };
    format!(
        "the comment states {name} = {stated:?}, which is not {expected}: the policy script is told of none"
    )
}

/// The text of each comment of `line`.
fn comments(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = line;
    std::iter::from_fn(move || {
        let start = rest.iter().position(|byte| matches!(byte, b'(' | b';'))?;
        if rest[start] == b';' {
            let comment = &rest[start + 1..];
            rest = &[];
            return Some(comment);
        }
        let mut depth = 0;
        let end = rest[start..].iter().position(|byte| {
            depth += i32::from(*byte == b'(') - i32::from(*byte == b')');
            depth == 0
        });
        let end = end.map_or(rest.len(), |end| start + end);
        let comment = &rest[start + 1..end];
        rest = &rest[end..];
        Some(comment)
    })
}

/// What `text` states of `name`: the word behind `name =` or `name :`, wherever the name stands as a word of its own.
fn values_of<'t>(text: &'t str, name: &str) -> impl Iterator<Item = &'t str> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let starts = text.char_indices().filter_map({
        let name = name.to_string();
        move |(at, _)| {
            let found = text.get(at..at + name.len())?;
            let ends_before = !text[..at].chars().next_back().is_some_and(is_part);
            (ends_before && found.eq_ignore_ascii_case(&name)).then_some(at + name.len())
        }
    });
    starts.filter_map(|behind| {
        let rest = text[behind..].trim_start();
        let rest = rest.strip_prefix(['=', ':'])?.trim_start();
        let end = rest
            .find([' ', '\t', ',', ';', '(', ')'])
            .unwrap_or(rest.len());
        let value = rest[..end].trim_matches(['"', '\'']);
        (!value.is_empty()).then_some(value)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watched() -> Vec<Watched> {
        let one = |name: &str, words: &[&str]| Watched {
            name: name.to_string(),
            words: words.iter().map(|word| (*word).to_string()).collect(),
        };
        vec![
            one("material", &["aluminium", "brass", "6061-t6"]),
            one("d", &[]),
            one("depth_mm", &[]),
        ]
    }

    fn stated(line: &str) -> (Vec<(usize, f64)>, Option<String>) {
        let mut seen = vec![];
        let unknown = of_comments(line.as_bytes(), &watched(), &mut |item| {
            if let Item::Stated { which, value } = item {
                seen.push((which, value));
            }
        });
        (seen, unknown)
    }

    #[test]
    fn what_cam_systems_write_is_read_by_name() {
        let of = |line| stated(line).0;
        assert_eq!(
            of("(T1 D=6. CR=0.5 - ZMIN=-5. - FLAT END MILL)"),
            [(1, 6.0)]
        );
        assert_eq!(of("G1 X5 (Material: Brass) F100"), [(0, 1.0)]);
        assert_eq!(
            of("; material = 6061-T6, depth_mm=-1.5"),
            [(0, 2.0), (2, -1.5)]
        );
        assert_eq!(
            of("(a (nested material=aluminium) one) (d: 4)"),
            [(0, 0.0), (1, 4.0)]
        );
        assert_eq!(of("(material=2)"), [(0, 2.0)], "a number goes too");
        assert_eq!(of("G1 X1 D=5"), [], "what is no comment is none");
        assert_eq!(
            of("(materials=brass, raw_material=brass, material brass)"),
            []
        );
        assert_eq!(of("(d=)"), []);
        assert_eq!(of("(d=5 not closed"), [(1, 5.0)]);
    }

    #[test]
    fn what_is_no_word_is_told_once_and_is_not_a_number() {
        let (seen, unknown) = stated("(material=stel)");
        assert!(seen[0].0 == 0 && seen[0].1.is_nan());
        assert_eq!(
            unknown.unwrap(),
            "the comment states material = \"stel\", which is not a number, nor one of aluminium, brass, 6061-t6: \
             the policy script is told of none"
        );
        let (seen, unknown) = stated("(d=nan)");
        assert!(seen[0].1.is_nan() && unknown.is_some());
    }

    #[test]
    fn parameters_count_with_and_without_their_underscore() {
        let of = |name: &str| of_parameter(name.as_bytes(), &watched());
        assert_eq!(of("material"), Some(0));
        assert_eq!(of("_material"), Some(0));
        assert_eq!(of("__material"), None);
        assert_eq!(of("other"), None);
    }
}
