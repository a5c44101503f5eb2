//! Choosing the rate of program time: what is asked for, and what the limits allow. In single-block operation that is a hold at the
//! end of every line of the program.

use crate::governor::tuning::{
    ABOVE_FEED_SHARE, AT_LINE_END_MM, BEGINNING_PERIODS, BRAKING_JERK_SHARE, BRAKING_PERIODS,
    LINE_END_JERK_SHARES, LINE_END_LOOK_PERIODS, LINE_END_MM, LONGER_MARGIN, MAX_LONGER,
    SETTLING_PERIODS, SLOWDOWN_PERIODS,
};
use tandem_rings::STOP_SHARE;

use super::pieces::{Bounds, Laid};
use super::ratio::{FEED_TOLERANCE, Ratios, within};
use crate::config::{FineConfig, GuardMode};
use crate::cursor::Cursor;
use crate::governor::{Aim, Goal, Governor, RestAt};
use crate::horizon::Horizon;
use crate::law::Along;
use crate::period_points::PeriodPoints;
use crate::plan_ahead::Axes;
use crate::slowdowns::{EndOfLine, LineEnd, Slowdowns};

/// Why the rate of program time is to go down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ask {
    Run,
    /// The operator, the program, a spindle that is not at speed, a fault of the soft side, or the end of a line in single block. It
    /// comes before [`Ask::Starve`]: what is queued is enough for the stop.
    Hold,
    /// For good: an edge has come, or the operator aborts.
    Stop,
    Starve,
}

/// What a fine period is asked for, and what the queue allows in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Request {
    pub(super) ask: Ask,
    pub(super) ratios: Ratios,
    /// The machine is to rest at the end of every line.
    pub(super) single_block: bool,
    /// The highest rate that the queue allows.
    pub(super) max_rate: f64,
    /// Path deceleration that every queued segment leaves, mm/s².
    pub(super) stop_deceleration_mm_per_s2: f64,
}

/// What was chosen for a fine period.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::struct_excessive_bools)] // independent facts of one period
pub(super) struct Governed {
    /// Program time that passes, s.
    pub(super) delta_s: f64,
    /// The least rate that ratios, places ahead and the queue have asked for.
    pub(super) least_asked: f64,
    /// Jerk goes beyond its limit: velocity and acceleration are kept.
    pub(super) is_jerk_relaxed: bool,
    /// The rate is below 1 because the queue is not deep enough for more.
    pub(super) is_queue_limited: bool,
    /// The rate is below 1 though nothing asked for that: the plan is beyond its limits.
    pub(super) is_unasked: bool,
    /// The end of a line is reached, or was passed: the machine is to rest here until the operator resumes.
    pub(super) holds: bool,
}

impl Governed {
    /// What a period that nothing has asked anything of yet has chosen.
    const NOTHING: Self = Self {
        delta_s: 0.0,
        least_asked: 1.0,
        is_jerk_relaxed: false,
        is_queue_limited: false,
        is_unasked: false,
        holds: false,
    };
}

/// The plan as it is followed: where the machine is in it, and how fast program time passes. Knows neither drives nor operator.
#[derive(Debug)]
pub(super) struct PlanFollower {
    pub(super) cursor: Cursor,
    pub(super) governor: Governor,
    pub(super) points: PeriodPoints,
    pub(super) horizon: Horizon,
    slowdowns: Slowdowns,
    pub(super) line_end: LineEnd,
    /// σ is below 1, or was, because something asked for it.
    recovering: bool,
    /// What the present period is asked for, and what has been chosen for it so far.
    pub(super) request: Request,
    pub(super) chosen: Governed,
    pub(super) period_s: f64,
    /// Order of the limits that the plan keeps.
    pub(super) order: u32,
    axes: Axes,
    /// The plan is made for this ratio of the programmed feeds.
    max_feed_ratio: f64,
    /// Samples beyond the limits are sent, not slowed down.
    sends_all: bool,
}

