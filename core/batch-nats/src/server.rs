//! A batch at a server: what is submitted, how far it is, what came out.

use std::collections::BTreeSet;
use std::future::Future;
use std::time::Duration;

use async_nats::HeaderMap;
use async_nats::jetstream::consumer::{AckPolicy, Consumer, pull};
use async_nats::jetstream::context::{GetStreamErrorKind, PublishErrorKind};
use async_nats::jetstream::message::PublishMessage;
use async_nats::jetstream::object_store::{self, ObjectStore};
use async_nats::jetstream::stream::{
    Config, LastRawMessageErrorKind, RetentionPolicy, StorageType, Stream,
};
use async_nats::jetstream::{self, Context, ErrorCode};
use futures_util::{StreamExt, TryStreamExt, stream};
use tandem_batch::{Inputs, Job, JobResult, Listed};
use tokio::runtime::Runtime;
use tokio::time::{Instant, sleep};

/// Requests that wait for their answer at the same time.
const IN_FLIGHT: usize = 128;
/// One job in so many is simulated a second time, by another worker where there is one, and compared.
const AGAIN_EVERY: u64 = 20;
/// How long a server may be away before who needs it gives up.
const PATIENCE: Duration = Duration::from_secs(60);
/// How long it may take to answer at the beginning: a wrong address is told soon.
const CONNECTING: Duration = Duration::from_secs(5);
/// Between two tries.
const PAUSE: Duration = Duration::from_millis(300);

/// Name of the header with the worker of a result.
const WORKER: &str = "Tandem-Worker";
/// Name of the consumer that all workers share.
const WORKERS: &str = "workers";

/// A connection to a server, and the batch that it is about.
pub struct Server {
    pub(crate) runtime: Runtime,
    pub(crate) context: Context,
    name: String,
}

/// How far a batch is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Jobs with a result.
    pub done: usize,
    /// Jobs with a second one, which was compared or will be.
    pub again: usize,
    /// Jobs, and repetitions of jobs, that no worker has ended yet.
    pub left: u64,
}

/// What was collected.
#[derive(Clone, Debug, Default)]
pub struct Collected {
    /// The first result of each job that has one, in the order of the jobs.
    pub results: Vec<JobResult>,
    /// Second results that are not the same as the first one of their job: another build or computer gives other bits.
    pub differing: Vec<JobResult>,
}

impl Server {
    /// Connects to the server at `url`, for the batch called `name` there.
    ///
    /// # Errors
    /// The name is none, or there is no server with JetStream.
    pub fn connect(url: &str, name: &str) -> Result<Self, String> {
        let fits = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.is_empty() || !name.chars().all(fits) {
            return Err(format!(
                "{name}: a batch at a server is named by letters, digits, - and _"
            ));
        }
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .map_err(|e| e.to_string())?;
        let connecting = patient(CONNECTING, || async {
            let client = async_nats::connect(url).await.map_err(|e| e.to_string())?;
            let context = jetstream::new(client);
            match context.query_account().await {
                Ok(_) => Ok(context),
                Err(error) => Err(format!("JetStream does not answer: {error}")),
            }
        });
        let context = runtime.block_on(connecting);
        Ok(Self {
            context: context.map_err(|e| format!("{url}: {e}"))?,
            runtime,
            name: name.to_string(),
        })
    }

    /// The subject of a job that is to be done for the first time, or again.
    fn todo(&self, id: &str, round: &str) -> String {
        format!("tandem.{}.todo.{id}.{round}", self.name)
    }

    /// The subject of the first result of a job.
    pub(crate) fn done(&self, id: &str) -> String {
        format!("tandem.{}.done.{id}", self.name)
    }

    /// That of its second.
    pub(crate) fn again(&self, id: &str) -> String {
        format!("tandem.{}.again.{id}", self.name)
    }

    fn stream_name(&self, what: &str) -> String {
        format!("TANDEM-{}-{what}", self.name)
    }

    async fn create(
        &self,
        what: &str,
        retention: RetentionPolicy,
        subjects: &[&str],
    ) -> Result<Stream, String> {
        let subject = |what: &&str| format!("tandem.{}.{what}.>", self.name);
        let config = Config {
            name: self.stream_name(what),
            subjects: subjects.iter().map(subject).collect(),
            retention,
            storage: StorageType::File,
            ..Config::default()
        };
        persistent(|| self.context.get_or_create_stream(config.clone())).await
    }

    async fn opened(&self, what: &str) -> Result<Stream, String> {
        let name = self.stream_name(what);
        let found = persistent(|| async {
            match self.context.get_stream(&name).await {
                Err(error) => match error.kind() {
                    GetStreamErrorKind::JetStream(of)
                        if of.error_code() == ErrorCode::STREAM_NOT_FOUND =>
                    {
                        Ok(None)
                    }
                    _ => Err(error),
                },
                Ok(stream) => Ok(Some(stream)),
            }
        });
        found
            .await?
            .ok_or_else(|| format!("no batch called {} was submitted there", self.name))
    }

    /// The stream of jobs that are not done, in which each lies until it is acknowledged.
    pub(crate) async fn jobs(&self) -> Result<Stream, String> {
        self.opened("todo").await
    }

