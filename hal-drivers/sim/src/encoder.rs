//! What the encoders of the joints say: where they begin to count, their noise and their counts.

use serde::{Deserialize, Serialize};
use tandem_random::Random;
use tandem_sdk::{Attached, AxisVector};

use crate::options::Options;

/// What an encoder knows at power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Encoder {
    /// Where its joint stands.
    #[default]
    Absolute,
    /// Nothing: it counts from zero, wherever its joint stands, and only homing finds out.
    Incremental,
}

/// All encoders of a machine, as their drives read them.
#[derive(Clone, Debug)]
pub(crate) struct Encoders {
    count_mm: f64,
    noise_mm: f64,
    noise: Random,
}

impl Encoders {
    /// Those of checked options.
    pub fn new(options: &Options) -> Self {
        let noise = Random::new(options.seed.wrapping_add(NOISE));
        Self {
            count_mm: options.encoder_count_mm,
            noise_mm: options.encoder_noise_mm,
            noise,
        }
    }

    /// What is read where a joint is at `position`: with noise, then in whole counts. Fine loop.
    #[inline]
    pub fn read(&mut self, position: f64) -> f64 {
        if self.noise_mm == 0.0 && self.count_mm == 0.0 {
            return position;
        }
        self.read_roughly(position)
    }

    fn read_roughly(&mut self, position: f64) -> f64 {
        let noisy = if self.noise_mm == 0.0 {
            position
        } else {
            position + self.noise_mm * self.noise.normal()
        };
        if self.count_mm == 0.0 {
            noisy
        } else {
            (noisy / self.count_mm).round() * self.count_mm
        }
    }
}

/// The joints at power-on, mm or rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PowerOn {
    /// Where the encoders have them.
    pub reading: AxisVector,
    /// How far beyond that they really stand.
    pub shift: AxisVector,
}

impl PowerOn {
    /// The machine file has them at `start`, the options may have them elsewhere.
    pub fn new(options: &Options, start: &AxisVector) -> Self {
        let mut spread = Random::new(options.seed.wrapping_add(SPREAD));
        let stands = |joint: usize| {
            let place = options.start_mm.get(joint).copied().unwrap_or(start[joint]);
            let share = spread.between(-1.0, 1.0);
            if options.start_spread_mm == 0.0 {
                place
            } else {
                place + options.start_spread_mm * share
            }
        };
        let stands = AxisVector(std::array::from_fn(stands));
        let error = unknown_start(options);
        match options.encoder {
            Encoder::Absolute => Self {
                reading: stands,
                shift: error,
            },
            Encoder::Incremental => Self {
                reading: AxisVector::ZERO,
                shift: stands + error,
            },
        }
    }
}

/// What a driver says of its joints where they stand at `position`: nothing is known of one that counts from power-on.
pub(crate) fn attached(encoder: Encoder, position: AxisVector) -> Attached {
    match encoder {
        Encoder::Absolute => Attached::at(position),
        Encoder::Incremental => Attached::counting_from_power_on(position),
    }
}

/// How far each joint stands from where its drive says: a seeded part of the option.
fn unknown_start(options: &Options) -> AxisVector {
    let mut random = Random::new(options.seed.wrapping_add(START));
    let most_mm = options.unknown_start_mm;
    AxisVector(std::array::from_fn(|_| random.between(-most_mm, most_mm)))
}

/// What makes rows of random numbers from one seed different ones.
const NOISE: u64 = 0x656e_636f_6465_7273;
const SPREAD: u64 = 0x7370_7265_6164_0000;
const START: u64 = 0x7374_6172_7400_0000;

#[cfg(test)]
mod tests {
    use super::*;

    fn options(text: &str) -> Options {
        Options::parse(text).unwrap()
    }

    #[test]
    fn an_encoder_is_exact_unless_it_is_told_otherwise() {
        let mut exact = Encoders::new(&options(""));
        assert_eq!(
            [0.1, -7.300_001, 1e-300].map(|at| exact.read(at)),
            [0.1, -7.300_001, 1e-300]
        );
        let mut counts = Encoders::new(&options("encoder_count_mm = 0.25"));
        assert_eq!(
            [0.1, 0.2, -0.4].map(|at| counts.read(at)),
            [0.0, 0.25, -0.5]
        );
    }

    #[test]
    fn noise_has_the_width_that_is_asked_for_and_repeats() {
        let row = |seed: u64| {
            let mut noisy =
                Encoders::new(&options(&format!("encoder_noise_mm = 0.01\nseed = {seed}")));
            (0..10_000).map(|_| noisy.read(5.0)).collect::<Vec<_>>()
        };
        let values = row(3);
        let variance = values.iter().map(|v| (v - 5.0).powi(2)).sum::<f64>() / 1e4;
        assert!(
            (0.0095..0.0105).contains(&variance.sqrt()),
            "{}",
            variance.sqrt()
        );
        assert!(row(3) == values && row(4) != values);
    }

    #[test]
    fn joints_stand_where_they_are_told_to_or_anywhere_near() {
        let machine = AxisVector::from_slice(&[1.0, 2.0, 3.0]);
        let at = |text: &str| PowerOn::new(&options(text), &machine);
        assert_eq!(
            at(""),
            PowerOn {
                reading: machine,
                shift: AxisVector::ZERO
            }
        );
        assert_eq!(at("start_mm = [37.5]").reading.0[..3], [37.5, 2.0, 3.0]);
        let spread = at("start_spread_mm = 20\nseed = 7");
        assert!(
            (0..3).all(|i| spread.reading[i] != machine[i]
                && (spread.reading[i] - machine[i]).abs() <= 20.0)
        );
        assert_eq!(spread, at("start_spread_mm = 20\nseed = 7"));
        let blind = at("encoder = \"incremental\"\nstart_mm = [37.5]");
        assert_eq!(
            (blind.reading, blind.shift.0[..2].to_vec()),
            (AxisVector::ZERO, vec![37.5, 2.0])
        );
        assert_eq!(attached(Encoder::Incremental, blind.reading).known, 0);
    }
}