/// The rates that a period is asked for.
struct Asked {
    /// Rate at its end.
    at_end: f64,
    /// Mean rate.
    mean: f64,
    /// Path speed that counts for the mean, mm/s.
    allowed_mm_per_s: f64,
    rapid: bool,
}

/// Share of the path coordinate by which a difference of two of them is rounded.
const ROUNDED_SHARE: f64 = 2.0 * f64::EPSILON;

/// Share of the path coordinate that a period is to be long, so that its length is known to a millionth.
const MIN_SHARE: f64 = 1e6 * f64::EPSILON;

/// Rounds in which the rate of the first period from rest is sought: 1/2 of what is wrong is left by each.
const REST_ROUNDS: u32 = 8;

/// Halvings in which it is sought where these do not settle.
const REST_HALVINGS: u32 = 24;

impl PlanFollower {
    /// At rest at the start of an empty queue. Host; allocates.
    pub(super) fn new(config: &FineConfig, cursor: Cursor) -> Self {
        let (limits, axes) = (&config.limits.axes, config.lane_count());
        Self {
            cursor,
            governor: Governor::new(limits, axes, config.period_s),
            points: if config.order >= 3 {
                PeriodPoints::new(limits, axes).without_points()
            } else {
                PeriodPoints::new(limits, axes)
            },
            horizon: Horizon::new(limits, axes, config.period_s),
            slowdowns: Slowdowns::new(),
            line_end: LineEnd::default(),
            recovering: false,
            request: Request {
                ask: Ask::Hold,
                ratios: Ratios {
                    feed: 1.0,
                    mean_feed: 1.0,
                    rapid: 1.0,
                },
                single_block: false,
                max_rate: 1.0,
                stop_deceleration_mm_per_s2: f64::INFINITY,
            },
            chosen: Governed::NOTHING,
            period_s: config.period_s,
            order: config.order,
            axes: Axes {
                count: axes,
                linear: config.linear,
                rotary: !config.linear & ((1 << config.axis_count()) - 1),
            },
            max_feed_ratio: config.max_feed_ratio,
            // Under `count` everything is sent: forms that break limits on purpose are not slowed.
            sends_all: config.guard == GuardMode::Count,
        }
    }

    /// Program time passes at its own rate again, as nothing moves. Host; allocates.
    pub(super) fn forget_rate(&mut self, config: &FineConfig) {
        self.governor = Governor::new(&config.limits.axes, self.axes.count, self.period_s);
    }

    /// Forgets what lies ahead in the queue: it counts no more.
    pub(super) fn forget_ahead(&mut self) {
        self.slowdowns.clear();
        self.line_end.forget();
    }

    /// Chooses the rate for this period.
    #[inline]
    pub(super) fn govern(&mut self, request: Request) -> &Governed {
        self.request = request;
        self.chosen = Governed::NOTHING;
        self.chosen.delta_s = self.choose();
        &self.chosen
    }

