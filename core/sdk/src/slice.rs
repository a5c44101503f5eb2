//! Variable-length data across the contract.

use std::fmt;
use std::marker::PhantomData;
use std::ops::Deref;

use crate::abi::layout::{Layout, START, fold, fold_text};

/// A borrowed slice with a layout that both sides of the contract know: a pointer and a length. It reads as the slice that it
/// was made of, and lives as long.
#[repr(C)]
pub struct Slice<'a, T> {
    pointer: *const T,
    length: usize,
    borrowed: PhantomData<&'a [T]>,
}

impl<T: Layout> Layout for Slice<'_, T> {
    const HASH: u64 = fold(
        fold(fold_text(START, "Slice"), size_of::<Self>() as u64),
        T::HASH,
    );
}

// SAFETY: it is a shared reference to a slice, and goes where that may go.
unsafe impl<T: Sync> Send for Slice<'_, T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for Slice<'_, T> {}

impl<'a, T> Slice<'a, T> {
    /// The slice `of`. Any loop; does not allocate.
    pub const fn new(of: &'a [T]) -> Self {
        Self {
            pointer: of.as_ptr(),
            length: of.len(),
            borrowed: PhantomData,
        }
    }

    /// The slice itself, for as long as it was borrowed.
    #[inline]
    pub const fn get(self) -> &'a [T] {
        // SAFETY: it was made by `new` of a slice that lives for `'a`; from the other side of the contract too, where the same
        // constructor is the only one.
        unsafe { std::slice::from_raw_parts(self.pointer, self.length) }
    }
}

impl<T> Clone for Slice<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Slice<'_, T> {}

impl<T> Default for Slice<'_, T> {
    fn default() -> Self {
        Self::new(&[])
    }
}

impl<T> Deref for Slice<'_, T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        self.get()
    }
}

impl<T: fmt::Debug> fmt::Debug for Slice<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.get().fmt(f)
    }
}
