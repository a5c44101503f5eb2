//! The page and the schema are what the table of requests says.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tandem_session::controller::{WORDS, requests_table, schema, table};

fn docs(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../docs")
        .join(name)
}

/// Compares, or writes where `UPDATE_DOCS` asks for it.
fn compare(path: &Path, found: &str, expected: &str) {
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(path, expected).unwrap();
    } else {
        assert!(
            found == expected,
            "{}: not what the code says; UPDATE_DOCS=1 cargo test -p tandem-session --test controller page rewrites it",
            path.display()
        );
    }
}

#[test]
fn the_page_prints_the_tables() {
    let path = docs("controller.md");
    let mut page = std::fs::read_to_string(&path).unwrap();
    let found = page.clone();
    for (name, text) in [("requests", requests_table()), ("states", table())] {
        let (begin, end) = (
            format!("<!-- table: {name} -->\n"),
            format!("<!-- end: {name} -->"),
        );
        let from = page.find(&begin).unwrap() + begin.len();
        let to = page.find(&end).unwrap();
        page.replace_range(from..to, &text);
    }
    compare(&path, &found, &page);
}

#[test]
fn the_schema_lies_beside_the_page() {
    let path = docs("protocol.schema.json");
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    compare(&path, &found, &format!("{:#}\n", schema()));
}

/// What the schema says of a request is what the controller takes: an example of each kind of key, one key missing, one too many.
#[test]
fn what_a_request_needs_is_asked_for() {
    let example = |schema: &Value| match schema["type"].as_str() {
        Some("string") => json!("x"),
        Some("array") => json!(["feed_mm_s"]),
        Some("boolean") => json!(true),
        Some("integer" | "number") => json!(1),
        _ => schema["enum"][0].clone(),
    };
    for word in WORDS {
        let mut whole = serde_json::Map::new();
        for key in word.keys {
            whole.insert(key.name.to_string(), example(&key.kind.schema()));
        }
        word.check(&whole).unwrap();
        for key in word.keys {
            let mut lacks = whole.clone();
            lacks.remove(key.name);
            let is_needed = key.needed && key.kind != tandem_session::controller::Kind::Axes;
            assert_eq!(
                word.check(&lacks).is_err(),
                is_needed,
                "{} without {}",
                word.name,
                key.name
            );
            let mut wrong = whole.clone();
            wrong.insert(key.name.to_string(), json!({ "no": "key takes an object" }));
            assert!(word.check(&wrong).is_err(), "{}: {}", word.name, key.name);
        }
        whole.insert("nonsense".to_string(), json!(1));
        let why = word.check(&whole).unwrap_err();
        assert!(why.contains("does not know \"nonsense\""), "{why}");
    }
}