    /// Chooses the rate; gives the program time that passes, s.
    fn choose(&mut self) -> f64 {
        let Request {
            ask, mut ratios, ..
        } = self.request;
        // While slowing down no more program time passes than at the present rate: what lies beyond does not count.
        let most = if ask == Ask::Run || self.order >= 3 {
            1.0
        } else {
            self.governor.sigma()
        };
        self.points.fill(&self.cursor.ahead(), most * self.period_s);
        self.ask_for_rate((ratios.feed / self.max_feed_ratio).min(ratios.rapid));
        let below = ratios.feed < self.max_feed_ratio;
        if self.order >= 3 {
            if self.runs_as_planned(ask, below, &ratios) {
                self.governor.forget_way();
                self.recovering = false;
                return self.covered(self.period_s);
            }
            self.horizon.fill(&self.cursor.ahead(), self.period_s);
            if ask == Ask::Starve {
                self.horizon.hurry();
            }
        } else if ask == Ask::Run && below {
            let longer = self.longer();
            ratios.feed /= longer;
            ratios.mean_feed /= longer;
        }
        let line_end = if ask == Ask::Run {
            self.line_end()
        } else {
            None
        };
        let way_speed = if ask == Ask::Run {
            self.speed_for_places(&ratios, line_end)
        } else {
            0.0
        };
        let delta_s = if self.order >= 3 {
            self.govern_smooth(ask, &ratios, way_speed, line_end)
        } else {
            self.govern_steep(ask, &ratios, way_speed)
        };
        let limited = self.request.max_rate < 1.0;
        let asked = ask != Ask::Run || below || ratios.rapid < 1.0 || line_end.is_some() || limited;
        let sigma = self.governor.sigma();
        self.chosen.is_queue_limited = limited && ask == Ask::Run && sigma < 1.0;
        self.recovering = asked || (self.recovering && sigma < 1.0);
        self.chosen.is_unasked = sigma < 1.0 && !self.recovering;
        self.stop_at_line_end(line_end);
        self.covered(delta_s)
    }

    /// How much longer the way of the linear axes is in a period like this one than that of the path coordinate, which is a
    /// polynomial of its own; at least 1.
    fn longer(&mut self) -> f64 {
        let delta_s = self.governor.sigma() * self.period_s;
        let ahead = self.cursor.ahead();
        let place = ahead.place(self.axes);
        let mut soon = place;
        soon.go(delta_s);
        let (Some(from), Some(to)) = (place.pace(), soon.pace()) else {
            return 1.0;
        };
        let way_mm = to.path_mm - from.path_mm;
        // Of next to nothing the rounding is a large share.
        (way_mm > MIN_SHARE * from.path_mm)
            .then(|| from.way_to_mm(&to) / way_mm)
            .filter(|longer| *longer < MAX_LONGER)
            .map_or(1.0, |longer| 1.0 + (1.0 + LONGER_MARGIN) * (longer - 1.0))
    }

    /// Whether program time passes at its own rate and nothing asks for another: then nothing needs to be foreseen.
    fn runs_as_planned(&self, ask: Ask, below: bool, ratios: &Ratios) -> bool {
        let constant = self.governor.sigma() == 1.0 && self.governor.rate_per_s() == 0.0;
        let unasked =
            ask == Ask::Run && !below && ratios.rapid >= 1.0 && !self.request.single_block;
        constant && unasked && self.request.max_rate == 1.0 && self.plan_limit() == 1.0
    }

    /// As much of `delta_s` as lies within what was looked at. Behind what is queued nothing is known: there the machine stands, and
    /// from there it gets on as from rest, not at the rate with which it came in. Where the plan itself is at rest any rate is as good.
    fn covered(&mut self, delta_s: f64) -> f64 {
        let covered_s = self.points.covered_s;
        if self.cursor.is_resting() || delta_s <= covered_s {
            return delta_s;
        }
        let ahead = self.cursor.ahead();
        let mut wall = ahead.place(self.axes);
        let mut beyond = wall;
        wall.go(covered_s);
        beyond.go(delta_s);
        let moves = wall.pace().is_none_or(|pace| pace.speed > 0.0);
        if moves && !beyond.is_known() {
            self.governor.jump(0.0);
            self.recovering = true;
        }
        covered_s
    }

    /// The highest rate at which the plan keeps velocity and acceleration. Jerk beyond the limit at single points need not be
    /// in the samples; where it is, the guard sees it.
    fn plan_limit(&self) -> f64 {
        if self.sends_all {
            1.0
        } else {
            Governor::plan_limit(&self.points)
        }
    }

