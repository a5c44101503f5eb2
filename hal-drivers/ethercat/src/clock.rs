//! The clock that leads the others, as frames tell it: where in a period of SYNC0 they pass it.

/// What a clock of 32 bits shows before it begins anew, ns.
const WRAP_BITS: u32 = 32;

/// The time of the clock that leads, over the ends of its bits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leading {
    /// What it was, and when that was by this computer, ns.
    time_ns: u64,
    seen_ns: u64,
}

impl Leading {
    /// What the clock shows at a time of this computer's; from here on it is followed.
    pub(crate) fn new(shown_ns: u64, now_ns: u64) -> Self {
        Self {
            time_ns: shown_ns,
            seen_ns: now_ns,
        }
    }

    /// Its time, by what it shows now. A clock of 32 bits begins anew every 4.3 s, which is no whole number of periods, and SYNC0 goes
    /// on: of all times that it may mean, it is the one nearest to what this computer expects, however long nothing was heard.
    pub(crate) fn time_ns(&mut self, shown_ns: u64, now_ns: u64) -> u64 {
        let expected_ns = self.time_ns + now_ns.saturating_sub(self.seen_ns);
        self.time_ns = if shown_ns >> WRAP_BITS > 0 {
            shown_ns
        } else {
            let off = (shown_ns as u32)
                .wrapping_sub(expected_ns as u32)
                .cast_signed();
            expected_ns.saturating_add_signed(i64::from(off))
        };
        self.seen_ns = now_ns;
        self.time_ns
    }
}

/// How much later than its phase an exchange passed the clock that leads, ns; within half a period either way.
pub(crate) fn phase(clock_ns: u64, period_ns: u64, phase_us: Option<f64>) -> i64 {
    let wanted_ns = phase_us.map_or(period_ns / 2, |phase| (phase * 1000.0) as u64);
    let late_ns =
        ((clock_ns % period_ns + period_ns - wanted_ns % period_ns) % period_ns).cast_signed();
    if late_ns > (period_ns / 2).cast_signed() {
        late_ns - period_ns.cast_signed()
    } else {
        late_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_phase_is_within_half_a_period() {
        assert_eq!(phase(7_000_300_000, 1_000_000, Some(300.0)), 0);
        assert_eq!(phase(7_000_310_000, 1_000_000, Some(300.0)), 10_000);
        assert_eq!(phase(7_000_290_000, 1_000_000, Some(300.0)), -10_000);
        assert_eq!(phase(7_000_900_000, 1_000_000, Some(300.0)), -400_000);
        assert_eq!(phase(7_000_500_000, 1_000_000, None), 0);
    }

    /// Whatever the width of the clock, how far the computer's is off, and for how long nothing was heard.
    #[test]
    fn a_clock_of_32_bits_goes_on_where_it_begins_anew() {
        for begins_ns in [0, 5, 0xffff_fff0, 0x8000_0000] {
            for ppm in [-100, 0, 100] {
                for step_ns in [250_000, 1_000_000, 7_000_000_000, 3_600_000_000_000] {
                    let mut leading = Leading::new(begins_ns, 77);
                    let mut wide = Leading::new(begins_ns, 77);
                    for n in 1..20_u64 {
                        let now_ns = 77 + n * step_ns;
                        let passed_ns = (n * step_ns).cast_signed();
                        let off_ns = passed_ns / 1_000_000 * ppm;
                        let time_ns = begins_ns.wrapping_add_signed(passed_ns + off_ns);
                        let shown_ns = time_ns & 0xffff_ffff;
                        assert_eq!(leading.time_ns(shown_ns, now_ns), time_ns);
                        assert_eq!(wide.time_ns(time_ns, now_ns), time_ns);
                    }
                }
            }
        }
    }
}
