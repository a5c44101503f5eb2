//! The lines of a curve: LinuxCNC's G5.2 … G5.3 and Fanuc's G06.2.

use tandem_motion::nurbs::{MAX_DEGREE, NurbsError};
use tandem_sdk::AxisVector;

use crate::curve::{Curve, Dialect};
use crate::fault::{Checked, Fault, show};
use crate::interpreter::Interpreter;
use crate::letters::{AXIS_MASK, index};
use crate::orders::no_axis;

/// Orders (degree + 1) that can be asked for.
const ORDERS: std::ops::RangeInclusive<u32> = 2..=MAX_DEGREE as u32 + 1;
/// LinuxCNC's order where none is given: quadratic.
const LINUXCNC_ORDER: usize = 3;
/// Fanuc's order where none is given: cubic.
const FANUC_ORDER: usize = 4;
/// How far the first control point of a Fanuc curve may stand off the programmed position, mm or rad: the rounding of a
/// CAM system.
const START_ROUNDING: f64 = 1e-6;

impl Interpreter {
    /// The line with G5.2. Without axis words its P is the weight of the programmed position, the first control point.
    pub(crate) fn open_linuxcnc(&mut self, uncertain: u32, start: AxisVector) -> Checked<()> {
        let opened = self.open_curve(Dialect::LinuxCnc, uncertain);
        let Some(mut curve) = self.curve.take() else { return opened };
        let done = opened.and_then(|()| self.first_linuxcnc(&mut curve, start));
        curve.broken |= done.is_err();
        self.curve = Some(curve);
        done
    }

    fn first_linuxcnc(&mut self, curve: &mut Curve, start: AxisVector) -> Checked<()> {
        let bare = self.words.present & AXIS_MASK == 0;
        let weight = if bare { self.weight(b'P')? } else { 1.0 };
        curve.add(start, weight);
        self.linuxcnc_order(curve)?;
        if !bare {
            curve.add(self.state.position, self.weight(b'P')?);
        }
        Ok(())
    }

    /// A line between G5.2 and G5.3, or that with G5.3; true where it ends the curve.
    pub(crate) fn linuxcnc_line(&mut self, curve: &mut Curve) -> Checked<bool> {
        if self.words.g.as_slice().iter().any(|code| code.tenths == 53) {
            self.only("N")?;
            let order = *curve.order.get_or_insert(LINUXCNC_ORDER);
            return self.enough_points(curve, order).map(|()| true);
        }
        if self.words.present & !crate::letters::mask("N") == 0 {
            return Ok(false);
        }
        self.only("NPLXYZABCUVW")?;
        if self.words.present & AXIS_MASK == 0 {
            let why = "a line between G5.2 and G5.3 gives a control point: its axis words are missing";
            return Err(self.first_fault(why));
        }
        self.linuxcnc_order(curve)?;
        let weight = self.weight(b'P')?;
        self.advance();
        curve.add(self.state.position, weight);
        Ok(false)
    }

    fn linuxcnc_order(&self, curve: &mut Curve) -> Checked<()> {
        let Some(order) = self.words.integer(b'L', ORDERS)? else { return Ok(()) };
        match curve.order {
            Some(before) if before != order as usize => {
                Err(self.words.fault(b'L', "nurbs", format!("L has been {before} on this curve: it has one order")))
            }
            _ => {
                curve.order = Some(order as usize);
                Ok(())
            }
        }
    }

    fn enough_points(&self, curve: &Curve, order: usize) -> Checked<()> {
        if curve.points.len() >= order {
            return Ok(());
        }
        let (points, line) = (curve.points.len(), curve.line);
        let message = format!(
            "the curve that line {line} opens has {points} control points (the position before it is one), \
             order {order} needs {order}"
        );
        Err(self.first_fault(&message))
    }

    /// The line with G06.2: order, first knot, and the first control point, which is the programmed position.
    pub(crate) fn open_fanuc(&mut self, uncertain: u32, start: AxisVector) -> Checked<()> {
        let opened = self.open_curve(Dialect::Fanuc, uncertain);
        let Some(mut curve) = self.curve.take() else { return opened };
        let done = opened.and_then(|()| self.first_fanuc(&mut curve, start));
        curve.broken |= done.is_err();
        self.curve = Some(curve);
        done
    }

