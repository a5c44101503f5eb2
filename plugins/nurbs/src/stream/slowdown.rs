//! Where the next try of a window takes something back.

/// What a part of the path gets less of.
#[derive(Clone, Copy, Debug)]
pub struct Slowdown {
    /// Path coordinates of its ends, mm.
    pub from_mm: f64,
    pub to_mm: f64,
    /// Factors of the speed caps and of the jerk limits.
    pub speed: f64,
    pub jerk: f64,
}

/// The parts, as they were found.
#[derive(Debug, Default)]
pub struct Slowdowns(Vec<Slowdown>);

impl Slowdowns {
    /// Number of parts.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// Forgets all but the first `count`.
    pub fn keep_first(&mut self, count: usize) {
        self.0.truncate(count);
    }

    /// Adds a part. Of what was added since there were `known`, the last one becomes longer where they touch.
    pub fn add(&mut self, known: usize, part: Slowdown) {
        match self.0[known..].last_mut() {
            Some(last) if last.to_mm >= part.from_mm => {
                last.to_mm = last.to_mm.max(part.to_mm);
                last.speed = last.speed.min(part.speed);
                last.jerk = last.jerk.min(part.jerk);
            }
            _ => self.0.push(part),
        }
    }

    /// The parts that were found after the first `known`.
    pub fn since(&mut self, known: usize) -> impl Iterator<Item = &mut Slowdown> {
        self.0.iter_mut().skip(known)
    }

    /// The parts, as they were found.
    pub fn parts(&self) -> &[Slowdown] {
        &self.0
    }

    /// Factors at `s_mm` of the speed caps and of the jerk limits.
    pub fn at(&self, s_mm: f64) -> [f64; 2] {
        let here = self
            .0
            .iter()
            .filter(|part| part.from_mm <= s_mm && s_mm <= part.to_mm);
        here.fold([1.0; 2], |[speed, jerk], part| {
            [speed * part.speed, jerk * part.jerk]
        })
    }
}
