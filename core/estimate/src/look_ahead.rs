//! The look-ahead form: junction feeds, backward from where the machine must rest, then forward, then the four cases.

use std::collections::VecDeque;

use crate::element::{Element, Kind};
use crate::junction::{Junction, Rows, Rule};
use crate::model::{Case, Model, Sink, Spent, without_feed};

/// Blocks that are looked at together. Beyond, a window is planned to rest at its end, and half of it is kept.
const WINDOW: usize = 4096;

/// A block in the window, with the junction at its start.
#[derive(Clone, Debug)]
struct Slot {
    element: Element,
    start: Junction,
    rows: Rows,
    /// Square of what the block itself allows, mm²/s².
    own: f64,
    /// Square of the speed at the start, mm²/s².
    square: f64,
}

/// The model.
#[derive(Clone, Debug)]
pub struct LookAhead {
    rule: Rule,
    rapid_acceleration_mm_per_s2: Option<f64>,
    window: VecDeque<Slot>,
}

impl LookAhead {
    /// A model at rest. Rapids take the machine's acceleration where none is given.
    pub fn new(rule: Rule, rapid_acceleration_mm_per_s2: Option<f64>) -> Self {
        Self {
            rule,
            rapid_acceleration_mm_per_s2,
            window: VecDeque::new(),
        }
    }

    fn close(&mut self, end: &Junction) {
        let Some(last) = self.window.back_mut() else {
            return;
        };
        last.rows = self.rule.rows(&last.element, [&last.start, end]);
        last.own = last
            .element
            .feed_mm_per_s
            .powi(2)
            .min(last.rows.turning_cap());
    }

    /// Speeds of all that is in the window, to rest at its end; the speed at its start stays.
    fn plan(&mut self) {
        let window = self.window.make_contiguous();
        let mut next = 0.0;
        for index in (1..window.len()).rev() {
            let before = window[index - 1].own;
            let slot = &mut window[index];
            let cap = slot.start.feed_mm_per_s.powi(2).min(slot.own).min(before);
            slot.square = cap.min(slot.rows.reach(next, slot.element.length_mm));
            next = slot.square;
        }
        for index in 1..window.len() {
            let before = &window[index - 1];
            let reached = before.rows.reach(before.square, before.element.length_mm);
            window[index].square = window[index].square.min(reached);
        }
    }

    fn emit(&mut self, count: usize, out: &mut Sink<'_>) {
        self.plan();
        for _ in 0..count {
            let Some(slot) = self.window.pop_front() else {
                return;
            };
            let end = self.window.front().map_or(0.0, |next| next.square);
            out(&slot.element, &drive(&slot, end));
        }
    }
}

/// The time of a block between the squares of the speeds at its ends.
fn drive(slot: &Slot, end: f64) -> Spent {
    let (length_mm, start) = (slot.element.length_mm, slot.square);
    let top = slot
        .own
        .min(slot.rows.peak(f64::midpoint(start, end), length_mm))
        .max(start)
        .max(end);
    let a = slot.rows.acceleration_mm_per_s2(top);
    let [first, peak, last] = [start, top, end].map(f64::sqrt);
    let cruise_mm = if top > start.min(end) {
        length_mm - (2.0 * top - start - end) / (2.0 * a)
    } else {
        length_mm
    };
    let ramps_s = if top > start.min(end) {
        (2.0 * peak - first - last) / a
    } else {
        0.0
    };
    let case = if peak >= slot.element.feed_mm_per_s * (1.0 - 1e-9) {
        Case::ReachesFeed
    } else if top > start && top > end {
        Case::Peak
    } else if end > start {
        Case::SpeedsUp
    } else {
        Case::SlowsDown
    };
    Spent {
        time_s: ramps_s + cruise_mm.max(0.0) / peak,
        reached_mm_per_s: peak,
        case: Some(case),
    }
}

impl Model for LookAhead {
    fn block(&mut self, element: &Element, out: &mut Sink<'_>) {
        let rests = self
            .window
            .back()
            .is_some_and(|last| last.element.rests_before(element));
        if rests || element.starts_at_rest {
            self.finish(out);
        }
        if let Some(spent) = without_feed(element, self.rapid_acceleration_mm_per_s2) {
            return out(element, &spent);
        }
        if element.length_mm <= 0.0 {
            return out(element, &Spent::NOTHING);
        }
        debug_assert_eq!(element.kind, Kind::Cut);
        let start = self.window.back().map_or_else(Junction::default, |last| {
            self.rule.join(&last.element, element)
        });
        self.close(&start);
        self.window.push_back(Slot {
            element: *element,
            start,
            rows: Rows::default(),
            own: 0.0,
            square: 0.0,
        });
        if self.window.len() > WINDOW {
            // The last block's end is not known yet: it is planned as a rest, like the end of any buffer.
            self.close(&Junction::default());
            self.emit(WINDOW / 2, out);
        }
    }

    fn finish(&mut self, out: &mut Sink<'_>) {
        self.close(&Junction::default());
        self.emit(self.window.len(), out);
    }
}
