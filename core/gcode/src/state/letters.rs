//! The letters of the machine's axes, as the reader of words wants them.

use tandem_sdk::{Axes, MAX_AXES};

/// Index of a letter: 0 for A. `$` has none.
pub(crate) const fn index(letter: u8) -> usize {
    (letter - b'A') as usize
}

/// The word `$`, which names a spindle, in a mask of letters.
pub(crate) const SPINDLE_BIT: u32 = 1 << 26;

/// The bit of a letter, or of `$`, in a mask of letters.
pub(crate) const fn bit(letter: u8) -> u32 {
    match letter {
        b'$' => SPINDLE_BIT,
        letter => 1 << index(letter),
    }
}

/// The set of `letters` as a mask, bit 0 for A. `$` may be among them.
pub(crate) const fn mask(letters: &str) -> u32 {
    let letters = letters.as_bytes();
    let mut mask = 0;
    let mut at = 0;
    while at < letters.len() {
        mask |= bit(letters[at]);
        at += 1;
    }
    mask
}

/// Every letter that can name an axis.
pub(crate) const AXIS_LETTERS: &str = "XYZABCUVW";
pub(crate) const AXIS_MASK: u32 = mask(AXIS_LETTERS);

/// Which letters are axes of this machine.
#[derive(Clone, Debug)]
pub(crate) struct Letters {
    names: [u8; MAX_AXES],
    rotary: [bool; MAX_AXES],
    count: usize,
    pub mask: u32,
}

impl Letters {
    pub fn new(axes: &Axes) -> Self {
        let mut this = Self {
            names: [0; MAX_AXES],
            rotary: [false; MAX_AXES],
            count: axes.count(),
            mask: 0,
        };
        for axis in 0..axes.count() {
            this.names[axis] = axes.letter(axis) as u8;
            this.rotary[axis] = axes.is_rotary(axis);
            this.mask |= bit(this.names[axis]);
        }
        this
    }

    pub fn count(&self) -> usize {
        self.count
    }

    /// The letters of the axes in their order.
    #[inline]
    pub fn each(&self) -> &[u8] {
        &self.names[..self.count]
    }

    #[inline]
    pub fn letter(&self, axis: usize) -> u8 {
        self.names[axis]
    }

    #[inline]
    pub fn is_rotary(&self, axis: usize) -> bool {
        self.rotary[axis]
    }

    /// The axis called `letter`.
    pub fn axis(&self, letter: u8) -> Option<usize> {
        self.names[..self.count].iter().position(|l| *l == letter)
    }

    /// The axes that are called as the bits of `mask` say, as a mask over axis indices.
    pub fn axes_of(&self, mask: u32) -> u32 {
        let bit = |axis: usize| mask >> index(self.names[axis]) & 1;
        (0..self.count).map(|axis| bit(axis) << axis).sum()
    }

    /// The letters for messages: `X Y Z`.
    pub fn list(&self) -> String {
        let letters: Vec<_> = self.names[..self.count]
            .iter()
            .map(|l| (*l as char).to_string())
            .collect();
        letters.join(" ")
    }
}
