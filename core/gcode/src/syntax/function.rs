//! Operators and functions of expressions, with the meaning that LinuxCNC gives them. Angles are in degrees.

/// How far two values may lie apart and still be EQ.
const EQUAL: f64 = 1e-4;

/// An operator, with how strongly it binds: `**` before `* / MOD` before `+ -` before comparisons before AND OR XOR.
/// Operators that bind alike are taken from the left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operator {
    Power,
    Times,
    Over,
    Modulo,
    Plus,
    Minus,
    Equal,
    NotEqual,
    Greater,
    GreaterEqual,
    Less,
    LessEqual,
    And,
    Or,
    Xor,
}

impl Operator {
    /// The operator written as `name`, upper case.
    pub fn called(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"MOD" => Self::Modulo,
            b"EQ" => Self::Equal,
            b"NE" => Self::NotEqual,
            b"GT" => Self::Greater,
            b"GE" => Self::GreaterEqual,
            b"LT" => Self::Less,
            b"LE" => Self::LessEqual,
            b"AND" => Self::And,
            b"OR" => Self::Or,
            b"XOR" => Self::Xor,
            _ => return None,
        })
    }

    /// Strength of binding, from 1.
    pub fn strength(self) -> u8 {
        match self {
            Self::Power => 5,
            Self::Times | Self::Over | Self::Modulo => 4,
            Self::Plus | Self::Minus => 3,
            Self::And | Self::Or | Self::Xor => 1,
            _ => 2,
        }
    }

    /// `left` operator `right`, or why there is no result.
    pub fn apply(self, left: f64, right: f64) -> Result<f64, &'static str> {
        let truth = |yes: bool| f64::from(u8::from(yes));
        let value = match self {
            Self::Power if left < 0.0 && right.fract() != 0.0 => {
                return Err("a negative number has no power with a fraction");
            }
            Self::Power => left.powf(right),
            Self::Times => left * right,
            Self::Over | Self::Modulo if right == 0.0 => return Err("division by zero"),
            Self::Over => left / right,
            Self::Modulo => left.rem_euclid(right),
            Self::Plus => left + right,
            Self::Minus => left - right,
            Self::Equal => truth((left - right).abs() < EQUAL),
            Self::NotEqual => truth((left - right).abs() >= EQUAL),
            Self::Greater => truth(left > right),
            Self::GreaterEqual => truth(left >= right),
            Self::Less => truth(left < right),
            Self::LessEqual => truth(left <= right),
            Self::And => truth(left != 0.0 && right != 0.0),
            Self::Or => truth(left != 0.0 || right != 0.0),
            Self::Xor => truth((left != 0.0) != (right != 0.0)),
        };
        finite(value)
    }
}

fn finite(value: f64) -> Result<f64, &'static str> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err("the result is too large to be a number")
    }
}

/// A function of one value. ATAN (two values) and EXISTS are read by the expression itself.
pub(crate) type Function = fn(f64) -> Result<f64, &'static str>;

/// The names of all functions, for messages.
pub(crate) const NAMES: &str = "ABS ACOS ASIN ATAN COS EXISTS EXP FIX FUP LN ROUND SIN SQRT TAN";

/// The function called `name`, upper case.
pub(crate) fn called(name: &[u8]) -> Option<Function> {
    Some(match name {
        b"ABS" => |x| Ok(x.abs()),
        b"ACOS" => |x| within_one(x).map(|x| x.acos().to_degrees()),
        b"ASIN" => |x| within_one(x).map(|x| x.asin().to_degrees()),
        b"COS" => |x| Ok(x.to_radians().cos()),
        b"EXP" => |x| finite(x.exp()),
        b"FIX" => |x| Ok(x.floor()),
        b"FUP" => |x| Ok(x.ceil()),
        b"LN" => |x| {
            if x > 0.0 {
                Ok(x.ln())
            } else {
                Err("LN needs a positive number")
            }
        },
        b"ROUND" => |x| Ok(x.round()),
        b"SIN" => |x| Ok(x.to_radians().sin()),
        b"SQRT" => |x| {
            if x >= 0.0 {
                Ok(x.sqrt())
            } else {
                Err("SQRT needs a number that is not negative")
            }
        },
        b"TAN" => |x| Ok(x.to_radians().tan()),
        _ => return None,
    })
}

fn within_one(x: f64) -> Result<f64, &'static str> {
    if (-1.0..=1.0).contains(&x) {
        Ok(x)
    } else {
        Err("ACOS and ASIN need a number from -1 to 1")
    }
}
