//! NURBS curves: evaluation, arc length, the curve by its arc length, knot insertion, smooth pieces.
//!
//! Called on the rough loop. Making a curve or a table allocates, evaluating does not. Algorithms named A2.1, A3.3, A5.1
//! and so on are those of Piegl & Tiller, The NURBS Book, 2nd edition.

mod arc_length;
mod curve;
mod derivatives;
mod error;
mod evaluate;
mod fit;
mod hairpins;
mod hull;
mod insert;
mod length;
mod levels;
mod nearest;
mod pieces;
mod straight;

pub use arc_length::{ArcLength, Place};
pub use curve::{MAX_DEGREE, MAX_WEIGHT_RATIO, Nurbs};
pub use derivatives::{AlongPath, Derivatives};
pub use error::NurbsError;
pub use length::Length;
pub use nearest::Nearest;
pub use pieces::{CORNER_RAD, Piece};
