//! `tandem serve --http`: the operator's page.

use std::sync::Arc;

use tandem_session::operator::{Listen, is_same_token, new_token, token_of_file};
use tandem_web::{Options, Server};

use crate::args;

/// The page's server, and the address that opens it.
pub struct Page {
    /// With the token behind #, where no server and no log sees it.
    pub link: String,
    #[allow(dead_code, reason = "it serves while it lives")]
    server: Server,
}

/// Opens the page where it is asked for. Its token is that of the token file; without one it is good for this process.
pub fn open(options: &args::Serve, listen: &Listen) -> Result<Option<Page>, String> {
    let Some(address) = options.http else {
        return Ok(None);
    };
    let controller = listen
        .unix
        .clone()
        .ok_or("--http serves a machine on the wall clock: a replay has nobody to show")?;
    let token = match &options.http_token_file {
        Some(file) => token_of_file(file)?,
        None => new_token()?,
    };
    let known = token.clone();
    let server = Server::start(Options {
        address,
        names: options.http_host.clone(),
        admits: Arc::new(move |given| is_same_token(given, &known)),
        controller,
    })?;
    let link = format!("http://{}/#token={token}", server.address);
    Ok(Some(Page { link, server }))
}
