//! How long it takes to load a plugin: each time from a copy that the process has not loaded yet.
//!
//! ```sh
//! cargo build --release --manifest-path tests/third-party/Cargo.toml
//! TANDEM_PLUGIN=tests/third-party/target/release/libone_block.so cargo bench -p tandem-host --bench loading
//! ```

use std::path::PathBuf;

use divan::Bencher;

fn main() {
    divan::main();
}

#[divan::bench(sample_size = 1, sample_count = 200)]
fn load(bencher: Bencher) {
    let Some(library) = std::env::var_os("TANDEM_PLUGIN").map(PathBuf::from) else {
        println!("skipped: TANDEM_PLUGIN names no shared library");
        return;
    };
    let library = std::env::current_dir().unwrap().join("../..").join(library);
    let folder = tempfile::tempdir().unwrap();
    let mut copies = 0;
    let copy = || {
        copies += 1;
        let path = folder
            .path()
            .join(format!("copy{copies}"))
            .join(library.file_name().unwrap());
        std::fs::create_dir(path.parent().unwrap()).unwrap();
        std::fs::copy(&library, &path).unwrap();
        path
    };
    bencher
        .with_inputs(copy)
        .bench_local_values(|path| tandem_host::load_plugins(&path).unwrap());
}
