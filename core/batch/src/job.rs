//! A job: what is simulated, by the hashes of its inputs, and with what.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use crate::hash::{sha256, sha256_of_file};

/// Number of the format of jobs and results.
pub const FORMAT: u32 = 1;

/// One program on one machine with some of its keys set. Nothing else decides what comes out.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Job {
    /// Hash of the program's text.
    pub program: String,
    /// Hash of the machine, as [`crate::Inputs::put_machine`] gives it.
    pub machine: String,
    /// Keys of the machine file and their values, the later ones on top.
    pub set: Vec<(String, String)>,
    /// Lines that begin with `/` are left out.
    pub block_delete: bool,
}

impl Job {
    /// The job's name: the hash of what it is.
    pub fn id(&self) -> String {
        let text = serde_json::to_string(&(FORMAT, self)).expect("a job is plain data");
        sha256(text.as_bytes())
    }
}

/// What computes: another one may give other bits, and its results have other names.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Build {
    /// Hash of the program that computes.
    pub binary: String,
    /// Hash of what the mathematical functions of this computer's library answer.
    pub maths: String,
}

impl Build {
    /// That of this process. Host; reads its file once.
    ///
    /// # Errors
    /// The file of this process cannot be read.
    pub fn of_this_process() -> Result<Self, String> {
        let binary = std::env::current_exe().and_then(|path| sha256_of_file(&path));
        Ok(Self {
            binary: binary.map_err(|e| format!("the file of this process: {e}"))?,
            maths: maths(),
        })
    }

    /// The name of the result of the job called `id`.
    pub fn key(&self, id: &str) -> String {
        sha256(format!("{id} {} {}", self.binary, self.maths).as_bytes())
    }
}

/// Arguments that each function is asked for. A library picks the code of a function by the processor; where two differ at all they
/// do so in the last bit of one argument in some thousands, and where they do not here they seldom do in a job.
const ARGUMENTS: u32 = 20_000;

fn maths() -> String {
    let mut answers = Vec::with_capacity(ARGUMENTS as usize * 80);
    for i in 1..=ARGUMENTS {
        let x = f64::from(i) * 0.001_234_567_891;
        let (sin, cos) = x.sin_cos();
        let of = [
            sin,
            cos,
            x.tan(),
            sin.asin(),
            cos.acos(),
            sin.atan2(cos),
            x.ln(),
            (-x).exp(),
            x.cbrt(),
            x.powf(0.37),
        ];
        answers.extend(of.iter().flat_map(|answer| answer.to_le_bytes()));
    }
    sha256(&answers)
}

/// `set` as people read it.
pub fn shown(set: &[(String, String)]) -> String {
    let mut text = String::new();
    for (key, value) in set {
        let _ = write!(
            text,
            "{}{key}={value}",
            if text.is_empty() { "" } else { " " }
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_is_called_by_everything_that_it_is() {
        let job = Job {
            program: "p".into(),
            machine: "m".into(),
            set: vec![("a".into(), "1".into())],
            block_delete: false,
        };
        let others = [
            Job {
                program: "q".into(),
                ..job.clone()
            },
            Job {
                machine: "n".into(),
                ..job.clone()
            },
            Job {
                set: vec![],
                ..job.clone()
            },
            Job {
                set: vec![("a".into(), "2".into())],
                ..job.clone()
            },
            Job {
                block_delete: true,
                ..job.clone()
            },
        ];
        assert_eq!(job.id(), job.clone().id());
        for other in others {
            assert_ne!(job.id(), other.id(), "{other:?}");
        }
    }

    #[test]
    fn another_binary_or_library_gives_results_of_other_names() {
        let build = Build::of_this_process().unwrap();
        assert_eq!(build, Build::of_this_process().unwrap());
        let binary = Build {
            binary: "b".into(),
            ..build.clone()
        };
        let maths = Build {
            maths: "m".into(),
            ..build.clone()
        };
        assert_ne!(build.key("job"), binary.key("job"));
        assert_ne!(build.key("job"), maths.key("job"));
    }
}
