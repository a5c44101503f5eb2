//! The curve by its arc length.

use tandem_sdk::AxisVector;

use super::fit::Fit;
use super::length::Length;
use super::straight::Line;
use super::{AlongPath, Nurbs, Piece};

/// A place in an [`ArcLength`] table, kept between look-ups so that marching costs nothing to search.
#[derive(Clone, Copy, Debug, Default)]
pub struct Place(usize);

/// The parameter over the arc length: knot spans halved until a polynomial of degree 7 that meets u and its first three
/// derivatives at both ends follows the curve to 2e-8 in speed and 2e-9 mm along the curve.
///
/// A look-up is one polynomial, without iteration. The table can be built span by span, so that a long curve costs no more
/// at a time than is asked for.
#[derive(Clone, Debug)]
pub struct ArcLength {
    fits: Vec<Fit>,
    /// Straight spans, whose derivatives by arc length are known without the parameter.
    lines: Vec<Line>,
    /// The span to be added next.
    next_span: usize,
    built: Length,
}

/// Halvings of a knot span at most. At a cusp parts shrink by half each, down to 1e-9 mm.
const MAX_HALVINGS: u32 = 60;

/// So far behind the end of a straight span a place is still on it, mm: path coordinates round.
const ROUNDING_MM: f64 = 1e-9;

impl ArcLength {
    /// An empty table at the start of `curve`.
    pub fn empty(curve: &Nurbs) -> Self {
        Self {
            fits: Vec::new(),
            lines: Vec::new(),
            next_span: curve.degree(),
            built: Length::default(),
        }
    }

    /// The table of the whole `curve`. Allocates.
    pub fn new(curve: &Nurbs) -> Self {
        let mut table = Self::empty(curve);
        while table.add_span(curve) {}
        table
    }

    /// The table of `piece` of `curve`, with s from its start: at its ends the derivatives are those inside. Allocates.
    pub fn of_piece(curve: &Nurbs, piece: &Piece) -> Self {
        let mut table = Self {
            next_span: curve.span(piece.range.0),
            ..Self::empty(curve)
        };
        while table.next_span < curve.points() && curve.knots()[table.next_span] < piece.range.1 {
            // What a turn leaves of a span may be rounding: there is nothing to drive, and no direction.
            table.add_part(curve, piece.range, ROUNDING_MM);
        }
        if table.fits.is_empty() {
            table.next_span = curve.span(piece.range.0);
            table.add_part(curve, piece.range, 0.0);
        }
        table.fits.shrink_to_fit();
        table.lines.shrink_to_fit();
        table
    }

    /// Adds the next knot span of `curve`; false where there is none. Allocates.
    pub fn add_span(&mut self, curve: &Nurbs) -> bool {
        let more = self.next_span < curve.points();
        if more {
            self.add_part(curve, curve.range(), 0.0);
        }
        more
    }

    /// Adds the next knot span as far as it lies within `range`, unless that is shorter than `min_mm`.
    fn add_part(&mut self, curve: &Nurbs, range: (f64, f64), min_mm: f64) {
        let span = self.next_span;
        self.next_span += 1;
        let from = curve.knots()[span].max(range.0);
        let to = curve.knots()[span + 1].min(range.1);
        let whole = if to > from {
            curve.gauss(span, from, to)
        } else {
            0.0
        };
        if to > from && whole >= min_mm {
            let start_mm = self.built.mm;
            self.add(curve, span, (from, to), whole, MAX_HALVINGS);
            self.lines.extend(Line::new(
                curve,
                span,
                (from, to),
                [start_mm, self.built.mm],
            ));
        }
    }

    /// Adds a part of a span, whose length by the rule is `whole`.
    fn add(
        &mut self,
        curve: &Nurbs,
        span: usize,
        (from, to): (f64, f64),
        whole: f64,
        halvings: u32,
    ) {
        let middle = 0.5 * (from + to);
        let [left, right] = [
            curve.gauss(span, from, middle),
            curve.gauss(span, middle, to),
        ];
        let halves = left + right;
        let error_mm = (whole - halves).abs() + curve.hidden_mm(span, (from, to), halves);
        let last = halvings == 0 || middle <= from || middle >= to;
        if last || error_mm <= 1e-13 * halves.max(1e-3) {
            if let Some(fit) = Fit::new(curve, span, (from, to), self.built.mm, halves) {
                return self.push(fit, error_mm);
            }
            if last {
                return;
            }
        }
        self.add(curve, span, (from, middle), left, halvings - 1);
        self.add(curve, span, (middle, to), right, halvings - 1);
    }