    /// The stream of results.
    pub(crate) async fn results(&self) -> Result<Stream, String> {
        self.opened("done").await
    }

    /// The store of inputs, which is made where it is not there.
    pub(crate) async fn inputs(&self) -> Result<ObjectStore, String> {
        let config = object_store::Config {
            bucket: self.stream_name("inputs"),
            storage: StorageType::File,
            ..object_store::Config::default()
        };
        persistent(|| async {
            match self.context.get_object_store(&config.bucket).await {
                Ok(store) => Ok(store),
                Err(_) => self.context.create_object_store(config.clone()).await,
            }
        })
        .await
    }

    /// The consumer that all workers share.
    pub(crate) async fn consumer(&self, jobs: &Stream) -> Result<Consumer<pull::Config>, String> {
        persistent(|| jobs.get_consumer(WORKERS)).await
    }

    /// Puts the inputs of `jobs`, and then the jobs, at the server; what is there already stays, and what is done is not done again.
    /// It may be called again after any interruption. A worker that is silent for `ack_wait` is taken for gone.
    ///
    /// # Errors
    /// An input is missing, or the server is away for too long.
    pub fn submit(
        &self,
        jobs: &[Listed],
        inputs: &Inputs,
        ack_wait: Duration,
    ) -> Result<(), String> {
        let work = async {
            let todo = self
                .create("todo", RetentionPolicy::WorkQueue, &["todo"])
                .await?;
            let results = self
                .create("done", RetentionPolicy::Limits, &["done", "again"])
                .await?;
            let config = pull::Config {
                durable_name: Some(WORKERS.to_string()),
                ack_policy: AckPolicy::Explicit,
                ack_wait,
                max_ack_pending: -1,
                ..pull::Config::default()
            };
            persistent(|| todo.get_or_create_consumer(WORKERS, config.clone())).await?;
            self.put_inputs(jobs, inputs).await?;
            let done = self.subjects(&results, &self.done(">")).await?;
            let again = self.subjects(&results, &self.again(">")).await?;
            let is_due = |id: &str| {
                u64::from_str_radix(&id[..8], 16).is_ok_and(|number| number % AGAIN_EVERY == 0)
            };
            let ids: Vec<(String, &Job)> = jobs
                .iter()
                .map(|listed| (listed.job.id(), &listed.job))
                .collect();
            let firsts = ids
                .iter()
                .filter(|(id, _)| !done.contains(&self.done(id)))
                .map(|(id, job)| (self.todo(id, "first"), *job));
            self.publish_jobs(firsts).await?;
            // Behind all others: then their first results are there, and workers are many.
            let repetitions = ids
                .iter()
                .filter(|(id, _)| is_due(id) && !again.contains(&self.again(id)))
                .map(|(id, job)| (self.todo(id, "again"), *job));
            self.publish_jobs(repetitions).await
        };
        self.runtime.block_on(work)
    }

    async fn publish_jobs(&self, jobs: impl Iterator<Item = (String, &Job)>) -> Result<(), String> {
        let published = jobs.map(|(subject, job)| async move {
            let payload = serde_json::to_vec(job).map_err(|e| e.to_string())?;
            self.publish_first(&subject, payload, None)
                .await
                .map(|_| ())
        });
        stream::iter(published)
            .buffer_unordered(IN_FLIGHT)
            .try_collect()
            .await
    }

    async fn put_inputs(&self, jobs: &[Listed], inputs: &Inputs) -> Result<(), String> {
        let (mut needed, mut seen) = (BTreeSet::new(), BTreeSet::new());
        for Listed { job, .. } in jobs {
            if seen.insert((&job.program, &job.machine)) {
                needed.extend(inputs.parts(job).map_err(|e| e.to_string())?);
            }
        }
        let store = self.inputs().await?;
        for hash in needed {
            if store.info(&hash).await.is_ok() {
                continue;
            }
            let bytes = inputs.get(&hash).map_err(|e| e.to_string())?;
            persistent(|| {
                let (store, mut bytes) = (&store, std::io::Cursor::new(bytes.clone()));
                let hash = hash.as_str();
                async move { store.put(hash, &mut bytes).await }
            })
            .await?;
        }
        Ok(())
    }

    /// Publishes what its subject is to have once, and waits until the server has it on its disk. Whether it is the first.
    ///
    /// # Errors
    /// The server is away for too long.
    async fn publish_first(
        &self,
        subject: &str,
        payload: Vec<u8>,
        headers: Option<HeaderMap>,
    ) -> Result<bool, String> {
        persistent(|| async {
            let message = PublishMessage::build().payload(payload.clone().into());
            let message = match &headers {
                Some(headers) => message.headers(headers.clone()),
                None => message,
            };
            let message = message.expected_last_subject_sequence(0);
            let sent = self.context.send_publish(subject.to_string(), message);
            let answer = match sent.await {
                Ok(acknowledged) => acknowledged.await,
                Err(error) => Err(error),
            };
            match answer {
                Ok(_) => Ok(true),
                Err(error) if error.kind() == PublishErrorKind::WrongLastSequence => Ok(false),
                Err(error) => Err(error),
            }
        })
        .await
    }

