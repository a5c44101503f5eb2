//! The keys of axes and joints, which carry their unit in their name.

use crate::section::Section;

/// The names of an axis's keys, and what turns their values into internal units.
#[derive(Debug)]
pub struct Units {
    pub travel: &'static str,
    pub start: &'static str,
    pub home: &'static str,
    pub feed: &'static str,
    pub rapid: &'static str,
    pub acceleration: &'static str,
    pub jerk: &'static str,
    pub following: &'static str,
    pub unhomed: &'static str,
    pub skew: &'static str,
    /// From mm or degrees to mm or rad.
    pub scale: f64,
}

static LINEAR: Units = Units {
    travel: "travel_mm",
    start: "start_mm",
    home: "home_mm",
    feed: "max_feed_mm_per_min",
    rapid: "max_rapid_mm_per_min",
    acceleration: "max_acceleration_mm_per_s2",
    jerk: "max_jerk_mm_per_s3",
    following: "max_following_error_mm",
    unhomed: "unhomed_max_feed_mm_per_min",
    skew: "max_skew_mm",
    scale: 1.0,
};

static ROTARY: Units = Units {
    travel: "travel_deg",
    start: "start_deg",
    home: "home_deg",
    feed: "max_feed_deg_per_min",
    rapid: "max_rapid_deg_per_min",
    acceleration: "max_acceleration_deg_per_s2",
    jerk: "max_jerk_deg_per_s3",
    following: "max_following_error_deg",
    unhomed: "unhomed_max_feed_deg_per_min",
    skew: "max_skew_deg",
    scale: std::f64::consts::PI / 180.0,
};

impl Units {
    /// The keys of a linear or a rotary axis.
    pub fn of(rotary: bool) -> &'static Self {
        if rotary { &ROTARY } else { &LINEAR }
    }

    fn names(&self) -> [&'static str; 10] {
        [
            self.travel,
            self.start,
            self.home,
            self.feed,
            self.rapid,
            self.acceleration,
            self.jerk,
            self.following,
            self.unhomed,
            self.skew,
        ]
    }
}

/// Refuses the keys of the other kind of axis in the table of an axis or joint.
pub fn refuse_other_kind(section: &Section<'_>, rotary: bool) {
    let pairs = Units::of(!rotary)
        .names()
        .into_iter()
        .zip(Units::of(rotary).names());
    for (wrong, right) in pairs.filter(|(wrong, _)| section.has(wrong)) {
        let kind = if rotary {
            "rotary axis is in degrees"
        } else {
            "linear axis is in mm"
        };
        let unsure = !rotary && !section.has("kind") && !section.has("axis");
        let end = if unsure {
            ", or is `kind = \"rotary\"` missing?"
        } else {
            "?"
        };
        section.suggest(right);
        section.refuse(wrong, format!("a {kind}; did you mean `{right}`{end}"));
    }
}
