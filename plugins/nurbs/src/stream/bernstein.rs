//! Bounds of polynomials on an interval, by their Bernstein coefficients: a polynomial lies within these, and halving the
//! interval brings them to it with the square of its length. So a bound is proven, and as near as is asked for.

/// Halvings at most: by then coefficients and polynomial are the same to rounding.
const HALVINGS: u32 = 26;
/// Distance of bound and polynomial that is as good as none, as a share.
const CLOSE: f64 = 1e-9;

/// The Bernstein coefficients on `0 ≤ t ≤ duration_s` of the polynomial with these coefficients of the powers of t.
pub fn bernstein<const N: usize>(powers: &[f64; N], duration_s: f64) -> [f64; N] {
    let mut scaled = *powers;
    let mut power = 1.0;
    for value in &mut scaled {
        *value *= power;
        power *= duration_s;
    }
    std::array::from_fn(|j| {
        Table::<N>::SHARES[j]
            .iter()
            .zip(&scaled)
            .fold(0.0, |sum, (share, value)| sum + share * value)
    })
}

/// What each power adds to each coefficient: row j of Pascal's triangle over that of the degree, C(j,i)/C(n,i).
struct Table<const N: usize>;

impl<const N: usize> Table<N> {
    const SHARES: [[f64; N]; N] = {
        let mut shares = [[0.0; N]; N];
        let mut j = 0;
        while j < N {
            let mut i = 0;
            let mut share = 1.0;
            while i <= j {
                shares[j][i] = share;
                share *= (j - i) as f64 / (N - 1 - i + (i == N - 1) as usize) as f64;
                i += 1;
            }
            j += 1;
        }
        shares
    };
}

/// Adds the Bernstein coefficients of the square of a polynomial to `sum`, which is of twice the degree.
pub fn add_square<const N: usize, const M: usize>(coefficients: &[f64; N], sum: &mut [f64; M]) {
    const { assert!(M + 1 == 2 * N) };
    let [of_one, of_square] = [Binomials::<N>::ROW.as_slice(), &Binomials::<M>::ROW];
    for (k, sum) in sum.iter_mut().enumerate() {
        let first = (k + 1).saturating_sub(N);
        let products = (first..=k.min(N - 1))
            .map(|i| of_one[i] * of_one[k - i] * coefficients[i] * coefficients[k - i]);
        *sum += products.sum::<f64>() / of_square[k];
    }
}

/// How many ways there are to choose each number of N − 1.
struct Binomials<const N: usize>;

impl<const N: usize> Binomials<N> {
    const ROW: [f64; N] = {
        let mut row = [1.0; N];
        let mut i = 1;
        while i < N {
            row[i] = row[i - 1] * (N - i) as f64 / i as f64;
            i += 1;
        }
        row
    };
}

/// The largest value of a polynomial by its Bernstein coefficients: not below it, and where it is above `enough` no more
/// than 1e-9 of the coefficients above it.
pub fn highest<const N: usize>(coefficients: &[f64; N], enough: f64) -> f64 {
    let size = coefficients
        .iter()
        .fold(0.0f64, |most, c| most.max(c.abs()));
    higher(coefficients, enough, CLOSE * size, HALVINGS)
}

/// The largest absolute value, the same way.
pub fn largest<const N: usize>(coefficients: &[f64; N], enough: f64) -> f64 {
    let up = highest(coefficients, enough);
    up.max(highest(&coefficients.map(|c| -c), enough.max(up)))
}

fn higher<const N: usize>(coefficients: &[f64; N], enough: f64, close: f64, halvings: u32) -> f64 {
    let most = coefficients
        .iter()
        .copied()
        .fold(f64::NEG_INFINITY, f64::max);
    let reached = coefficients[0].max(coefficients[N - 1]);
    if most <= enough || most - reached <= close || halvings == 0 {
        return most;
    }
    let mut left = *coefficients;
    let mut right = *coefficients;
    // De Casteljau: the left half keeps the first of each round, the right half the last.
    for (round, kept) in left.iter_mut().enumerate().skip(1) {
        for i in 0..N - round {
            right[i] = f64::midpoint(right[i], right[i + 1]);
        }
        *kept = right[0];
    }
    let enough = enough.max(reached);
    let found = higher(&left, enough, close, halvings - 1);
    found
        .max(higher(&right, enough.max(found), close, halvings - 1))
        .max(reached)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_square_of_a_polynomial_has_its_own_coefficients() {
        let powers = [0.3, -1.2, 0.7, 2.0, -0.4];
        let mut sum = [1.0; 9];
        add_square(&bernstein(&powers, 1.5), &mut sum);
        let mut squares = [0.0; 9];
        squares[0] = 1.0;
        for (i, a) in powers.iter().enumerate() {
            for (j, b) in powers.iter().enumerate() {
                squares[i + j] += a * b;
            }
        }
        for (found, expected) in sum.iter().zip(bernstein(&squares, 1.5)) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }

    fn value(powers: &[f64], t: f64) -> f64 {
        powers.iter().rev().fold(0.0, |sum, c| sum * t + c)
    }

    #[test]
    fn a_bound_is_never_below_the_polynomial_and_meets_it_where_it_matters() {
        // Chebyshev's polynomial of degree 5, whose extremes lie inside and are all of size 1; and some without symmetry.
        let all = [
            [0.0, 5.0, 0.0, -20.0, 0.0, 16.0],
            [1.0, -3.0, 2.0, 0.5, -4.0, 3.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, -1.0],
            [0.3, 0.0, 0.0, 0.0, 0.0, 0.0],
        ];
        for powers in all {
            for duration_s in [0.1, 0.7, 1.0, 2.5] {
                let b = bernstein(&powers, duration_s);
                let looks =
                    (0..=10_000).map(|n| value(&powers, duration_s * f64::from(n) / 1e4).abs());
                let seen = looks.fold(0.0, f64::max);
                let bound = largest(&b, 0.0);
                assert!(
                    bound >= seen - 1e-12 && bound <= seen * (1.0 + 1e-6) + 1e-12,
                    "{powers:?}: {bound} {seen}"
                );
                // What is enough ends the search, and the bound still holds.
                assert!(largest(&b, 10.0 * seen + 1.0) >= seen - 1e-12, "{powers:?}");
            }
        }
    }
}
