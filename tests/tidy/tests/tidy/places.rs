//! What no committed file may say.

use crate::expect_none;
use crate::tree::files;

#[test]
fn no_file_names_a_place_outside_the_repository() {
    // Put together here, so that this file does not find itself.
    let absolute = ["/wo", "rk/"].concat();
    let beside = ["../sha", "red/"].concat();
    let mut findings = vec![];
    for file in files(&[""]) {
        for (number, line) in file.lines() {
            if let Some(found) = [&absolute, &beside]
                .into_iter()
                .find(|place| line.contains(place.as_str()))
            {
                findings.push(format!("{}:{number}: names {found}", file.name));
            }
        }
    }
    expect_none("places outside the repository", &findings);
}
