//! Random numbers from a seed that is printed.

/// An xorshift generator.
pub struct Random(u64);

impl Random {
    /// From the clock, or from `TANDEM_SEED`, to see a failure again.
    pub fn from_the_clock() -> Self {
        let clock = || std::time::UNIX_EPOCH.elapsed().unwrap().subsec_nanos().into();
        let seed = std::env::var("TANDEM_SEED").map_or_else(|_| clock(), |seed| seed.parse::<u64>().unwrap()) | 1;
        println!("TANDEM_SEED={seed}");
        Self(seed)
    }

    pub fn number(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub fn below(&mut self, bound: usize) -> usize {
        (self.number() % bound as u64) as usize
    }

    pub fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.number() as u8).collect()
    }
}