    /// Records a result of the worker called `by` as the first or the second of its job; a third tells nothing more. `asked_again`
    /// says that the job was handed out to be done a second time.
    ///
    /// # Errors
    /// The server is away for too long, or holds what is no result.
    pub(crate) async fn record(
        &self,
        results: &Stream,
        result: &JobResult,
        by: &str,
        asked_again: bool,
    ) -> Result<(), String> {
        let mut headers = HeaderMap::new();
        headers.insert(WORKER, by);
        let text = result.text().into_bytes();
        let done = self.done(&result.job);
        let is_first = self
            .publish_first(&done, text.clone(), Some(headers.clone()))
            .await?;
        if is_first {
            return Ok(());
        }
        if !asked_again {
            let first = self.recorded(results, &done).await?;
            if first.is_some_and(|(_, first)| first == by) {
                // It is this very result, whose acknowledgement was lost.
                return Ok(());
            }
        }
        let again = self.again(&result.job);
        self.publish_first(&again, text, Some(headers)).await?;
        Ok(())
    }

    /// The result of a subject, with the worker that published it.
    ///
    /// # Errors
    /// The server is away for too long, or holds what is no result.
    pub(crate) async fn recorded(
        &self,
        results: &Stream,
        subject: &str,
    ) -> Result<Option<(JobResult, String)>, String> {
        let message = persistent(|| async {
            match results.get_last_raw_message_by_subject(subject).await {
                Err(error) if error.kind() == LastRawMessageErrorKind::NoMessageFound => Ok(None),
                other => other.map(Some),
            }
        });
        let Some(message) = message.await? else {
            return Ok(None);
        };
        let by = message.headers.get(WORKER);
        let by = by.map(|by| by.as_str().to_string()).unwrap_or_default();
        let result = JobResult::read(&message.payload)
            .ok_or_else(|| format!("{subject}: it is no result"))?;
        Ok(Some((result, by)))
    }

    async fn subjects(&self, of: &Stream, filter: &str) -> Result<BTreeSet<String>, String> {
        persistent(|| async {
            let found = of.info_with_subjects(filter).await;
            let found = found.map_err(|e| e.to_string())?;
            let subjects = found.map_ok(|(subject, _)| subject).try_collect();
            subjects.await.map_err(|e| e.to_string())
        })
        .await
    }

    /// The results of `jobs` that are there.
    ///
    /// # Errors
    /// Nothing was submitted, the server is away for too long, or it holds what is no result.
    pub fn collect(&self, jobs: &[Listed]) -> Result<Collected, String> {
        self.runtime.block_on(async {
            let results = &self.results().await?;
            let again = &self.subjects(results, &self.again(">")).await?;
            let each = jobs.iter().map(|listed| async move {
                let id = listed.job.id();
                let first = self.recorded(results, &self.done(&id)).await?;
                let second = self.again(&id);
                let second = if again.contains(&second) {
                    self.recorded(results, &second).await?
                } else {
                    None
                };
                Ok::<_, String>((first, second))
            });
            let mut each = stream::iter(each).buffered(IN_FLIGHT);
            let mut collected = Collected::default();
            while let Some(of_job) = each.next().await {
                let (first, second) = of_job?;
                if let (Some((first, _)), Some((second, _))) = (&first, second)
                    && first.ended != second.ended
                {
                    collected.differing.push(second);
                }
                collected.results.extend(first.map(|(result, _)| result));
            }
            Ok(collected)
        })
    }

    /// How far the batch is.
    ///
    /// # Errors
    /// Nothing was submitted, or the server is away for too long.
    pub fn progress(&self) -> Result<Progress, String> {
        self.runtime.block_on(async {
            let (jobs, results) = (self.jobs().await?, self.results().await?);
            Ok(Progress {
                done: self.subjects(&results, &self.done(">")).await?.len(),
                again: self.subjects(&results, &self.again(">")).await?.len(),
                left: persistent(|| jobs.get_info()).await?.state.messages,
            })
        })
    }

    /// Takes every job away that is not done.
    ///
    /// # Errors
    /// Nothing was submitted, or the server is away for too long.
    pub fn cancel(&self) -> Result<(), String> {
        self.runtime.block_on(async {
            let jobs = self.jobs().await?;
            persistent(|| async { jobs.purge().await })
                .await
                .map(|_| ())
        })
    }
}

/// Tries until it succeeds, or the server was away for too long.
pub async fn persistent<T, E: ToString, F: Future<Output = Result<T, E>>>(
    attempt: impl FnMut() -> F,
) -> Result<T, String> {
    patient(PATIENCE, attempt).await
}

async fn patient<T, E: ToString, F: Future<Output = Result<T, E>>>(
    patience: Duration,
    mut attempt: impl FnMut() -> F,
) -> Result<T, String> {
    let since = Instant::now();
    loop {
        match attempt().await {
            Ok(value) => return Ok(value),
            Err(error) if since.elapsed() > patience => return Err(error.to_string()),
            Err(_) => sleep(PAUSE).await,
        }
    }
}
