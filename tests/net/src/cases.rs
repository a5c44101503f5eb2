//! What is run with both builds.

use std::path::{Path, PathBuf};

use tandem_campaign::draw::draw;
use tandem_campaign::machine::Planner;

/// One call of `tandem`.
#[derive(Clone, Debug, Default)]
pub struct Case {
    /// Group, `/`, and a name within it.
    pub name: String,
    /// Arguments; files of the case are named without a path.
    pub arguments: Vec<String>,
    /// Names and contents of the files that the case brings.
    pub files: Vec<(String, Vec<u8>)>,
    /// What is typed.
    pub input: String,
    /// The machine file, where the oracle can be asked.
    pub machine: Option<PathBuf>,
    /// The program file, where the oracle can be asked.
    pub program: Option<PathBuf>,
}

/// All cases: examples, programs of the tests, cases of the campaign, random ones, other commands, and recorded ones.
///
/// # Errors
/// A file that cannot be read.
pub fn all(project: &Path, recorded: Option<&Path>, seeds: u64) -> Result<Vec<Case>, String> {
    let mut cases = examples(project)?;
    cases.extend(bad_programs(project)?);
    cases.extend(other_commands(project));
    cases.extend(campaign(project)?);
    for (planner, _) in Planner::SHARES {
        cases.extend((1..=seeds).map(|seed| random(seed, planner)));
    }
    if let Some(folder) = recorded {
        for folder in entries(folder)? {
            cases.extend(read_recorded(&folder)?);
        }
    }
    Ok(cases)
}

/// Files and folders in `folder`, in the order of their names.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let wrong = |e: std::io::Error| format!("{}: {e}", folder.display());
    let entries = std::fs::read_dir(folder).map_err(wrong)?;
    let mut paths = entries
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<Vec<_>, _>>()
        .map_err(wrong)?;
    paths.sort();
    Ok(paths)
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

/// A run of a program file on a machine file.
fn run(group: &str, program: &Path, machine: &Path, settings: &[&str]) -> Case {
    let [program_text, machine_text] =
        [program, machine].map(|path| path.to_string_lossy().into_owned());
    let mut arguments = vec![
        "run".to_string(),
        program_text,
        "--machine".to_string(),
        machine_text,
    ];
    arguments.extend(
        settings
            .iter()
            .flat_map(|setting| ["--set".to_string(), (*setting).to_string()]),
    );
    let settings = settings
        .iter()
        .flat_map(|setting| [" ", setting])
        .collect::<String>();
    Case {
        name: format!("{group}/{} on {}{settings}", stem(program), stem(machine)),
        arguments,
        machine: Some(machine.to_owned()),
        program: Some(program.to_owned()),
        ..Case::default()
    }
}

/// Every program of the examples and of the tests on every machine of the examples, with the planner of the machine, and on
/// the machines that it is for with every other. Most pairs fit; those that do not are compared as messages.
fn examples(project: &Path) -> Result<Vec<Case>, String> {
    let mut programs = Vec::new();
    for folder in [
        "examples/programs",
        "examples/block-overlap",
        "examples/policies",
        "examples/probing",
        "tests/fixtures/programs",
    ] {
        programs.extend(
            entries(&project.join(folder))?
                .into_iter()
                .filter(|path| path.is_file()),
        );
    }
    let machines: Vec<PathBuf> = entries(&project.join("examples/machines"))?;
    let mut cases = Vec::new();
    for program in &programs {
        for machine in &machines {
            cases.push(run("examples", program, machine, &[]));
        }
        for machine in [
            "mill-3axis",
            "mill-3axis-smooth",
            "corexy",
            "gantry",
            "rotary-table",
            "nurbs-demo",
        ] {
            let machine = project
                .join("examples/machines")
                .join(machine)
                .with_extension("toml");
            for (planner, _) in Planner::SHARES {
                let planner = format!("planner.plugin={}", planner.name());
                cases.push(run(
                    "planners",
                    program,
                    &machine,
                    &[&planner, "motion.jerk=report", "guard.mode=count"],
                ));
            }
        }
    }
    cases.extend(policies(project)?);
    Ok(cases)
}

/// Each policy script that comes with Tandem, on the example for policies.
fn policies(project: &Path) -> Result<Vec<Case>, String> {
    let scripts = entries(&project.join("scripts/policies"))?;
    let modules = scripts.iter().filter(|path| {
        path.extension()
            .is_some_and(|extension| extension == "wasm")
    });
    let [program, machine] = [
        "examples/policies/corners.ngc",
        "examples/machines/mill-3axis.toml",
    ]
    .map(|path| project.join(path));
    let case = |module: &PathBuf| {
        let script = format!("policy.script={}", module.display());
        run(
            "policies",
            &program,
            &machine,
            &["planner.plugin=block-overlap", &script],
        )
    };
    Ok(modules.map(case).collect())
}

