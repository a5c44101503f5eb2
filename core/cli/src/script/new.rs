//! `tandem script new`.

use std::fs;
use std::path::Path;

use crate::args::Language;

const SDK_AS: &str = include_str!("../../../../scripts/sdk/assemblyscript/tandem-policy.ts");
/// What tells an editor the types of `AssemblyScript`; the compiler does not read it.
const EDITOR_AS: &str = include_str!("../../../../scripts/sdk/templates/tsconfig.json");
const SDK_C: &str = include_str!("../../../../scripts/sdk/c/tandem_policy.h");
const SDK_RUST: &str = include_str!("../../../../scripts/sdk/rust/src/tandem_policy.rs");
const SCRIPT_AS: &str = include_str!("../../../../scripts/sdk/templates/policy.ts");
const SCRIPT_C: &str = include_str!("../../../../scripts/sdk/templates/policy.c");
const SCRIPT_RUST: &str = include_str!("../../../../scripts/sdk/templates/lib.rs");
const MANIFEST: &str = include_str!("../../../../scripts/sdk/templates/Cargo.toml.txt");

/// Makes the folder `name` with a first script and the SDK of its language.
pub fn new(name: &Path, language: Language) -> Result<u8, String> {
    let stem = name
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    if stem.is_empty()
        || !stem
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_')
    {
        return Err(format!(
            "{}: the name of a script has letters, digits, - and _ only",
            name.display()
        ));
    }
    if name.exists() {
        return Err(format!("{}: is there already", name.display()));
    }
    let manifest = MANIFEST.replace("NAME", &stem);
    let files: Vec<(String, &str)> = match language {
        Language::As => vec![
            (format!("{stem}.ts"), SCRIPT_AS),
            ("tandem-policy.ts".to_string(), SDK_AS),
            ("tsconfig.json".to_string(), EDITOR_AS),
        ],
        Language::C => vec![
            (format!("{stem}.c"), SCRIPT_C),
            ("tandem_policy.h".to_string(), SDK_C),
        ],
        Language::Rust => vec![
            ("Cargo.toml".to_string(), manifest.as_str()),
            ("src/lib.rs".to_string(), SCRIPT_RUST),
            ("src/tandem_policy.rs".to_string(), SDK_RUST),
        ],
    };
    for (file, text) in &files {
        let path = name.join(file);
        let folder = path.parent().unwrap_or(name);
        fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    let rust = language == Language::Rust;
    let first = name.join(if rust { "src/lib.rs" } else { &files[0].0 });
    let source = if rust { name } else { &first };
    say!(
        "{} is the script; tandem script build {} makes the module",
        first.display(),
        source.display()
    );
    Ok(0)
}
