//! A text that crosses the contract with its owner.

use crate::abi::layout::{Layout, START, fold, fold_text, layout};
use std::fmt;
use std::mem::ManuallyDrop;

/// A text that is fixed, or that the side that made it frees: a host does not free what the allocator of a shared
/// library gave. Reading, moving and dropping one from the other side needs no copy, so it serves the fine loop.
#[repr(C)]
pub(crate) struct Text {
    pointer: *const u8,
    length: usize,
    capacity: usize,
    /// None where the text is fixed.
    release: Option<unsafe extern "C" fn(*mut u8, usize, usize)>,
}

layout!(Text {
    pointer,
    length,
    capacity,
    release
});

// SAFETY: the text is never changed, and any thread may free it.
unsafe impl Send for Text {}
// SAFETY: as above.
unsafe impl Sync for Text {}

impl Text {
    /// A text that lives as long as the program.
    pub const fn fixed(text: &'static str) -> Self {
        Self {
            pointer: text.as_ptr(),
            length: text.len(),
            capacity: 0,
            release: None,
        }
    }

    /// A text made up at run time.
    pub fn owned(text: String) -> Self {
        let mut text = ManuallyDrop::new(text);
        Self {
            pointer: text.as_mut_ptr(),
            length: text.len(),
            capacity: text.capacity(),
            release: Some(release),
        }
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        // SAFETY: both constructors describe a text that lives as long as this.
        let bytes = unsafe { std::slice::from_raw_parts(self.pointer, self.length) };
        std::str::from_utf8(bytes).unwrap_or("a text that is not UTF-8")
    }
}

/// Frees what [`Text::owned`] took, with the allocator that it came from.
unsafe extern "C" fn release(pointer: *mut u8, length: usize, capacity: usize) {
    // SAFETY: these are the parts of a `String` that `owned` took apart, and they are handed over once.
    drop(unsafe { String::from_raw_parts(pointer, length, capacity) });
}

impl Drop for Text {
    fn drop(&mut self) {
        if let Some(release) = self.release {
            // SAFETY: the parts are those that the maker took apart.
            unsafe { release(self.pointer.cast_mut(), self.length, self.capacity) };
        }
    }
}

impl Clone for Text {
    fn clone(&self) -> Self {
        match self.release {
            None => Self {
                release: None,
                ..*self
            },
            Some(_) => Self::owned(self.as_str().to_string()),
        }
    }
}

/// Words of a plugin, such as what a fault code means; empty where it has none.
#[derive(Clone, PartialEq, Eq)]
#[repr(transparent)]
pub struct Words(Text);

impl Layout for Words {
    const HASH: u64 = fold(fold_text(START, "Words"), Text::HASH);
}

impl Words {
    /// Words made up at run time. Allocates: not for the fine loop.
    pub fn new(words: impl Into<String>) -> Self {
        Self(Text::owned(words.into()))
    }

    /// Fixed words. Any loop; does not allocate.
    pub const fn fixed(words: &'static str) -> Self {
        Self(Text::fixed(words))
    }

    /// The words. Any loop; does not allocate.
    pub fn as_str(&self) -> &str {
        self.0.as_str()
    }
}

impl Default for Words {
    fn default() -> Self {
        Self::fixed("")
    }
}

impl fmt::Debug for Words {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Debug for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_str().fmt(f)
    }
}

impl PartialEq for Text {
    fn eq(&self, other: &Self) -> bool {
        self.as_str() == other.as_str()
    }
}

impl Eq for Text {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fixed_and_owned_texts_read_the_same() {
        let owned = Text::owned(format!("no {}", "drive"));
        assert_eq!(owned, Text::fixed("no drive"));
        assert_eq!(owned.clone().as_str(), "no drive");
        assert_eq!(Text::owned(String::new()).as_str(), "");
    }
}