    /// Limits of velocity and acceleration: σ is linear in the period.
    fn govern_steep(&mut self, ask: Ask, ratios: &Ratios, way_speed_mm_per_s: f64) -> f64 {
        let limit = self.plan_limit().min(self.request.max_rate);
        self.ask_for_rate(limit);
        self.look_at_feeds(ratios);
        let wanted = if ask == Ask::Run {
            self.ratio_target(ratios, way_speed_mm_per_s)
        } else {
            0.0
        };
        let target = wanted.min(limit);
        let unchanged = target == self.governor.sigma();
        let sigma = if unchanged {
            target
        } else {
            self.governor.choose(target, &self.points)
        };
        // Where the limits stand against the feed, or the plan changes too much in the period, it is looked at more closely.
        if self.cursor.is_resting() || self.is_feed_kept(sigma, ratios) {
            return self.governor.take(sigma);
        }
        if self.governor.sigma() > 0.0 {
            // One rate of change of σ for the whole period cannot do it: each segment gets its own.
            let bounds = Bounds {
                ratios,
                way_speed_mm_per_s,
                limit,
            };
            let (ahead, points) = (self.cursor.ahead(), &mut self.points);
            let laid = Laid::out(&ahead, &self.governor, points, self.period_s, &bounds);
            self.governor.take(laid.sigma);
            return laid.passed_s;
        }
        let kept = self.kept_from_standstill(sigma, ratios);
        let sigma = self.governor.choose(kept, &self.points);
        self.governor.take(sigma)
    }

    /// A rate below `too_high` with which a period that begins with none keeps the feed, as high as halving finds it: where it goes over
    /// the end of a block, what is too fast behind that is not in proportion to the rate.
    fn kept_from_standstill(&mut self, too_high: f64, ratios: &Ratios) -> f64 {
        self.kept_by_halving(too_high, |follower, sigma| {
            follower.is_feed_kept(sigma, ratios)
        })
    }

    /// Notes from which rates ratio × programmed feed can be kept ahead.
    fn look_at_feeds(&mut self, ratios: &Ratios) {
        self.governor.look_no_more();
        if ratios.feed < self.max_feed_ratio {
            let ahead = self.cursor.ahead();
            self.governor
                .look_ahead(ahead.place(self.axes), ratios.feed);
        }
    }

    /// Whether a period that ends at the rate `sigma` keeps ratio × programmed feed, at its end and in its mean.
    fn is_feed_kept(&mut self, sigma: f64, ratios: &Ratios) -> bool {
        if self.asks_for_nothing(ratios) {
            return true;
        }
        let mean = f64::midpoint(self.governor.sigma(), sigma);
        let asked =
            self.asked_of_period(self.governor.program_time_s(sigma), ratios, f64::INFINITY);
        sigma <= asked.at_end * (1.0 + FEED_TOLERANCE)
            && mean <= asked.mean * (1.0 + FEED_TOLERANCE)
    }

    /// Limits of jerk too: σ̈ is constant in the period.
    fn govern_smooth(
        &mut self,
        ask: Ask,
        ratios: &Ratios,
        way_speed_mm_per_s: f64,
        line_end: Option<EndOfLine>,
    ) -> f64 {
        if ask == Ask::Run && self.cursor.is_resting() {
            self.begin_below(ratios);
        }
        let path = self.cursor.path_derivatives();
        let ahead = self
            .cursor
            .ahead()
            .planned_after(self.governor.sigma() * self.period_s);
        let limit = self.plan_limit().min(self.request.max_rate);
        self.ask_for_rate(limit);
        let run = if ahead.rapid {
            ratios.rapid.min(limit)
        } else {
            limit
        };
        let ratio = if ratios.feed < self.max_feed_ratio {
            ratios.feed
        } else {
            f64::INFINITY
        };
        let feed = if ahead.rapid || ratio.is_infinite() {
            f64::INFINITY
        } else {
            // What was driven before a rest counts no more.
            let here = if self.cursor.is_resting() {
                f64::INFINITY
            } else {
                self.cursor.segment().feed_mm_per_s
            };
            ratio * ahead.feed_mm_per_s.min(here)
        };
        let goal = match ask {
            Ask::Run => {
                let rest_at = line_end.map(|end| self.rest_at(&end));
                Goal::run(run, feed.min(way_speed_mm_per_s), rest_at)
            }
            // Where the plan stands still, its path says nothing.
            _ => Goal::Rest {
                sigma: if path[0] > 0.0 { run } else { 0.0 },
            },
        };
        let aim = Aim {
            goal,
            ratio,
            kept_rate: ratio / self.max_feed_ratio,
            path,
        };
        let recent = self.cursor.recent_steps();
        let ahead = self.cursor.ahead();
        let place = ahead.place(self.axes);
        let chosen = self.governor.smooth(&aim, &self.horizon, place, recent);
        self.chosen.is_jerk_relaxed = chosen.relaxed;
        chosen.delta_s
    }

