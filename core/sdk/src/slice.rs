//! Variable-length data across the contract.

use crate::abi::layout::{Layout, START, fold, fold_text};

/// A borrowed slice as pointer and length. Valid for the call in which it is handed over, no longer.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct RawSlice<T> {
    pointer: *const T,
    length: usize,
}

impl<T: Layout> Layout for RawSlice<T> {
    const HASH: u64 = fold(fold(fold_text(START, "RawSlice"), size_of::<Self>() as u64), T::HASH);
}

// SAFETY: a `RawSlice` is only a description of where data lies; reading it is `unsafe` and the reader's promise.
unsafe impl<T: Sync> Send for RawSlice<T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for RawSlice<T> {}

impl<T> RawSlice<T> {
    /// The empty slice.
    pub const EMPTY: Self = Self { pointer: std::ptr::NonNull::dangling().as_ptr(), length: 0 };

    /// Describes `slice`.
    pub const fn new(slice: &[T]) -> Self {
        Self { pointer: slice.as_ptr(), length: slice.len() }
    }

    /// Number of elements.
    pub const fn len(&self) -> usize {
        self.length
    }

    /// Whether there is no element.
    pub const fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// The data.
    ///
    /// # Safety
    /// Only during the call in which the slice was handed over: the owner may free the data afterwards.
    pub unsafe fn as_slice<'a>(&self) -> &'a [T] {
        // SAFETY: made by `new` from a live slice, and the caller promises that it still lives.
        unsafe { std::slice::from_raw_parts(self.pointer, self.length) }
    }
}

impl<T> Default for RawSlice<T> {
    fn default() -> Self {
        Self::EMPTY
    }
}
