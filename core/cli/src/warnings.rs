//! What is to be known of a run whatever its end.

use tandem_recorder::Summary;

/// Says it on standard error, a line each.
pub fn tell_warnings(summary: &Summary) {
    for warning in summary.warnings() {
        say!("warning: {warning}");
    }
}
