//! Random numbers from a seed.

/// xorshift64*: the same program for the same seed everywhere. It is not the generator of the simulations, `tandem_random`, because
/// the seeds of programs that pages and reports of the campaign name stand for these numbers.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// From a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// From the clock, or from `TANDEM_SEED`, to see a failure again; says which.
    ///
    /// # Panics
    /// The variable holds no number.
    pub fn from_the_clock() -> Self {
        let clock = || {
            std::time::UNIX_EPOCH
                .elapsed()
                .unwrap_or_default()
                .subsec_nanos()
                .into()
        };
        let seed =
            std::env::var("TANDEM_SEED").map_or_else(|_| clock(), |seed| seed.parse().unwrap());
        println!("TANDEM_SEED={seed}");
        Self::new(seed)
    }

    /// Any bytes, so many.
    pub fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.below(256) as u8).collect()
    }

    /// From 0 to below 1.
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A whole number from 0 to below `count`.
    pub fn below(&mut self, count: u64) -> u64 {
        (self.next() >> 33) % count
    }

    /// Between two lengths, every order of magnitude alike.
    pub fn length(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// Between the two.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// One of them.
    ///
    /// # Panics
    /// There are none.
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[(self.unit() * of.len() as f64) as usize]
    }
}
