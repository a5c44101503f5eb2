//! `tandem plugin`.

mod check;
mod list;
mod new;

use tandem_conformance::Setup;

use crate::args;

/// Does what the command says.
pub fn plugin(command: &args::Plugin) -> Result<u8, Box<dyn std::error::Error>> {
    let done = match command {
        args::Plugin::New { name, kind, sdk } => new::new(name, *kind, sdk.as_deref()),
        args::Plugin::Check {
            library,
            options,
            seed,
            programs,
            moves_metal,
            work_area,
        } => {
            let setup = Setup {
                seed: *seed,
                programs: *programs,
                moves_metal: *moves_metal,
                work_area: *work_area,
                ..Setup::default()
            };
            check::check(library, options, &setup)
        }
        args::Plugin::List { libraries, verbose } => list::list(libraries, *verbose),
    };
    Ok(done?)
}
