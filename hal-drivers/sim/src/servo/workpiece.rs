//! Where material is, and how deep it is cut.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

/// Most sections of a random workpiece.
const MAX_SECTIONS: usize = 10_000;

/// A workpiece: the depth of cut over a length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Workpiece {
    /// What the length is.
    #[serde(default)]
    pub over: Over,
    /// Where the length is zero, in joints 0 and 1, mm; for `over = "xy"`.
    #[serde(default)]
    pub origin_mm: [f64; 2],
    /// Direction in which the length rises, degrees from joint 0 to joint 1; for `over = "xy"`.
    #[serde(default)]
    pub direction_deg: f64,
    /// Nothing is cut, and no path counts, while joint 2 stands above this, mm.
    pub top_mm: Option<f64>,
    /// Steps of the depth: pairs of length and depth from there on, mm.
    pub steps: Option<Vec<[f64; 2]>>,
    /// Slopes of the depth: pairs of length and depth, mm, straight between them and nothing outside.
    pub slopes: Option<Vec<[f64; 2]>>,
    /// Steps from the seed of the driver.
    pub random: Option<Random>,
    /// Radius of the cutter, mm: it runs into each step over this length. 0 is a sharp jump, which no round tool meets.
    #[serde(default)]
    pub entry_radius_mm: f64,
}

/// What a length is measured along.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Over {
    /// The path driven by joints 0 to 2 since the spindle turns in the workpiece.
    #[default]
    Path,
    /// The place in the plane of joints 0 and 1.
    Xy,
}

/// A workpiece of random steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Random {
    /// Length of air before the first step, mm.
    #[serde(default)]
    pub start_mm: f64,
    /// Number of steps.
    pub sections: usize,
    /// Shortest and longest step, mm.
    pub section_mm: [f64; 2],
    /// Smallest and greatest depth, mm.
    pub depth_mm: [f64; 2],
}

/// The depth over the length, ready to be asked.
#[derive(Clone, Debug, PartialEq)]
pub enum Profile {
    /// Walls in rising order, each `[length, depth]`, and the cutter's radius, mm.
    Steps(Vec<[f64; 2]>, f64),
    /// Corners in rising order, each `[length, depth]`, mm.
    Slopes(Vec<[f64; 2]>),
}

impl Workpiece {
    /// The profile; a random one has no steps yet. Why there is none.
    pub(crate) fn profile(&self) -> Result<Profile, String> {
        match (&self.steps, &self.slopes, &self.random) {
            (Some(steps), None, None) => {
                rising("steps", steps).map(|s| Profile::Steps(s, self.entry_radius_mm))
            }
            (None, Some(slopes), None) => rising("slopes", slopes).map(Profile::Slopes),
            (None, None, Some(random)) => random
                .check()
                .map(|()| Profile::Steps(vec![], self.entry_radius_mm)),
            _ => Err("a workpiece has steps, slopes or random".to_string()),
        }
    }

    /// The profile of checked options, its random steps drawn from `seed`.
    pub fn drawn(&self, seed: u64) -> Profile {
        match (&self.random, self.profile()) {
            (Some(random), _) => Profile::Steps(random.walls(seed), self.entry_radius_mm),
            (None, profile) => profile.unwrap_or(Profile::Slopes(vec![])),
        }
    }
}

fn rising(key: &str, pairs: &[[f64; 2]]) -> Result<Vec<[f64; 2]>, String> {
    if pairs
        .iter()
        .any(|[length, depth]| !length.is_finite() || !depth.is_finite() || *depth < 0.0)
    {
        return Err(format!(
            "{key}: a pair is a length and a depth from 0 up, mm"
        ));
    }
    match pairs.windows(2).find(|two| two[1][0] < two[0][0]) {
        Some(two) => Err(format!(
            "{key}: {} mm comes after {} mm",
            two[1][0], two[0][0]
        )),
        None => Ok(pairs.to_vec()),
    }
}

impl Random {
    fn check(&self) -> Result<(), String> {
        let ordered =
            |[low, high]: [f64; 2], least: f64| low >= least && high >= low && high <= 1e6;
        if !(1..=MAX_SECTIONS).contains(&self.sections) {
            return Err(format!(
                "random: sections = {}: must be 1 to {MAX_SECTIONS}",
                self.sections
            ));
        }
        if !ordered(self.section_mm, 1e-3)
            || !ordered(self.depth_mm, 0.0)
            || !(0.0..=1e6).contains(&self.start_mm)
        {
            return Err(
                "random: section_mm and depth_mm are the least and the most, start_mm a length"
                    .to_string(),
            );
        }
        Ok(())
    }

