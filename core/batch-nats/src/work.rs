//! A worker: fetches a job, simulates it, records what came out, and only then acknowledges the job.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::time::Duration;

use async_nats::jetstream::consumer::{Consumer, pull};
use async_nats::jetstream::object_store::ObjectStore;
use async_nats::jetstream::stream::Stream;
use async_nats::jetstream::{AckKind, Message};
use futures_util::StreamExt;
use futures_util::future::try_join_all;
use tandem_batch::{Build, Ended, FORMAT, Inputs, Job, JobResult, MAX_TRIES};
use tokio::io::AsyncReadExt;
use tokio::task::spawn_blocking;
use tokio::time::timeout;

use crate::server::{Server, persistent};

/// How long a worker waits for a job before it looks whether any are left.
const FETCH: Duration = Duration::from_secs(1);
/// How long a repetition is put back the first time, while its job is not done, or so that another worker may have it; then
/// twice as long, three times.
const PUT_BACK: Duration = Duration::from_millis(500);
/// How often it is put back for another worker: then the one that did the job has it, or nobody.
const FOR_ANOTHER: i64 = 3;
/// How often it comes before it is left: after a quarter of an hour, or if it ends its workers.
const MAX_REPETITIONS: i64 = 60;
/// How long an input may take to come before it is asked for anew.
const INPUT: Duration = Duration::from_secs(20);

/// What a worker works with.
pub struct Worker {
    /// Inputs that were fetched before.
    pub inputs: Arc<Inputs>,
    /// What computes here.
    pub build: Build,
    /// Simulates a job.
    pub simulate: Arc<dyn Fn(&Job) -> Ended + Send + Sync>,
    /// At most so many at once.
    pub threads: usize,
    /// Set from outside: no further job is begun.
    pub stop: Arc<AtomicBool>,
    /// Its name, by which a repetition is given to another.
    pub name: String,
    /// Is told how many are done after each.
    pub tell: Arc<dyn Fn(usize) + Send + Sync>,
}

/// A worker at its server.
struct At<'a> {
    server: &'a Server,
    worker: &'a Worker,
    jobs: Stream,
    results: Stream,
    inputs: ObjectStore,
    consumer: Consumer<pull::Config>,
    /// Between two signs of life: three in the time after which the server takes a worker for gone.
    beat: Duration,
}

impl Server {
    /// Works until no job is left, of any worker; how many this one has done.
    ///
    /// # Errors
    /// Nothing was submitted, the server is away for too long, or an input is not there.
    pub fn work(&self, worker: &Worker) -> Result<usize, String> {
        let done = AtomicUsize::new(0);
        self.runtime.block_on(async {
            let jobs = self.jobs().await?;
            let consumer = self.consumer(&jobs).await?;
            let at = At {
                server: self,
                worker,
                jobs,
                results: self.results().await?,
                inputs: self.inputs().await?,
                // What the server does, and not what this command would ask for.
                beat: consumer.cached_info().config.ack_wait / 3,
                consumer,
            };
            try_join_all((0..worker.threads).map(|_| at.one_at_a_time(&done))).await
        })?;
        Ok(done.into_inner())
    }
}

