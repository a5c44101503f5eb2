//! The four cases: one block between two feeds, with constant acceleration.
//!
//! After Heo, Kim and Kim, equations (10) and (12) to (15); the sign of (12) as direct integration gives it.

use crate::model::Case;

/// What the cases make of one block. Units are those of the arguments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Driven {
    /// Which case.
    pub case: Case,
    /// Time.
    pub time: f64,
    /// Highest feed.
    pub peak: f64,
    /// The feed at the end: what was asked, or as near to it as the length allows.
    pub end: f64,
}

/// Drives `length` with at most `feed` from `start` to `end` with the acceleration `a`, in any consistent units.
pub fn drive(length: f64, feed: f64, start: f64, end: f64, a: f64) -> Driven {
    let up = start * start + 2.0 * a * length;
    let down = start * start - 2.0 * a * length;
    if end * end > up {
        let peak = up.sqrt();
        return Driven {
            case: Case::SpeedsUp,
            time: (peak - start) / a,
            peak,
            end: peak,
        };
    }
    if end * end < down {
        let last = down.sqrt();
        return Driven {
            case: Case::SlowsDown,
            time: (start - last) / a,
            peak: start,
            end: last,
        };
    }
    let highest = a * length + f64::midpoint(start * start, end * end);
    if highest >= feed * feed {
        let ramps = (2.0 * feed * feed - start * start - end * end) / (2.0 * a);
        let time = (2.0 * feed - start - end) / a + (length - ramps) / feed;
        return Driven {
            case: Case::ReachesFeed,
            time,
            peak: feed,
            end,
        };
    }
    let peak = highest.sqrt();
    Driven {
        case: Case::Peak,
        time: (2.0 * peak - start - end) / a,
        peak,
        end,
    }
}