    fn walls(&self, seed: u64) -> Vec<[f64; 2]> {
        let mut random = tandem_random::Random::new(seed);
        let mut between = |[low, high]: [f64; 2]| random.between(low, high);
        let mut at = self.start_mm;
        let mut walls = Vec::with_capacity(self.sections + 1);
        for _ in 0..self.sections {
            walls.push([at, between(self.depth_mm)]);
            at += between(self.section_mm);
        }
        walls.push([at, 0.0]);
        walls
    }
}

impl Profile {
    /// Depth at `length_mm`, mm. Does not allocate.
    pub fn depth_mm(&self, length_mm: f64) -> f64 {
        match self {
            Self::Steps(walls, radius_mm) => stepped(walls, *radius_mm, length_mm),
            Self::Slopes(corners) => sloped(corners, length_mm),
        }
    }
}

fn stepped(walls: &[[f64; 2]], radius_mm: f64, length_mm: f64) -> f64 {
    let behind = walls.partition_point(|[wall, _]| *wall <= length_mm);
    let level = |index: usize| if index == 0 { 0.0 } else { walls[index - 1][1] };
    let ahead = walls[behind..]
        .iter()
        .enumerate()
        .take_while(|(_, [wall, _])| wall - length_mm <= radius_mm);
    let entering = |(index, [wall, depth]): (usize, &[f64; 2])| {
        // The share of the cutter's width that is in the wall ahead.
        let angle = ((wall - length_mm) / radius_mm).acos();
        (depth - level(behind + index)) * (2.0 * angle + (2.0 * angle).sin()) / PI
    };
    level(behind) + ahead.map(entering).sum::<f64>()
}

fn sloped(corners: &[[f64; 2]], length_mm: f64) -> f64 {
    let next = corners.partition_point(|[corner, _]| *corner <= length_mm);
    let last = corners
        .last()
        .filter(|last| last[0] == length_mm)
        .map_or(0.0, |last| last[1]);
    let (Some(to), Some(from)) = (
        corners.get(next),
        next.checked_sub(1).map(|before| corners[before]),
    ) else {
        return last;
    };
    from[1] + (to[1] - from[1]) * (length_mm - from[0]) / (to[0] - from[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cutter_runs_into_a_step_over_its_radius() {
        let walls = Profile::Steps(vec![[8.0, 2.0], [18.0, 3.0], [48.0, 0.0]], 5.0);
        for (length, depth) in [
            (2.9, 0.0),
            (3.0, 0.0),
            (8.0, 2.0),
            (10.0, 2.0),
            (18.0, 3.0),
            (48.0, 0.0),
            (90.0, 0.0),
        ] {
            assert!((walls.depth_mm(length) - depth).abs() < 1e-12, "{length}");
        }
        let half = walls.depth_mm(5.5);
        assert!(
            (half - 2.0 * (2.0 * PI / 3.0 + (2.0 * PI / 3.0).sin()) / PI).abs() < 1e-12,
            "{half}"
        );
        let sharp = Profile::Steps(vec![[8.0, 7.0]], 0.0);
        assert_eq!((sharp.depth_mm(7.999_999), sharp.depth_mm(8.0)), (0.0, 7.0));
    }

    #[test]
    fn slopes_are_straight_and_end() {
        let roof = Profile::Slopes(vec![[3.0, 1.5], [23.0, 4.5], [43.0, 1.5]]);
        for (length, depth) in [
            (2.9, 0.0),
            (3.0, 1.5),
            (13.0, 3.0),
            (23.0, 4.5),
            (42.0, 1.65),
            (43.0, 1.5),
            (43.1, 0.0),
        ] {
            assert!((roof.depth_mm(length) - depth).abs() < 1e-12, "{length}");
        }
    }

    #[test]
    fn random_steps_repeat_and_stay_in_their_bounds() {
        let random = Random {
            start_mm: 4.0,
            sections: 50,
            section_mm: [1.0, 6.0],
            depth_mm: [0.5, 4.5],
        };
        let walls = random.walls(7);
        assert_eq!((walls.len(), walls[0][0], walls[50][1]), (51, 4.0, 0.0));
        assert!(
            walls
                .windows(2)
                .all(|two| (1.0..=6.0).contains(&(two[1][0] - two[0][0])))
        );
        assert!(
            walls[..50]
                .iter()
                .all(|wall| (0.5..=4.5).contains(&wall[1]))
        );
        assert!(random.walls(7) == walls && random.walls(8) != walls);
    }
}
