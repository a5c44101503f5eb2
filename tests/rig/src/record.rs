//! Cases that tests run, recorded as files for the comparison of two builds.

use std::collections::HashMap;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex};

/// The variable of the environment that names the folder for recorded cases.
pub const CASES_VARIABLE: &str = "TANDEM_NET_CASES";
/// Cases of one test that are recorded: a test over a thousand ticks would take all the time of a comparison.
const MAX_CASES_PER_TEST: usize = 8;

/// Records a call of `tandem` in the folder that [`CASES_VARIABLE`] names, or does nothing where it names none.
///
/// A case is a folder named by the test and a number. It holds the `arguments`, one a line, what is typed (`input`), and
/// the temporary files among the arguments: those of the project are named by their paths.
///
/// # Panics
/// The folder cannot be written.
pub fn record_case<'a>(arguments: impl IntoIterator<Item = &'a OsStr>, input: &str) {
    let Some(cases) = std::env::var_os(CASES_VARIABLE).map(PathBuf::from) else {
        return;
    };
    let Some(folder) = next_folder(&cases) else {
        return;
    };
    std::fs::create_dir_all(&folder).unwrap();
    let mut lines = String::new();
    for argument in arguments {
        let kept = keep(argument, &folder);
        lines.push_str(&kept.to_string_lossy());
        lines.push('\n');
    }
    std::fs::write(folder.join("arguments"), lines).unwrap();
    std::fs::write(folder.join("input"), input).unwrap();
}

/// The folder of the next case of the running test, unless there are enough of them.
fn next_folder(cases: &Path) -> Option<PathBuf> {
    static COUNTS: LazyLock<Mutex<HashMap<String, usize>>> = LazyLock::new(Mutex::default);
    let test = std::thread::current().name()?.replace("::", "-");
    let mut counts = COUNTS.lock().unwrap();
    let count = counts.entry(test.clone()).or_default();
    *count += 1;
    (*count <= MAX_CASES_PER_TEST).then(|| cases.join(format!("{test}-{count}")))
}

/// The argument as the case has it: a temporary file is copied to `folder` and named without a path.
fn keep(argument: &OsStr, folder: &Path) -> OsString {
    let path = Path::new(argument);
    let project = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .canonicalize()
        .unwrap();
    let Some(name) = path
        .file_name()
        .filter(|_| path.is_file() && !path.starts_with(project))
    else {
        return argument.to_owned();
    };
    std::fs::copy(path, folder.join(name)).unwrap();
    name.to_owned()
}