    fn push(&mut self, fit: Fit, error_mm: f64) {
        self.built.mm += fit.length_mm;
        self.built.error_mm += error_mm;
        self.fits.push(fit);
    }

    /// Length of what the table holds, with its error bound.
    pub fn length(&self) -> Length {
        self.built
    }

    /// Memory that the table takes, bytes.
    pub fn bytes(&self) -> usize {
        self.fits.capacity() * size_of::<Fit>() + self.lines.capacity() * size_of::<Line>()
    }

    /// Number of parts in the table.
    pub fn parts(&self) -> usize {
        self.fits.len()
    }

    /// Parameter and knot span at `s_mm`, mm from the start of the curve; `place` is where the last look-up was. Does not
    /// allocate.
    #[inline]
    pub fn parameter(&self, s_mm: f64, place: &mut Place) -> (f64, usize) {
        let fit = &self.fits[self.find(s_mm, place)];
        (fit.parameter(s_mm), fit.span)
    }

    /// Position and derivatives by arc length at `s_mm`, on a straight span without those of the parameter; `None` where the
    /// curve has a cusp. Does not allocate.
    #[inline]
    pub fn along_path(&self, curve: &Nurbs, s_mm: f64, place: &mut Place) -> Option<AlongPath> {
        if let Some(line) = self.line(s_mm) {
            return Some(line.at(s_mm));
        }
        let (u, span) = self.parameter(s_mm, place);
        curve.along_path_in(span, u)
    }

    /// Position at `s_mm`. Does not allocate.
    pub fn position(&self, curve: &Nurbs, s_mm: f64, place: &mut Place) -> AxisVector {
        if let Some(line) = self.line(s_mm) {
            return line.at(s_mm).position;
        }
        let (u, span) = self.parameter(s_mm, place);
        curve.derivatives_in(span, u).position
    }

    /// Arc length at the parameter `u`, mm. Does not allocate.
    pub fn length_at(&self, curve: &Nurbs, u: f64) -> f64 {
        let index = self.fits.partition_point(|fit| fit.from <= u).max(1) - 1;
        let fit = &self.fits[index];
        fit.start_mm + curve.length_in(fit.span, fit.from, u.min(fit.to)).mm
    }

    /// Length of the part of the table that holds `s_mm`, and where it ends, mm: the curve is smooth on this scale, and
    /// sharp features have parts of their own. Does not allocate.
    pub fn part(&self, s_mm: f64, place: &mut Place) -> (f64, f64) {
        if let Some(line) = self.line(s_mm) {
            return (line.end_mm - line.start_mm, line.end_mm);
        }
        let fit = &self.fits[self.find(s_mm, place)];
        (fit.length_mm, fit.start_mm + fit.length_mm)
    }

    /// The straight span that holds `s_mm`, the one behind it at a border.
    #[inline]
    fn line(&self, s_mm: f64) -> Option<&Line> {
        if self.lines.is_empty() {
            return None;
        }
        let behind = self.lines.partition_point(|line| line.start_mm <= s_mm);
        self.lines[..behind]
            .last()
            .filter(|line| s_mm <= line.end_mm + ROUNDING_MM)
    }

    /// The part that holds `s_mm`, sought a few parts around `place`, then by halving.
    #[inline]
    fn find(&self, s_mm: f64, place: &mut Place) -> usize {
        let last = self.fits.len() - 1;
        let mut at = place.0.min(last);
        for _ in 0..4 {
            let fit = &self.fits[at];
            if s_mm < fit.start_mm && at > 0 {
                at -= 1;
            } else if s_mm > fit.start_mm + fit.length_mm && at < last {
                at += 1;
            } else {
                place.0 = at;
                return at;
            }
        }
        place.0 = self.fits.partition_point(|fit| fit.start_mm <= s_mm).max(1) - 1;
        place.0
    }
}
