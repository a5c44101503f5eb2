//! `tandem serve --http`: the operator's page.

use std::sync::Arc;

use tandem_session::operator::{Listen, Role, Tokens, new_token};
use tandem_web::{Entry, Options, Server};

use crate::args;

/// The page's server, and the address that opens it.
pub struct Page {
    /// For each token, behind # where no server and no log sees it, and what it lets do.
    pub links: Vec<(String, Role)>,
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
    let mut tokens = match &options.http_token_file {
        Some(file) => Tokens::of_files([(file.as_path(), Role::SetUp)])?,
        None => Tokens::of_owner(new_token()?),
    };
    for (file, role) in options.operator.role_token_files() {
        tokens.add(&file, role)?;
    }
    let links: Vec<_> = tokens.all().to_vec();
    let server = Server::start(Options {
        address,
        names: options.http_host.clone(),
        tokens: Arc::new(move |given| tokens.role_of(given).map(entry)),
        controller,
    })?;
    let link = |(token, role)| (format!("http://{}/#token={token}", server.address), role);
    let links = links.into_iter().map(link).collect();
    Ok(Some(Page { links, server }))
}

/// A page comes through the socket of this user, and may do what its token says.
fn entry(role: Role) -> Entry {
    let steps_down = || format!(r#"{{"id":0,"request":"role","as":"{}"}}"#, role.name());
    Entry {
        opening: (role < Role::SetUp).then(steps_down),
    }
}