    /// From rest, where any rate is as good to begin with: one at which the path speed stays below ratio × programmed feed for
    /// some periods. What the plan gains in fewer than these the rate could not follow.
    fn begin_below(&mut self, ratios: &Ratios) {
        let mut sigma = self.governor.sigma();
        for _ in 0..REST_ROUNDS {
            let allowed = self.rate_below(sigma * self.period_s, ratios);
            if sigma <= allowed {
                break;
            }
            sigma = allowed.max((sigma * allowed).sqrt() * (1.0 - 1e-9));
        }
        let allowed = self.rate_below(sigma * self.period_s, ratios);
        if sigma > allowed * (1.0 + FEED_TOLERANCE) {
            // Where the period goes on to the next rest, a lower rate hardly lowers what is driven in it.
            sigma = self.kept_by_halving(sigma, |follower, sigma| {
                sigma <= follower.rate_below(sigma * follower.period_s, ratios)
            });
        }
        self.governor.jump(sigma.min(allowed));
    }

    /// The rate that keeps ratio × programmed feed in the coming periods, where `delta_s` of program time passes in each.
    fn rate_below(&mut self, delta_s: f64, ratios: &Ratios) -> f64 {
        let (mut rate, mut from_mm) = (f64::INFINITY, self.cursor.path_mm());
        for period in 1..=BEGINNING_PERIODS {
            let ahead = self
                .cursor
                .ahead()
                .planned_after(f64::from(period) * delta_s);
            let fastest = ahead
                .speed_mm_per_s
                .max((ahead.path_mm - from_mm) / delta_s);
            from_mm = ahead.path_mm;
            if !ahead.rapid && ratios.feed < self.max_feed_ratio {
                rate = rate.min(ratios.feed * ahead.feed_mm_per_s / fastest);
            }
        }
        rate
    }

    /// The rate at which the path speed is at most ratio × programmed feed at the end of the period, and no more than
    /// `way_speed_mm_per_s`.
    fn ratio_target(&mut self, ratios: &Ratios, way_speed_mm_per_s: f64) -> f64 {
        if self.cursor.is_resting() {
            return self.ratio_from_rest(ratios, way_speed_mm_per_s);
        }
        if way_speed_mm_per_s == f64::INFINITY && self.asks_for_nothing(ratios) {
            return 1.0;
        }
        let from = self.governor.sigma();
        let speed_mm_per_s = from * self.cursor.path_speed_mm_per_s();
        let mut sigma = from;
        // The plan at the end of the period depends on the rate sought: three rounds settle it.
        for _ in 0..3 {
            let asked = self.asked_of_period(
                self.governor.program_time_s(sigma),
                ratios,
                way_speed_mm_per_s,
            );
            let steady = asked.at_end.min(asked.mean);
            // From above, an end that makes the mean right lies as far below: the next period would begin in a dip.
            let above = speed_mm_per_s > (1.0 + ABOVE_FEED_SHARE) * asked.allowed_mm_per_s;
            let next = if above {
                steady
            } else {
                asked.at_end.min(2.0 * asked.mean - from)
            }
            .clamp(0.0, 1.0);
            if next == sigma {
                break;
            }
            sigma = next;
        }
        sigma
    }

