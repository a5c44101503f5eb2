//! What the operator's page and the report of a run draw with, so that both look alike: one view of the path (`camera.js`,
//! `lines.js`, `scene.js`), one kind of plot over time (`plot.js`, on uPlot), one set of colours (`colours.css`, `theme.js`).
//!
//! The scripts are plain ones that declare what they have, without modules: the report is one file that is opened from a disk,
//! where a browser loads no module, and the page draws the path in a worker, which takes them by `importScripts`.

use rust_embed::{EmbeddedFile, RustEmbed};

#[derive(RustEmbed)]
#[folder = "assets"]
struct Assets;

/// The part called `name`: in the binary of a release, read from the source folder in a debug build. Host; allocates.
pub fn file(name: &str) -> Option<EmbeddedFile> {
    Assets::get(name)
}

/// The part called `name` as text; empty where there is none. Host; allocates.
pub fn text(name: &str) -> String {
    file(name).map_or(String::new(), |file| {
        String::from_utf8_lossy(&file.data).into_owned()
    })
}
