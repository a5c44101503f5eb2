//! `tandem state`: a shop's files come in, are shown, and go out again.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

fn state(folder: &Path, command: &str, more: &[&str]) -> Output {
    let mut tandem = Command::new(env!("CARGO_BIN_EXE_tandem"));
    let machine =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
    tandem
        .args(["state", command, "--machine"])
        .arg(machine)
        .args(more);
    tandem
        .current_dir(folder)
        .env_remove("STATE_DIRECTORY")
        .env("XDG_STATE_HOME", folder.join("kept"));
    tandem.output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn a_shops_files_come_in_and_go_out() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(
        folder.join("shop.var"),
        "500 2.5\n5220 2\n5221 10\n5224 3\n5241 1.5\n",
    )
    .unwrap();
    std::fs::write(folder.join("tool.tbl"), "T3 P1 Z+20.5 D6 ;end mill\n").unwrap();
    let nothing = state(folder, "show", &[]);
    assert_eq!(nothing.status.code(), Some(1));
    assert!(
        text(&nothing.stderr).contains("there is no such file"),
        "{}",
        text(&nothing.stderr)
    );

    let import = state(
        folder,
        "import",
        &["--var", "shop.var", "--tools", "tool.tbl", "--unit", "inch"],
    );
    let said = text(&import.stderr);
    assert_eq!(import.status.code(), Some(0), "{said}");
    let warning = "shop.var:4: warning: #5224 = 3 was not taken over: the machine has no axis A";
    assert!(
        said.contains(warning) && said.contains("1 tools, 1 parameters, 1 values not taken over"),
        "{said}"
    );

    let shown = text(&state(folder, "show", &[]).stdout);
    for line in [
        "G54  x_mm 254.0000  y_mm 0.0000  z_mm 0.0000",
        "G55  x_mm 38.1000  y_mm 0.0000  z_mm 0.0000  in force",
        "#500 = 2.5",
        "T3  x_mm 0.0000  y_mm 0.0000  z_mm 520.7000  diameter_mm 152.4000  end mill",
    ] {
        assert!(
            shown.lines().any(|shown| shown == line),
            "no line {line:?} in\n{shown}"
        );
    }

    let export = state(
        folder,
        "export",
        &["--var", "out.var", "--tools", "out.tbl", "--unit", "inch"],
    );
    assert_eq!(export.status.code(), Some(0), "{}", text(&export.stderr));
    let variables = std::fs::read_to_string(folder.join("out.var")).unwrap();
    for line in [
        "500\t2.500000000",
        "5220\t2.000000000",
        "5221\t10.000000000",
        "5241\t1.500000000",
    ] {
        assert!(
            variables.lines().any(|written| written == line),
            "no line {line:?} in\n{variables}"
        );
    }
    let tools = std::fs::read_to_string(folder.join("out.tbl")).unwrap();
    assert_eq!(tools, "T3 P1 Z20.500000000 D6.000000000 ;end mill\n");
}

#[test]
fn what_cannot_be_read_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("good.var"), "500 1\n").unwrap();
    std::fs::write(folder.join("bad.var"), "500 2\n501 two\n").unwrap();
    assert_eq!(
        state(folder, "import", &["--var", "good.var"])
            .status
            .code(),
        Some(0)
    );
    let refused = state(folder, "import", &["--var", "bad.var"]);
    assert_eq!(refused.status.code(), Some(1));
    assert_eq!(
        text(&refused.stderr),
        "bad.var:2: error: \"two\" is no number\n"
    );
    let shown = text(&state(folder, "show", &[]).stdout);
    assert!(shown.contains("#500 = 1\n"), "{shown}");
    // One of the two files must be named.
    assert_eq!(state(folder, "export", &[]).status.code(), Some(2));
}

#[test]
fn shells_and_man_know_every_command() {
    let print = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_tandem"))
            .args(arguments)
            .output()
            .unwrap();
        assert!(output.status.success(), "{arguments:?}");
        text(&output.stdout)
    };
    let help = print(&["--help"]);
    let commands: Vec<_> = help
        .lines()
        .skip_while(|line| !line.starts_with("Commands:"))
        .skip(1)
        .take_while(|line| !line.is_empty())
        // What is said of a command goes on far to the right.
        .filter(|line| !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert!(commands.len() > 12, "{help}");
    let man = print(&["man"]);
    assert!(man.contains(".TH tandem 1"), "{man}");
    for shell in ["bash", "zsh", "fish"] {
        let completions = print(&["completions", shell]);
        assert!(
            completions.contains("--machine") || completions.contains("-l machine"),
            "{shell}"
        );
        for command in &commands {
            assert!(
                completions.contains(command),
                "{shell} does not complete {command}"
            );
        }
    }
    for command in &commands {
        assert!(
            man.contains(&format!("TANDEM {}", command.to_uppercase())),
            "the page lacks {command}"
        );
    }
}

/// Drives lines on a controller with a state file, on the virtual clock, and tells where the machine has come to.
fn driven(folder: &Path, lines: &[&str]) -> String {
    let machine =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
    let mut script =
        String::from("{\"tick\":1000,\"say\":{\"id\":1,\"request\":\"lease\",\"how\":\"take\"}}\n");
    for (nth, line) in lines.iter().enumerate() {
        let say = format!("{{\"id\":2,\"request\":\"mdi\",\"line\":\"{line}\"}}");
        // A string takes whatever is written to it.
        let _ = writeln!(script, "{{\"tick\":{},\"say\":{say}}}", 2000 + 3000 * nth);
    }
    let (tick, say) = (
        2000 + 3000 * lines.len(),
        "{\"id\":9,\"request\":\"status\"}",
    );
    let _ = writeln!(script, "{{\"tick\":{tick},\"say\":{say}}}");
    std::fs::write(folder.join("script"), script).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_tandem"))
        .args([
            "serve",
            "--clock",
            "virtual",
            "--requests",
            "script",
            "--state",
            "kept.sqlite",
            "--machine",
        ])
        .arg(machine)
        .current_dir(folder)
        .output()
        .unwrap();
    let said = text(&output.stdout);
    assert!(
        output.status.success() && !said.contains("\"error\""),
        "{said}{}",
        text(&output.stderr)
    );
    let status = said
        .lines()
        .rfind(|line| line.contains("\"id\":9"))
        .unwrap();
    let status: serde_json::Value = serde_json::from_str(status).unwrap();
    let place = &status["told"]["ok"]["position"];
    ["x_mm", "y_mm", "z_mm"]
        .map(|axis| place[axis].to_string())
        .join(" ")
}

/// G28.1 and G30.1 store where the machine stands, and G28 and G30 of another process go there.
#[test]
fn stored_positions_last_from_process_to_process() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let stored = driven(
        folder,
        &["G0 X5 Y6", "G28.1", "G0 X-7 Y8 Z2", "G30.1", "G0 X0 Y0 Z0"],
    );
    assert_eq!(stored, "0.0 0.0 0.0");
    assert_eq!(driven(folder, &["G30"]), "-7.0 8.0 2.0");
    assert_eq!(driven(folder, &["G28"]), "5.0 6.0 0.0");
    let shown = state(folder, "show", &["--state", "kept.sqlite"]);
    let shown = text(&shown.stdout);
    assert!(
        shown.contains("G30  x_mm -7.0000  y_mm 8.0000  z_mm 2.0000"),
        "{shown}"
    );
}
