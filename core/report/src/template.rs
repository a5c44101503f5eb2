//! Templates: text with gaps, as in `<h1>{{title}}</h1>`.

use std::io::{self, Write};

use crate::text::escape;

const PLAIN: &str = include_str!("../assets/plain.html");
const STYLE: &str = include_str!("../assets/plain.css");

/// Writes `template` while `fill` writes what belongs into the gap that it is given.
///
/// # Errors
/// Writing fails.
pub(crate) fn write(
    template: &str,
    out: &mut dyn Write,
    mut fill: impl FnMut(&str, &mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let mut pieces = template.split("{{");
    out.write_all(pieces.next().unwrap_or_default().as_bytes())?;
    for piece in pieces {
        let (gap, rest) = piece.split_once("}}").unwrap_or((piece, ""));
        fill(gap, out)?;
        out.write_all(rest.as_bytes())?;
    }
    out.flush()
}

/// Writes a page without a script: its heading, the facts in a row, and `body`, whose gaps `fill` knows.
///
/// # Errors
/// Writing fails.
pub(crate) fn write_plain(
    (title, facts): (&str, &[(String, String)]),
    body: &str,
    out: &mut dyn Write,
    fill: impl Fn(&str) -> String,
) -> io::Result<()> {
    write(PLAIN, out, |gap, out| match gap {
        "title" => out.write_all(escape(title).as_bytes()),
        "style" => out.write_all(STYLE.as_bytes()),
        "facts" => out.write_all(self::facts(facts).as_bytes()),
        "body" => write(body, out, |gap, out| out.write_all(fill(gap).as_bytes())),
        unknown => unreachable!("the template has an unknown gap {unknown}"),
    })
}

/// Names and values in a row.
pub(crate) fn facts(facts: &[(String, String)]) -> String {
    let one = |(name, value): &(String, String)| {
        format!("<span>{} <b>{}</b></span>", escape(name), escape(value))
    };
    facts.iter().map(one).collect()
}
