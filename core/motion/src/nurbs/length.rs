//! Arc length by quadrature.

use super::Nurbs;

/// Positive nodes and weights of the 8-point Gauss-Legendre rule on −1 … 1 (Abramowitz & Stegun, table 25.4).
const RULE: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];
/// Halvings of a knot span after which its length is taken as it is; the error bound says what is left.
const MAX_HALVINGS: u32 = 48;
/// Share of the mean |C′| that it has at an end if a standstill beside that lies between the nodes of the rule.
const SEEN: f64 = 0.05;
/// Relative accuracy asked of each part.
const RELATIVE: f64 = 1e-13;

/// A length with a bound on its error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Length {
    /// Length, mm.
    pub mm: f64,
    /// Bound on the error of the quadrature, mm, from the difference between a rule and its halves.
    pub error_mm: f64,
}

/// How far a span has been halved.
#[derive(Clone, Copy)]
struct Halving {
    /// Length of the whole part, mm: what the accuracy is relative to.
    scale_mm: f64,
    /// Halvings left.
    left: u32,
    /// The rule agreed with its halves one step before.
    agreed: bool,
}

impl Nurbs {
    /// Length of the whole curve. Does not allocate.
    pub fn length(&self) -> Length {
        let mut sum = Length::default();
        for span in self.degree..self.points() {
            let part = self.length_in(span, self.knots[span], self.knots[span + 1]);
            sum = Length {
                mm: sum.mm + part.mm,
                error_mm: sum.error_mm + part.error_mm,
            };
        }
        sum
    }

    /// Length of the piece on `span` between two parameters, halved until rule and halves agree to 1e-13, and
    /// the halves with theirs: once alone the errors of two halves can cancel. Does not allocate.
    pub fn length_in(&self, span: usize, from: f64, to: f64) -> Length {
        if to <= from {
            return Length::default();
        }
        let whole = self.gauss(span, from, to);
        let halving = Halving {
            scale_mm: whole.max(1e-3),
            left: MAX_HALVINGS,
            agreed: false,
        };
        self.refine(span, (from, to), whole, halving)
    }

    fn refine(&self, span: usize, (from, to): (f64, f64), whole: f64, halving: Halving) -> Length {
        let middle = 0.5 * (from + to);
        let left = self.gauss(span, from, middle);
        let right = self.gauss(span, middle, to);
        let error_mm = (left + right - whole).abs();
        let error_mm = error_mm + self.hidden_mm(span, (from, to), left + right);
        let agrees = error_mm <= RELATIVE * halving.scale_mm;
        if agrees && halving.agreed || halving.left == 0 || middle <= from || middle >= to {
            return Length {
                mm: left + right,
                error_mm,
            };
        }
        let next = Halving {
            left: halving.left - 1,
            agreed: agrees,
            ..halving
        };
        let first = self.refine(span, (from, middle), left, next);
        let second = self.refine(span, (middle, to), right, next);
        Length {
            mm: first.mm + second.mm,
            error_mm: first.error_mm + second.error_mm,
        }
    }

    /// What a place at which the curve stands still can hide from the rule, mm: there |C′| goes through zero as |u − u₀|, and
    /// so near to an end of a part of length `mm` that no node lies between. With slope c = |C′|/|u − u₀| of the part and
    /// |C′| = e at that end the rule misses no more than e²/c. Does not allocate.
    pub(super) fn hidden_mm(&self, span: usize, (from, to): (f64, f64), mm: f64) -> f64 {
        let mean = mm / (to - from);
        let shares = [from, to].map(|u| self.speed_in(span, u) / mean);
        shares
            .iter()
            .filter(|share| **share < SEEN)
            .map(|share| share * share * mm / 2.0)
            .sum()
    }

    /// The 8-point rule over a part of a span, mm.
    #[inline]
    pub(super) fn gauss(&self, span: usize, from: f64, to: f64) -> f64 {
        let middle = 0.5 * (from + to);
        let half = 0.5 * (to - from);
        let speed = |u: f64| self.speed_in(span, u);
        let sum: f64 = RULE
            .iter()
            .map(|(x, w)| w * (speed(middle - half * x) + speed(middle + half * x)))
            .sum();
        sum * half
    }
}
