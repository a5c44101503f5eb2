//! Seeded random numbers for what is simulated or broken on purpose: the same seed gives the same row everywhere.
//!
//! The generator is `SplitMix64` (Steele, Lea, Flood: *Fast splittable pseudorandom number generators*, OOPSLA 2014). It is written
//! here and not taken from a crate, because a seed in a machine file has to mean the same run in every later version.

use std::f64::consts::TAU;

/// What the state advances by: 2⁶⁴ divided by the golden ratio, odd.
const GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

/// The generator; its whole state is one number, and any seed is good. No method allocates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Random(u64);

impl Random {
    /// The row of `seed`. Rows of neighbouring seeds have nothing in common.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Row `index` (from 0) of `seed`, for those that each need a row of their own: one more changes no other.
    #[must_use]
    pub fn of(seed: u64, index: u64) -> Self {
        let mut seeds = Self(seed.wrapping_add(index.wrapping_mul(GAMMA.rotate_left(32))));
        Self(seeds.number())
    }

    /// The next number.
    pub fn number(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GAMMA);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// The next number, at least 0 and below 1.
    pub fn share(&mut self) -> f64 {
        (self.number() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// The next number between the two.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.share()
    }

    /// The next number of a standard normal distribution, after Box and Muller.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.share()).ln()).sqrt();
        radius * (TAU * self.share()).cos()
    }

    /// True once in so many times, of which there is at least one.
    pub fn once_in(&mut self, times: u64) -> bool {
        self.number().is_multiple_of(times)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_the_published_generator() {
        // The first outputs of the reference implementation (Vigna, splitmix64.c) for the seed 1234567.
        let mut random = Random::new(1_234_567);
        let expected = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
        ];
        assert_eq!([0; 3].map(|_| random.number()), expected);
    }

    #[test]
    fn shares_are_even_and_lie_between_the_bounds() {
        let mut random = Random::new(7);
        let shares: Vec<f64> = (0..10_000).map(|_| random.between(-1.0, 3.0)).collect();
        let mean = shares.iter().sum::<f64>() / 1e4;
        assert!((mean - 1.0).abs() < 0.04, "{mean}");
        assert!(shares.iter().all(|share| (-1.0..3.0).contains(share)));
        let hits = (0..10_000).filter(|_| random.once_in(4)).count();
        assert!((2350..2650).contains(&hits), "{hits}");
    }

    #[test]
    fn normal_numbers_are_spread_as_they_should_be() {
        let mut random = Random::new(3);
        let values: Vec<f64> = (0..100_000).map(|_| random.normal()).collect();
        let mean = values.iter().sum::<f64>() / 1e5;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 1e5;
        let beyond = values.iter().filter(|v| v.abs() > 1.96).count();
        assert!(
            mean.abs() < 0.02 && (variance - 1.0).abs() < 0.02 && (4500..5500).contains(&beyond)
        );
    }

    /// Joints of a machine take neighbouring seeds: none may read what another has read, however much later.
    #[test]
    fn rows_of_neighbours_have_no_number_in_common() {
        let rows = |row: fn(u64) -> Random| {
            let mut numbers: Vec<u64> = (0..8)
                .flat_map(|seed| {
                    let mut random = row(seed);
                    (0..1000).map(move |_| random.number())
                })
                .collect();
            numbers.sort_unstable();
            numbers.dedup();
            numbers.len()
        };
        assert_eq!(rows(Random::new), 8000);
        assert_eq!(rows(|index| Random::of(7, index)), 8000);
        assert_eq!(rows(|seed| Random::of(seed, 3)), 8000);
    }
}
