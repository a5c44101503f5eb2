//! A connection to a controller: requests go out, answers and events come in.

use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use serde_json::{Map, Value, json};

use super::find::only_controller;
use crate::args;

/// How long the end of a command waits for word that its lease is given back.
const RELEASED_WITHIN: Duration = Duration::from_secs(1);

/// Why a request came to nothing.
#[derive(Debug)]
pub enum Trouble {
    /// The controller refuses, in its words.
    Refused(String),
    /// The controller is gone, or says what nobody understands.
    Gone(String),
    /// A signal or a key has stopped the command before it moved anything.
    Stopped,
}

impl Trouble {
    /// The words.
    pub fn words(&self) -> &str {
        match self {
            Self::Refused(words) | Self::Gone(words) => words,
            Self::Stopped => "stopped by the operator: nothing was begun",
        }
    }
}

/// Sends requests, from any thread.
#[derive(Clone)]
pub struct RequestSender {
    stream: Arc<Mutex<UnixStream>>,
    last_id: Arc<AtomicU64>,
}

impl RequestSender {
    /// Says a request; its answer comes by itself. The answer is its number.
    ///
    /// # Errors
    /// The connection is gone.
    pub fn say(&self, request: &str, with: Value) -> Result<u64, Trouble> {
        let id = self.last_id.fetch_add(1, Relaxed) + 1;
        let mut line = match with {
            Value::Object(with) => with,
            _ => Map::new(),
        };
        line.insert("id".to_string(), json!(id));
        line.insert("request".to_string(), json!(request));
        let text = format!("{}\n", Value::Object(line));
        let mut stream = self.stream.lock().unwrap_or_else(PoisonError::into_inner);
        stream
            .write_all(text.as_bytes())
            .map(|()| id)
            .map_err(|e| Trouble::Gone(format!("the controller is gone: {e}")))
    }
}

/// A connection to a controller.
pub struct Connection {
    pub requests: RequestSender,
    told: Receiver<Result<Value, String>>,
    /// What came while an answer was waited for.
    early: Vec<Value>,
    leased: bool,
}

impl Connection {
    /// Connects to the controller that is named, or else to the only one that runs here.
    ///
    /// # Errors
    /// There is none, or it does not speak protocol 2.
    pub fn open(at: &args::Connect) -> Result<Self, String> {
        let path = at
            .socket()
            .map_or_else(only_controller, |path| Ok(path.to_owned()))?;
        let wrong = |why: String| {
            format!(
                "{}: {why}; tandem serve says where its socket is",
                path.display()
            )
        };
        let stream = UnixStream::connect(&path).map_err(|e| wrong(e.to_string()))?;
        let reader = stream.try_clone().map_err(|e| wrong(e.to_string()))?;
        let this = Self {
            requests: RequestSender {
                stream: Arc::new(Mutex::new(stream)),
                last_id: Arc::default(),
            },
            told: listen(reader),
            early: vec![],
            leased: false,
        };
        let greeting = this.receive().map_err(|e| wrong(e.words().to_string()))?;
        match greeting["tandem"]["protocol"].as_u64() {
            Some(2) => Ok(this),
            _ => Err(wrong("nobody there speaks protocol 2".to_string())),
        }
    }

    fn receive(&self) -> Result<Value, Trouble> {
        let gone = || "the controller has closed the connection".to_string();
        let told = self.told.recv().map_err(|_| gone());
        told.and_then(|told| told).map_err(Trouble::Gone)
    }

    /// What comes next that is no answer to [`Connection::ask`]; none where nothing comes within `patience`.
    ///
    /// # Errors
    /// The controller is gone.
    pub fn hear(&mut self, patience: Duration) -> Result<Option<Value>, Trouble> {
        if !self.early.is_empty() {
            return Ok(Some(self.early.remove(0)));
        }
        match self.told.recv_timeout(patience) {
            Ok(told) => told.map(Some).map_err(Trouble::Gone),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(Trouble::Gone(
                "the controller has closed the connection".to_string(),
            )),
        }
    }

    /// Sends a request and waits for its answer; what comes before it is kept for [`Connection::hear`].
    ///
    /// # Errors
    /// The controller refuses, or is gone.
    pub fn ask(&mut self, request: &str, with: Value) -> Result<Value, Trouble> {
        let id = self.requests.say(request, with)?;
        loop {
            let told = self.receive()?;
            if told["id"].as_u64() != Some(id) || told.get("event").is_some() {
                self.early.push(told);
            } else if let Some(error) = told.get("error") {
                let why = error["why"].as_str().unwrap_or_default();
                return Err(Trouble::Refused(why.to_string()));
            } else {
                return Ok(told["ok"].clone());
            }
        }
    }

    /// Takes the control lease, where this client has not got it.
    ///
    /// # Errors
    /// Another client holds it, or the controller is gone.
    pub fn take_lease(&mut self) -> Result<(), Trouble> {
        if !self.leased {
            self.ask("lease", json!({ "how": "take" }))?;
            self.leased = true;
        }
        Ok(())
    }

    /// Gives the control lease back, so that others may work while nobody does here.
    ///
    /// # Errors
    /// The controller is gone.
    pub fn release_lease(&mut self) -> Result<(), Trouble> {
        if std::mem::take(&mut self.leased) {
            match self.ask("lease", json!({ "how": "release" })) {
                // Another client has taken it over.
                Ok(_) | Err(Trouble::Refused(_)) => {}
                Err(other) => return Err(other),
            }
        }
        Ok(())
    }

    /// The control lease is another client's.
    pub fn lost_lease(&mut self) {
        self.leased = false;
    }
}

impl Drop for Connection {
    /// Gives the control lease back: the next command is not to wait until the controller has noticed that this one is over.
    fn drop(&mut self) {
        if !self.leased {
            return;
        }
        let Ok(id) = self.requests.say("lease", json!({ "how": "release" })) else {
            return;
        };
        while let Ok(Ok(told)) = self.told.recv_timeout(RELEASED_WITHIN) {
            if told["id"].as_u64() == Some(id) && told.get("event").is_none() {
                return;
            }
        }
    }
}

/// A thread that reads what comes. It ends with the connection.
fn listen(stream: UnixStream) -> Receiver<Result<Value, String>> {
    let (sender, receiver) = channel();
    thread::spawn(move || {
        let mut reader = BufReader::new(stream);
        let mut line = String::new();
        loop {
            line.clear();
            let told = match reader.read_line(&mut line) {
                Ok(0) => return,
                Ok(_) => serde_json::from_str(&line)
                    .map_err(|e| format!("the controller says what is no JSON: {e}")),
                Err(error) => Err(format!("the controller is gone: {error}")),
            };
            let ends = told.is_err();
            if sender.send(told).is_err() || ends {
                return;
            }
        }
    });
    receiver
}
