//! `tandem latency`: that it counts; how late this computer is, no test can ask.

use std::process::Command;

/// The number that follows `word` in `text`.
fn number_after(text: &str, word: &str) -> u64 {
    let (_, rest) = text
        .split_once(word)
        .unwrap_or_else(|| panic!("no {word:?} in {text}"));
    rest.split(|c: char| !c.is_ascii_digit())
        .find(|digits| !digits.is_empty())
        .unwrap()
        .parse()
        .unwrap()
}

#[test]
fn the_counts_add_up_to_the_periods() {
    for more in [&[][..], &["--load"][..]] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
        let output = command
            .args(["latency", "--duration", "0.2", "--period", "2"])
            .args(more)
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let text = String::from_utf8(output.stdout).unwrap();
        let rows = text.lines().filter(|line| line.contains(" to "));
        let counted: u64 = rows
            .map(|row| {
                row.split_whitespace()
                    .nth(3)
                    .unwrap()
                    .parse::<u64>()
                    .unwrap()
            })
            .sum();
        let [periods, wake_ups, missed] =
            ["periods", ": wake-ups", "missed"].map(|word| number_after(&text, word));
        assert_eq!(counted, wake_ups, "{text}");
        assert_eq!(wake_ups + missed, periods, "{text}");
        // A stall at the very end is counted whole.
        assert!(periods >= 100, "{text}");
    }
}

#[test]
fn the_histogram_is_drawn_beside_that_of_cyclictest() {
    let folder = tempfile::tempdir().unwrap();
    let (page, printed) = (
        folder.path().join("latency.html"),
        folder.path().join("cyclictest.txt"),
    );
    std::fs::write(
        &printed,
        "# Histogram\n000007 000123\n000008 000004\n# Max Latencies: 00008\n",
    )
    .unwrap();
    let run = |cyclictest: &std::path::Path| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
        command
            .args(["latency", "--duration", "0.1", "--period", "2", "--report"])
            .arg(&page);
        command
            .arg("--cyclictest")
            .arg(cyclictest)
            .output()
            .unwrap()
    };
    let output = run(&printed);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("cyclictest: 127 wake-ups, p50 7."), "{text}");
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(
        html.contains("<td>127<td>7") && html.matches("</svg>").count() == 2,
        "{html}"
    );
    assert!(
        !html.contains("http:") && !html.contains("https:") && !html.contains("<script"),
        "{html}"
    );
    // What was measured is told although there is nothing to show beside it.
    let output = run(&crate::harness::mill());
    assert_eq!(output.status.code(), Some(1));
    assert!(
        String::from_utf8_lossy(&output.stderr)
            .contains("mill-3axis.toml: no histogram of cyclictest")
    );
    assert!(String::from_utf8_lossy(&output.stdout).contains("p99.9"));
}

#[test]
fn a_period_that_is_none_is_refused() {
    for period in ["0", "-1", "soon", "inf"] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
        let output = command
            .args(["latency", &format!("--period={period}")])
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2), "{period}");
    }
}