/// Every program that is refused, for its messages.
fn bad_programs(project: &Path) -> Result<Vec<Case>, String> {
    let machine = project.join("examples/machines/mill-3axis.toml");
    let case = |program: &PathBuf| {
        let mut case = run("bad", program, &machine, &[]);
        case.arguments[0] = "check".to_string();
        case
    };
    Ok(entries(&project.join("tests/fixtures/programs/bad"))?
        .iter()
        .map(case)
        .collect())
}

/// Commands other than `run`.
fn other_commands(project: &Path) -> Vec<Case> {
    let machine = |name: &str| {
        project
            .join("examples/machines")
            .join(name)
            .with_extension("toml")
            .display()
            .to_string()
    };
    let raster = project
        .join("examples/programs/raster.ngc")
        .display()
        .to_string();
    let case = |name: &str, arguments: &[&str], input: &str| Case {
        name: format!("commands/{name}"),
        arguments: arguments.iter().map(ToString::to_string).collect(),
        input: input.to_string(),
        ..Case::default()
    };
    let mut cases = vec![
        case("home", &["home", "--machine", &machine("mill-homing")], ""),
        case(
            "estimate",
            &["estimate", &raster, "--machine", &machine("mill-3axis")],
            "",
        ),
        case("plugins", &["plugin", "list"], ""),
        case(
            "mdi",
            &[
                "mdi",
                "--machine",
                &machine("mill-3axis"),
                "--clock",
                "virtual",
            ],
            "G1 X5 F600\nX\nG4 P0.1\nG0 X0\n",
        ),
        case(
            "no machine",
            &["run", &raster, "--machine", "none.toml"],
            "",
        ),
    ];
    for command in [
        "run",
        "check",
        "mdi",
        "home",
        "jog",
        "estimate",
        "calibrate",
        "identify",
        "trace",
        "script",
        "plugin",
        "latency",
    ] {
        cases.push(case(&format!("{command} --help"), &[command, "--help"], ""));
    }
    cases
}

/// The cases that the campaign has found.
fn campaign(project: &Path) -> Result<Vec<Case>, String> {
    let mut cases = Vec::new();
    for group in ["kept", "open"] {
        let group = project.join("tests/fixtures/campaign").join(group);
        // Where no case is open there is no such folder.
        if !group.exists() {
            continue;
        }
        for folder in entries(&group)? {
            let mut case = run(
                "campaign",
                &folder.join("program.ngc"),
                &folder.join("machine.toml"),
                &[],
            );
            case.name = format!(
                "campaign/{}",
                folder.file_name().unwrap_or_default().to_string_lossy()
            );
            let commands = folder.join("commands.csv");
            if commands.exists() {
                case.arguments
                    .extend(["--commands".to_string(), commands.display().to_string()]);
            }
            cases.push(case);
        }
    }
    Ok(cases)
}

/// A machine, a program and an operator from a seed.
fn random(seed: u64, planner: Planner) -> Case {
    let drawn = draw(seed, Some(planner));
    let texts = [
        ("program.ngc", drawn.program),
        ("machine.toml", drawn.machine.text()),
        ("commands.csv", drawn.commands),
    ];
    let arguments = [
        "run",
        "program.ngc",
        "--machine",
        "machine.toml",
        "--commands",
        "commands.csv",
    ];
    Case {
        name: format!("random/{} {seed}", planner.name()),
        arguments: arguments.map(ToString::to_string).to_vec(),
        files: texts
            .into_iter()
            .map(|(name, text)| (name.to_string(), text.into_bytes()))
            .collect(),
        machine: Some("machine.toml".into()),
        program: Some("program.ngc".into()),
        ..Case::default()
    }
}

/// A case of the scenarios; none where it does not run on the virtual clock, and so is another one each time.
fn read_recorded(folder: &Path) -> Result<Option<Case>, String> {
    let mut case = Case {
        name: format!(
            "scenarios/{}",
            folder.file_name().unwrap_or_default().to_string_lossy()
        ),
        ..Case::default()
    };
    for path in entries(folder)? {
        let bytes = std::fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        let text = || String::from_utf8_lossy(&bytes).into_owned();
        match path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .as_ref()
        {
            "arguments" => case.arguments = text().lines().map(ToString::to_string).collect(),
            "input" => case.input = text(),
            name => case.files.push((name.to_string(), bytes)),
        }
    }
    let timed = case
        .arguments
        .iter()
        .any(|argument| ["wall", "--listen", "--listen-tcp"].contains(&argument.as_str()));
    case.program = case.arguments.get(1).map(PathBuf::from);
    let machine = case
        .arguments
        .iter()
        .position(|argument| argument == "--machine");
    case.machine = machine
        .and_then(|index| case.arguments.get(index + 1))
        .map(PathBuf::from);
    Ok((!timed).then_some(case))
}
