//! `tandem plugin`.

mod list;

use std::error::Error;

use crate::args;

/// Does what the command says.
pub fn plugin(command: &args::Plugin) -> Result<u8, Box<dyn Error>> {
    match command {
        args::Plugin::List { libraries, verbose } => Ok(list::list(libraries, *verbose)?),
    }
}