    /// Whether neither a feed nor a rapid is to be slower than planned: then the plan itself keeps both at any rate.
    fn asks_for_nothing(&self, ratios: &Ratios) -> bool {
        ratios.feed >= self.max_feed_ratio && ratios.rapid >= 1.0
    }

    /// The same from rest, where any rate is as good to begin with: one that is kept over the period.
    fn ratio_from_rest(&mut self, ratios: &Ratios, way_speed_mm_per_s: f64) -> f64 {
        let mut sigma: f64 = 1.0;
        // The faster the plan is left, the lower the rate it leaves: their geometric mean is the answer where speed grows
        // with time, and halves what is wrong with it in each round where it grows with the square of time.
        for round in 0..2 * REST_ROUNDS {
            let asked = self.asked_of_period(sigma * self.period_s, ratios, way_speed_mm_per_s);
            let next = asked.at_end.min(asked.mean);
            if next == sigma {
                break;
            }
            if round + 1 == 2 * REST_ROUNDS {
                // Where the period goes on to the next rest, a lower rate hardly lowers what is driven in it, and this hardly settles.
                if sigma > next * (1.0 + FEED_TOLERANCE) {
                    sigma = self.kept_from_rest(sigma, ratios, way_speed_mm_per_s);
                }
                break;
            }
            // Where the period goes on over a corner neither is so, and what is found last must not be too fast.
            let settles = !asked.rapid && round < REST_ROUNDS;
            sigma = if settles {
                (sigma * next).sqrt()
            } else {
                sigma.min(next)
            };
        }
        self.governor.jump(sigma);
        sigma
    }

    /// A rate from rest below `too_high` that is kept over the period, as high as halving finds it; that one where none is.
    fn kept_from_rest(&mut self, too_high: f64, ratios: &Ratios, way_speed_mm_per_s: f64) -> f64 {
        self.kept_by_halving(too_high, |follower, sigma| {
            let delta_s = sigma * follower.period_s;
            let asked = follower.asked_of_period(delta_s, ratios, way_speed_mm_per_s);
            sigma <= asked.at_end.min(asked.mean)
        })
    }

    /// The highest rate below `too_high` that `is_kept`, as high as halving finds it; `too_high` where none is.
    fn kept_by_halving(&mut self, too_high: f64, is_kept: impl Fn(&mut Self, f64) -> bool) -> f64 {
        let (mut kept, mut high) = (0.0, too_high);
        for _ in 0..REST_HALVINGS {
            let sigma = f64::midpoint(kept, high);
            if is_kept(self, sigma) {
                kept = sigma;
            } else {
                high = sigma;
            }
        }
        if kept > 0.0 { kept } else { too_high }
    }

    /// What is asked of a period in which `delta_s` of program time passes.
    fn asked_of_period(&mut self, delta_s: f64, ratios: &Ratios, way_speed_mm_per_s: f64) -> Asked {
        let from_mm = self.cursor.path_mm();
        let ahead = self.cursor.ahead().planned_after(delta_s);
        let keeps = ratios.feed >= self.max_feed_ratio;
        let allowed_mm_per_s = if keeps {
            f64::INFINITY
        } else {
            ratios.mean_feed * ahead.max_feed_mm_per_s
        };
        let of_places = within(way_speed_mm_per_s, ahead.speed_mm_per_s)
            .min(self.governor.rate_in_time(delta_s));
        if ahead.rapid {
            let at_end = ratios.rapid.min(of_places);
            return Asked {
                at_end,
                mean: f64::INFINITY,
                allowed_mm_per_s,
                rapid: true,
            };
        }
        if keeps {
            // The plan itself does.
            return Asked {
                at_end: of_places,
                mean: f64::INFINITY,
                allowed_mm_per_s,
                rapid: false,
            };
        }
        let way_mm = ahead.path_mm - from_mm - ROUNDED_SHARE * ahead.path_mm;
        let mean_mm_per_s = if delta_s > 0.0 {
            way_mm / delta_s
        } else {
            ahead.speed_mm_per_s
        };
        Asked {
            at_end: within(ratios.feed * ahead.feed_mm_per_s, ahead.speed_mm_per_s).min(of_places),
            mean: within(allowed_mm_per_s, mean_mm_per_s),
            allowed_mm_per_s,
            rapid: false,
        }
    }

