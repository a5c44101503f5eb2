//! What tests and benches of the driver share.

use tandem_sdk::{Attached, Feedback, Setpoint};

/// What a host begins with after a start: the joints are told to be where they stand.
pub fn begin(attached: &Attached) -> (Setpoint, Feedback) {
    let setpoint = Setpoint {
        position: attached.position,
        ..Setpoint::default()
    };
    let feedback = Feedback {
        position: attached.position,
        state: attached.state,
        ..Feedback::default()
    };
    (setpoint, feedback)
}