    fn first_fanuc(&mut self, curve: &mut Curve, start: AxisVector) -> Checked<()> {
        let order = self.words.integer(b'P', ORDERS)?.map_or(FANUC_ORDER, |order| order as usize);
        curve.order = Some(order);
        for axis in 0..self.letters.count() {
            let off = self.state.position[axis] - start[axis];
            if off.abs() > START_ROUNDING && !curve.broken {
                let message = format!(
                    "the first control point is not where the machine stands ({} off): the curve begins there",
                    show(off.abs())
                );
                return Err(self.words.fault(self.letters.letter(axis), "nurbs", message));
            }
        }
        self.state.position = start;
        curve.add(start, self.weight(b'R')?);
        self.knot(curve)
    }

    /// A line of a Fanuc curve; true where it ends the curve.
    pub(crate) fn fanuc_line(&mut self, curve: &mut Curve) -> Checked<bool> {
        if self.words.present & !crate::letters::mask("N") == 0 && self.words.g.as_slice().is_empty() {
            return Ok(false);
        }
        if curve.broken {
            self.advance();
            return Ok(false);
        }
        self.only("NKRXYZABCUVW")?;
        let order = curve.order.unwrap_or(FANUC_ORDER);
        let alone = curve.knots.len() - curve.points.len();
        if self.words.present & AXIS_MASK == 0 {
            self.only("NK")?;
            self.knot(curve)?;
            if alone == 0 {
                self.enough_points(curve, order)?;
            }
            return Ok(alone + 1 == order);
        }
        if alone > 0 {
            return Err(self.first_fault("a control point after knots that stand alone: those end the curve"));
        }
        let weight = self.weight(b'R')?;
        self.advance();
        curve.add(self.state.position, weight);
        self.knot(curve).map(|()| false)
    }

    /// The knot of the line, checked against those before it.
    fn knot(&self, curve: &mut Curve) -> Checked<()> {
        let Some(knot) = self.words.get(b'K') else {
            return Err(self.first_fault("K, the knot of this line, is missing"));
        };
        let (order, index) = (curve.order.unwrap_or(FANUC_ORDER), curve.knots.len());
        let fault = |message: String| Err(self.words.fault(b'K', "nurbs", message));
        if let Some(before) = curve.knots.last().filter(|before| knot < **before) {
            return fault(format!(
                "knot {} is below the one before it, {}: knots never fall",
                show(knot),
                show(*before)
            ));
        }
        if index < order && curve.knots.first().is_some_and(|first| *first != knot) {
            return fault(format!("the first {order} knots are equal: the curve begins at its first control point"));
        }
        let (points, degree) = (curve.points.len(), order - 1);
        if index > points && curve.knots.last() != Some(&knot) {
            return fault(format!("the last {order} knots are equal: the curve ends at its last control point"));
        }
        if index < order {
            curve.knots.push(knot);
            return Ok(());
        }
        let alike = curve.knots.iter().rev().take_while(|before| **before == knot).count();
        if index == points && alike > 0 {
            return fault(if alike == index {
                NurbsError::Empty(knot).to_string()
            } else {
                NurbsError::End { value: knot, count: alike + order, degree }.to_string()
            });
        }
        if index < points && alike == index {
            return fault(NurbsError::End { value: knot, count: alike + 1, degree }.to_string());
        }
        if index < points && alike == degree {
            return fault(NurbsError::Multiplicity { value: knot, count: order, degree }.to_string());
        }
        curve.knots.push(knot);
        Ok(())
    }

    /// The weight that `letter` gives; 1 without it.
    fn weight(&self, letter: u8) -> Checked<f64> {
        match self.words.get(letter) {
            Some(weight) if weight <= 0.0 => {
                let message = format!("the weight {} must be greater than zero", letter as char);
                Err(self.words.fault(letter, "nurbs", message))
            }
            weight => Ok(weight.unwrap_or(1.0)),
        }
    }

    /// Refuses words other than `letters` in a line of a curve.
    fn only(&self, letters: &str) -> Checked<()> {
        let axes = AXIS_MASK & !self.letters.mask;
        let foreign = !crate::letters::mask(letters) | axes;
        let Some((letter, span)) = self.words.first_of(foreign) else { return Ok(()) };
        if axes >> index(letter) & 1 != 0 {
            return Err(no_axis(letter, span, &self.letters));
        }
        let message = format!("{} has no place in this line of a curve{}", letter as char, self.words.exponent(letter));
        Err(Fault::new(span, "unused-word", message))
    }

    /// A fault at the first word of the line.
    fn first_fault(&self, message: &str) -> Fault {
        let span = self.words.g.as_slice().first().map(|code| code.span);
        let word = self.words.first_of(u32::MAX).map(|(_, span)| span);
        Fault::new(span.or(word).unwrap_or_default(), "nurbs", message)
    }
}