    /// The speed at the end of this period from which every lower feed ahead, and the end of the line, can be met, mm/s.
    fn speed_for_places(&mut self, ratios: &Ratios, line_end: Option<EndOfLine>) -> f64 {
        let at_end = line_end.map_or(f64::INFINITY, |end| self.speed_to_rest(&end));
        if line_end.is_some() {
            self.ask_for_rate(0.0);
        }
        if ratios.feed >= self.max_feed_ratio {
            return at_end;
        }
        let along = self.along();
        let stop_s = along.speed_mm_per_s / along.max_mm_per_s2
            + self.horizon.reach_s
            + SLOWDOWN_PERIODS * self.period_s;
        let until_s = self.cursor.program_time_s() + stop_s;
        self.slowdowns.extend(&mut self.cursor, until_s);
        let segment = self.cursor.segment();
        let here_mm_per_s2 = segment.stop_deceleration_mm_per_s2;
        let to_meet = self
            .slowdowns
            .to_meet(self.cursor.path_mm(), here_mm_per_s2);
        let mut speed_mm_per_s = at_end;
        let mut least_met_mm_per_s = f64::INFINITY;
        for (mark, leaves_mm_per_s2) in to_meet {
            let met_mm_per_s = mark.speed_to_meet_mm_per_s(ratios.feed, self.period_s);
            let braking = braking_with(&along, leaves_mm_per_s2);
            speed_mm_per_s =
                speed_mm_per_s.min(self.speed_towards(&braking, mark.path_mm, met_mm_per_s));
            least_met_mm_per_s = least_met_mm_per_s.min(met_mm_per_s);
        }
        let planned_mm_per_s = self.cursor.path_speed_mm_per_s();
        if least_met_mm_per_s < planned_mm_per_s {
            self.ask_for_rate(least_met_mm_per_s / planned_mm_per_s);
        }
        speed_mm_per_s
    }

    /// The speed at the end of this period from which `end_mm_per_s` can be met at `place_mm` where the state along the path is `along`,
    /// mm/s.
    ///
    /// With limits of order 2 the speeds at the ends of the periods to come are laid out ([`Along::speed_towards`]). With a
    /// jerk limit it is decided period by period whether braking may still wait.
    pub(super) fn speed_towards(&self, along: &Along, place_mm: f64, end_mm_per_s: f64) -> f64 {
        let period_s = self.period_s;
        let left_mm = place_mm - self.cursor.path_mm();
        if self.order < 3 {
            return along.speed_towards(left_mm, end_mm_per_s, period_s);
        }
        let soon_mm = BRAKING_PERIODS
            * period_s
            * (along.speed_mm_per_s + period_s * along.acceleration_mm_per_s2.max(0.0))
            + SETTLING_PERIODS * period_s * end_mm_per_s;
        let later = Along {
            speed_mm_per_s: along.speed_mm_per_s.max(end_mm_per_s),
            ..*along
        };
        let waits = later.way_to_mm(end_mm_per_s) + soon_mm < left_mm;
        if waits { f64::INFINITY } else { end_mm_per_s }
    }

