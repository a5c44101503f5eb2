//! Numbers of all axes side by side: loops over them become vector instructions.

#![allow(
    clippy::inline_always,
    reason = "what is inlined is compiled for the wide instructions of its caller"
)]

/// One number a lane.
pub type Lanes<const L: usize> = [f64; L];

/// Calls `f` for every lane. Not a loop: what is summed up lane by lane stays in registers then, and does not go through memory.
#[inline(always)]
pub fn each<const L: usize>(f: impl FnMut(usize) -> f64) -> Lanes<L> {
    std::array::from_fn(f)
}

/// Makes the method that is named first: it does what the second does, in wide instructions where the processor has them; the third
/// name is that of the second compiled for these. The numbers are the same bit for bit.
///
/// What the second calls is compiled for wide instructions only where it is inlined. A long method that is called in another of this
/// kind is therefore one itself, and asks the processor again: two instructions a call, where all of it inlined in one place takes up
/// to a hundredth more.
#[macro_export]
macro_rules! in_wide_instructions {
    ($(#[$about:meta])* $visible:vis fn $name:ident = $any:ident, $wide:ident(
        &mut $this:ident $(, $argument:ident: $kind:ty)* $(,)?
    ) -> $result:ty;) => {
        $crate::in_wide_instructions! { @
            [$(#[$about])* $visible] $name $any $wide [&mut $this] $this [$($argument: $kind),*] $result
        }
    };
    ($(#[$about:meta])* $visible:vis fn $name:ident = $any:ident, $wide:ident(
        &$this:ident $(, $argument:ident: $kind:ty)* $(,)?
    ) -> $result:ty;) => {
        $crate::in_wide_instructions! { @
            [$(#[$about])* $visible] $name $any $wide [&$this] $this [$($argument: $kind),*] $result
        }
    };
    (@ [$($head:tt)*] $name:ident $any:ident $wide:ident [$($receiver:tt)*] $this:ident
        [$($argument:ident: $kind:ty),*] $result:ty) => {
        $($head)* fn $name($($receiver)* $(, $argument: $kind)*) -> $result {
            #[cfg(target_arch = "x86_64")]
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: the processor has what the function is compiled for.
                return unsafe { $this.$wide($($argument),*) };
            }
            $this.$any($($argument),*)
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2")]
        fn $wide($($receiver)* $(, $argument: $kind)*) -> $result {
            $this.$any($($argument),*)
        }
    };
}

/// The larger one; the first where either is no number. Unlike `f64::max` one instruction.
#[inline(always)]
pub fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// The smaller one; the first where either is no number.
#[inline(always)]
pub fn smaller(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}

/// The largest of all lanes that are numbers; minus infinity where none is one. Half of them are compared with the other half: taken one
/// by one from the first on they would be kept in reverse, and turned round in every step of the loop before.
#[inline(always)]
pub fn largest<const L: usize>(values: &Lanes<L>) -> f64 {
    let mut most: Lanes<L> = each(|l| larger(f64::NEG_INFINITY, values[l]));
    let mut count = L;
    while count > 1 {
        let half = count.div_ceil(2);
        for l in half..count {
            most[l - half] = larger(most[l - half], most[l]);
        }
        count = half;
    }
    most[0]
}
