//! Text and numbers for people.

/// `text` with everything replaced that HTML would take for markup, inside elements and quoted attributes.
pub(crate) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c => escaped.push(c),
        }
    }
    escaped
}

/// `value` with four significant digits, without an exponent and without trailing zeros; nothing smaller than 1e-6.
pub(crate) fn number(value: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let magnitude = value.abs().max(1e-9).log10().floor() as i32;
    let decimals = (3 - magnitude).clamp(0, 6) as usize;
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    group(if text == "-0" { "0" } else { text })
}

/// `value` with its thousands set apart by narrow spaces.
pub(crate) fn count(value: usize) -> String {
    group(&value.to_string())
}

fn group(text: &str) -> String {
    let end = text.find('.').unwrap_or(text.len());
    let start = usize::from(text.starts_with('-'));
    let mut grouped = text.to_owned();
    if end - start < 5 {
        return grouped;
    }
    for place in (start + 1..end)
        .rev()
        .filter(|place| (end - place).is_multiple_of(3))
    {
        grouped.insert(place, '\u{202f}');
    }
    grouped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_becomes_text() {
        assert_eq!(escape("a<b>&\"c\"'"), "a&lt;b&gt;&amp;&quot;c&quot;&#39;");
        assert_eq!(escape("</script>"), "&lt;/script&gt;");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(number(0.0), "0");
        assert_eq!(number(250.0), "250");
        assert_eq!(number(0.003_456_7), "0.003457");
        assert_eq!(number(-1.666_67), "-1.667");
        assert_eq!(number(20_000.4), "20\u{202f}000");
        assert_eq!(number(f64::NAN), "–");
    }

    #[test]
    fn thousands_are_set_apart() {
        assert_eq!(count(1999), "1999");
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
    }
}