    /// In single-block operation: where to come to rest, as a path coordinate, mm.
    fn line_end(&mut self) -> Option<EndOfLine> {
        if !self.request.single_block {
            self.line_end.forget();
            return None;
        }
        if self.cursor.is_resting() {
            return None;
        }
        if self.line_end.is_passed(&self.cursor) {
            // The next corner may need jerk that braking counted on; the machine then stops slightly past the end of the line.
            self.chosen.holds = true;
            self.line_end.forget();
            return None;
        }
        let along = self.along();
        let soon_mm = LINE_END_LOOK_PERIODS * self.period_s * along.speed_mm_per_s;
        let jerk_mm_per_s3 = self.line_end_jerk_mm_per_s3();
        let is_smooth = self.order >= 3;
        let way_mm = |leaves_mm_per_s2: f64| {
            let stop = Along {
                jerk_mm_per_s3,
                ..braking_with(&along, leaves_mm_per_s2)
            };
            soon_mm
                + if is_smooth {
                    stop.way_to_mm(0.0)
                } else {
                    stop.speed_mm_per_s * stop.speed_mm_per_s / (2.0 * stop.max_mm_per_s2)
                }
        };
        self.line_end.look(&mut self.cursor, way_mm)
    }

    /// The speed at the end of this period from which rest can be met at the end of the line, mm/s; with a jerk limit σ̈ is sought
    /// for it instead, until the end is next to reached.
    fn speed_to_rest(&self, end: &EndOfLine) -> f64 {
        if self.order < 3 {
            let along = braking_with(&self.along(), end.stop_deceleration_mm_per_s2);
            return self.speed_towards(&along, end.path_mm, 0.0);
        }
        if end.path_mm - self.cursor.path_mm() > AT_LINE_END_MM {
            f64::INFINITY
        } else {
            0.0
        }
    }

    /// Rest at the end of a line with what braking there may count on. Jerk is limited.
    fn rest_at(&self, end: &EndOfLine) -> RestAt {
        RestAt {
            path_mm: end.path_mm,
            max_mm_per_s2: STOP_SHARE * end.stop_deceleration_mm_per_s2,
            jerk_mm_per_s3: self.line_end_jerk_mm_per_s3(),
        }
    }

    /// The path jerk that braking for the end of a line may count on, mm/s³.
    fn line_end_jerk_mm_per_s3(&self) -> f64 {
        LINE_END_JERK_SHARES[usize::from(self.horizon.is_steady())]
            * self.horizon.path_jerk_mm_per_s3
    }

    /// The end of the line is reached: a feed hold stands until the operator resumes.
    fn stop_at_line_end(&mut self, line_end: Option<EndOfLine>) {
        let Some(end) = line_end else { return };
        if self.governor.sigma() == 0.0 && end.path_mm - self.cursor.path_mm() < LINE_END_MM {
            self.chosen.holds = true;
            self.line_end.forget();
        }
    }

    /// A rate of this much is asked for in this period, by ratios, places ahead or the queue.
    fn ask_for_rate(&mut self, rate: f64) {
        self.chosen.least_asked = self.chosen.least_asked.min(rate);
    }

    /// The state along the path, with what every queued segment leaves to brake with.
    pub(super) fn along(&self) -> Along {
        let [speed, acceleration, _] = self.cursor.path_derivatives();
        let sigma = self.governor.sigma();
        Along {
            speed_mm_per_s: sigma * speed,
            acceleration_mm_per_s2: sigma * sigma * acceleration
                + speed * self.governor.rate_per_s(),
            max_mm_per_s2: STOP_SHARE * self.request.stop_deceleration_mm_per_s2,
            jerk_mm_per_s3: BRAKING_JERK_SHARE * self.horizon.path_jerk_mm_per_s3,
        }
    }
}

/// The same state where the plan leaves this path deceleration to brake with, mm/s².
fn braking_with(along: &Along, leaves_mm_per_s2: f64) -> Along {
    Along {
        max_mm_per_s2: STOP_SHARE * leaves_mm_per_s2,
        ..*along
    }
}

#[cfg(test)]
#[path = "govern_tests.rs"]
mod tests;
