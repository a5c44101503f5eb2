//! `tandem script doctor`.

use std::path::Path;

use super::toolchain::{self, INSTALL_AS, INSTALL_C, INSTALL_RUST};

/// Prints which languages can be built here, and what to install for the others. Fails where there is none.
pub fn doctor() -> u8 {
    let here = Path::new(".");
    let both = toolchain::clang().zip(toolchain::wasm_ld());
    let rows = [
        (
            "AssemblyScript",
            toolchain::asc(here).map(|asc| shown(&asc)),
            INSTALL_AS,
        ),
        (
            "C",
            both.map(|(clang, ld)| format!("{}, {}", shown(&clang), shown(&ld))),
            INSTALL_C,
        ),
        (
            "Rust",
            toolchain::cargo().map(|cargo| format!("{}, wasm32-unknown-unknown", shown(&cargo))),
            INSTALL_RUST,
        ),
    ];
    let mut found = 0;
    for (language, tools, install) in rows {
        found += u8::from(tools.is_some());
        match tools {
            Some(tools) => print(&format!("{language:<15} {tools}")),
            None => print(&format!("{language:<15} missing: {install}")),
        }
    }
    u8::from(found == 0)
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

fn print(line: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stdout(), "{line}");
}
