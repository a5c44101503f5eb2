//! Where the tool is: standing, in air, entering, cutting.

/// Rough periods in a row of low torque after which the tool is in air.
const AIR_AFTER: u32 = 8;

/// Where the tool is, as far as the torque says it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tool {
    /// Nothing moves; what comes next may be material.
    #[default]
    Standing,
    /// It moves, and nothing is cut yet.
    Entering,
    /// It has moved for a while without a cut.
    Air,
    /// It cuts.
    Cutting,
}

impl Tool {
    /// As a signal: 0 standing, 1 entering, 2 air, 3 cutting.
    pub fn number(self) -> f64 {
        match self {
            Self::Standing => 0.0,
            Self::Entering => 1.0,
            Self::Air => 2.0,
            Self::Cutting => 3.0,
        }
    }
}

/// Follows the tool from rough period to rough period.
#[derive(Clone, Copy, Debug)]
pub struct Engagement {
    air_torque_nm: f64,
    low: u32,
    /// Where it is.
    pub tool: Tool,
}

impl Engagement {
    /// In air below `air_torque_nm`.
    pub fn new(air_torque_nm: f64) -> Self {
        Self {
            air_torque_nm,
            low: 0,
            tool: Tool::Standing,
        }
    }

    /// Takes the mean torque of a rough period. Whether the tool has just come into material.
    pub fn update(&mut self, moving: bool, torque_nm: f64) -> bool {
        let before = self.tool;
        // Air begins at half the torque at which it ends: a shallow cut is either.
        self.low = if torque_nm < 0.5 * self.air_torque_nm {
            self.low.saturating_add(1)
        } else {
            0
        };
        self.tool = match before {
            _ if !moving => Tool::Standing,
            _ if torque_nm >= self.air_torque_nm => Tool::Cutting,
            Tool::Standing => Tool::Entering,
            _ if self.low >= AIR_AFTER => Tool::Air,
            same => same,
        };
        if before == Tool::Standing {
            self.low = 0;
        }
        self.tool == Tool::Cutting && before != Tool::Cutting
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standing_entering_air_cutting() {
        let mut engagement = Engagement::new(0.01);
        assert!(
            !engagement.update(false, 0.05) && engagement.tool == Tool::Standing,
            "what holds it is no cut"
        );
        assert!(!engagement.update(true, 0.0) && engagement.tool == Tool::Entering);
        let periods = (0..20)
            .take_while(|_| !engagement.update(true, 0.0) && engagement.tool == Tool::Entering)
            .count();
        assert_eq!((periods, engagement.tool), (7, Tool::Air));
        assert!(engagement.update(true, 0.011) && engagement.tool == Tool::Cutting);
        assert!(!engagement.update(true, 0.2));
        (0..7).for_each(|_| assert!(!engagement.update(true, 0.0)));
        assert_eq!(engagement.tool, Tool::Cutting, "not yet sure");
        engagement.update(true, 0.007);
        (0..8).for_each(|_| assert!(!engagement.update(true, 0.004)));
        assert_eq!(engagement.tool, Tool::Air);
        assert!(!engagement.update(false, 0.0));
        assert!(engagement.update(true, 0.05), "a hold in material, resumed");
    }
}