impl At<'_> {
    async fn one_at_a_time(&self, done: &AtomicUsize) -> Result<(), String> {
        while !self.worker.stop.load(Relaxed) {
            let one = || {
                self.consumer
                    .batch()
                    .max_messages(1)
                    .expires(FETCH)
                    .messages()
            };
            match persistent(one).await?.next().await {
                // The server is away, or has nothing within the time.
                None | Some(Err(_)) => {
                    let info = persistent(|| self.jobs.get_info()).await?;
                    if info.state.messages == 0 {
                        return Ok(());
                    }
                }
                Some(Ok(message)) => match self.serve(&message).await {
                    Ok(true) => (self.worker.tell)(done.fetch_add(1, Relaxed) + 1),
                    Ok(false) => {}
                    Err(error) => {
                        // Another worker has it at once, and not when this one is taken for gone.
                        let _ = message.ack_with(AckKind::Nak(None)).await;
                        return Err(error);
                    }
                },
            }
        }
        Ok(())
    }

    /// Does the job of `message`, where it is still to be done here; whether it was simulated.
    async fn serve(&self, message: &Message) -> Result<bool, String> {
        let job: Job = serde_json::from_slice(&message.payload)
            .map_err(|e| format!("{}: {e}", message.subject))?;
        let (id, server) = (job.id(), self.server);
        let tries = message.info().map_err(|e| e.to_string())?.delivered;
        let recorded = server.recorded(&self.results, &server.done(&id)).await?;
        let asked_again = message.subject.ends_with(".again");
        let ended = if asked_again {
            match recorded {
                Some((first, _)) if matches!(first.ended, Ended::Lost(_)) => None,
                _ if tries > MAX_REPETITIONS => None,
                Some((_, by)) if by != self.worker.name || tries > FOR_ANOTHER => {
                    Some(self.simulate(&job, message).await?)
                }
                _ => {
                    let later = PUT_BACK * u32::try_from(tries).unwrap_or(1);
                    let _ = message.ack_with(AckKind::Nak(Some(later))).await;
                    return Ok(false);
                }
            }
        } else if recorded.is_some() {
            // Its worker was gone before it could say so.
            None
        } else if tries > MAX_TRIES as i64 {
            Some(Ended::Lost(format!(
                "its workers did not come back {MAX_TRIES} times"
            )))
        } else {
            Some(self.simulate(&job, message).await?)
        };
        let is_simulated = ended.is_some();
        if let Some(ended) = ended {
            let result = JobResult {
                format: FORMAT,
                job: id,
                build: self.worker.build.clone(),
                ended,
            };
            server
                .record(&self.results, &result, &self.worker.name, asked_again)
                .await?;
        }
        // Where the server does not hear it the job comes again, and is found to be recorded.
        let _ = message.double_ack().await;
        Ok(is_simulated)
    }

    /// Simulates on a thread of its own, and beats meanwhile.
    async fn simulate(&self, job: &Job, message: &Message) -> Result<Ended, String> {
        self.fetch_inputs(job).await?;
        let (simulate, own) = (Arc::clone(&self.worker.simulate), job.clone());
        let mut simulated = spawn_blocking(move || simulate(&own));
        loop {
            match timeout(self.beat, &mut simulated).await {
                Ok(ended) => return ended.map_err(|e| format!("{}: {e}", job.id())),
                // A beat that is lost costs a second run at most.
                Err(_) => drop(message.ack_with(AckKind::Progress).await),
            }
        }
    }

    async fn fetch_inputs(&self, job: &Job) -> Result<(), String> {
        // What comes may name more.
        loop {
            let missing = self.worker.inputs.missing(job).map_err(|e| e.to_string())?;
            if missing.is_empty() {
                return Ok(());
            }
            for hash in missing {
                self.fetch(&hash).await?;
            }
        }
    }

    async fn fetch(&self, hash: &str) -> Result<(), String> {
        let read = || async {
            let mut object = self.inputs.get(hash).await.map_err(|e| e.to_string())?;
            let mut bytes = vec![];
            match timeout(INPUT, object.read_to_end(&mut bytes)).await {
                Ok(Ok(_)) => Ok(bytes),
                Ok(Err(error)) => Err(error.to_string()),
                Err(_) => Err("it does not come".to_string()),
            }
        };
        let bytes = persistent(read).await.map_err(|e| format!("{hash}: {e}"))?;
        let fetched = self.worker.inputs.put(&bytes).map_err(|e| e.to_string())?;
        if fetched == hash {
            Ok(())
        } else {
            Err(format!("{hash}: the server holds something else"))
        }
    }
}
