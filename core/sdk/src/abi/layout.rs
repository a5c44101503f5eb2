//! What the structures of the contract look like in memory, as numbers that two builds can compare.
//!
//! Rust promises no layout across builds, and another revision of the contract may have the same sizes with other meanings:
//! two fields of one type that change places move every number into the wrong one. So each structure that crosses is folded
//! into a number: its name and size, and the name, place and type of every field. A field is never left out, because the
//! list is taken apart as a pattern without a rest. The numbers are made when the program is compiled.

use crate::Slice;

/// What has a layout that two builds must agree on.
pub trait Layout {
    /// Its name, size, and what is in it, folded.
    const HASH: u64;
}

/// An enumeration that a plugin hands over: as a number, until [`TryFrom`] has looked at it. A Rust `enum` with a foreign number is
/// undefined behaviour.
pub trait Choice: TryFrom<u32, Error = u32> {
    /// How many choices there are.
    const COUNT: u32;
}

/// One structure by its name and its number, as a library hands them to its host.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Structure {
    pub name: Slice<'static, u8>,
    pub hash: u64,
}

impl Structure {
    pub const fn of<T: Layout>(name: &'static str) -> Self {
        Self {
            name: Slice::new(name.as_bytes()),
            hash: T::HASH,
        }
    }
}

/// Where folding begins (FNV-1a).
pub const START: u64 = 0xcbf2_9ce4_8422_2325;

/// Folds one more number.
pub const fn fold(hash: u64, number: u64) -> u64 {
    (hash ^ number).wrapping_mul(0x0100_0000_01b3)
}

/// Folds one more text; spaces are left out, because compilers differ in where they print them.
pub const fn fold_text(mut hash: u64, text: &str) -> u64 {
    let bytes = text.as_bytes();
    let mut index = 0;
    while index < bytes.len() {
        if !bytes[index].is_ascii_whitespace() {
            hash = fold(hash, bytes[index] as u64);
        }
        index += 1;
    }
    // The end of a text, so that two of them are not one.
    fold(hash, 0x1_0000)
}

/// The number of the type of a field, found by inference from a function that gives the field.
pub const fn of_field<S, T: Layout>(_: fn(&S) -> &T) -> u64 {
    T::HASH
}

/// Gives a structure its number. A field that is not listed does not compile.
macro_rules! layout {
    ($name:ident $(<$life:lifetime>)? { $($field:ident),+ $(,)? }) => {
        impl $(<$life>)? $crate::abi::layout::Layout for $name $(<$life>)? {
            const HASH: u64 = {
                use $crate::abi::layout::{START, fold, fold_text, of_field};
                #[allow(dead_code, reason = "it is there to be compiled")]
                fn has_no_other(whole: &$name) {
                    let $name { $($field: _),+ } = whole;
                }
                let mut hash = fold_text(START, stringify!($name));
                hash = fold(fold(hash, size_of::<Self>() as u64), align_of::<Self>() as u64);
                $(
                    hash = fold_text(hash, stringify!($field));
                    hash = fold(hash, std::mem::offset_of!(Self, $field) as u64);
                    hash = fold(hash, of_field(|this: &Self| &this.$field));
                )+
                hash
            };
        }
    };
}

/// Gives an enumeration its number, and makes it of the numbers that cross the border. A variant that is not listed does not compile.
macro_rules! layout_of_enum {
    ($name:ident { $($variant:ident),+ $(,)? }) => {
        impl $crate::abi::layout::Layout for $name {
            const HASH: u64 = {
                use $crate::abi::layout::{START, fold, fold_text};
                #[allow(dead_code, reason = "it is there to be compiled")]
                fn has_no_other(one: $name) {
                    match one {
                        $($name::$variant => {})+
                    }
                }
                let mut hash = fold(fold_text(START, stringify!($name)), size_of::<Self>() as u64);
                $(hash = fold(fold_text(hash, stringify!($variant)), $name::$variant as u64);)+
                hash
            };
        }

        impl TryFrom<u32> for $name {
            /// The number itself: it stands for nothing.
            type Error = u32;

            /// What crosses the border as `number`.
            fn try_from(number: u32) -> Result<Self, u32> {
                $(if number == $name::$variant as u32 {
                    return Ok($name::$variant);
                })+
                Err(number)
            }
        }

        impl $crate::abi::layout::Choice for $name {
            const COUNT: u32 = [$($name::$variant as u32),+].len() as u32;
        }
    };
}

/// Defines a structure of functions and gives it its number: a function's type has no name but its own words.
macro_rules! table {
    ($(#[$meta:meta])* $vis:vis struct $name:ident { $($field:ident: $type:ty),+ $(,)? }) => {
        $(#[$meta])*
        #[repr(C)]
        $vis struct $name {
            $($field: $type),+
        }

        impl $crate::abi::layout::Layout for $name {
            const HASH: u64 = {
                use $crate::abi::layout::{START, fold, fold_text};
                let mut hash = fold_text(START, stringify!($name));
                hash = fold(fold(hash, size_of::<Self>() as u64), align_of::<Self>() as u64);
                $(
                    hash = fold_text(hash, stringify!($field));
                    hash = fold(hash, std::mem::offset_of!(Self, $field) as u64);
                    hash = fold_text(hash, stringify!($type));
                )+
                hash
            };
        }
    };
}

pub(crate) use {layout, layout_of_enum, table};

macro_rules! plain {
    ($($type:ty),+) => {
        $(impl Layout for $type {
            const HASH: u64 = fold(fold_text(START, stringify!($type)), size_of::<$type>() as u64);
        })+
    };
}

plain!(u8, u16, u32, i32, u64, i64, usize, f64, bool);

impl<T: Layout, const N: usize> Layout for [T; N] {
    const HASH: u64 = fold(fold(fold_text(START, "array"), N as u64), T::HASH);
}

impl<T: Layout> Layout for *const T {
    const HASH: u64 = fold(fold_text(START, "pointer"), T::HASH);
}

impl<T: Layout> Layout for Option<&T> {
    const HASH: u64 = fold(fold_text(START, "reference"), T::HASH);
}

/// How a text is freed.
impl Layout for Option<unsafe extern "C" fn(*mut u8, usize, usize)> {
    const HASH: u64 = fold_text(START, "release of a text");
}

#[cfg(test)]
mod tests {
    use super::*;

    mod ours {
        #[allow(dead_code)]
        #[repr(C)]
        pub struct Limits {
            pub low_mm: f64,
            pub high_mm: f64,
        }
        layout!(Limits { low_mm, high_mm });
    }

    mod swapped {
        #[allow(dead_code)]
        #[repr(C)]
        pub struct Limits {
            pub high_mm: f64,
            pub low_mm: f64,
        }
        layout!(Limits { low_mm, high_mm });
    }

    mod retyped {
        #[allow(dead_code)]
        #[repr(C)]
        pub struct Limits {
            pub low_mm: f64,
            pub high_mm: u64,
        }
        layout!(Limits { low_mm, high_mm });
    }

    #[allow(dead_code)]
    #[derive(Clone, Copy)]
    enum Kind {
        One = 1,
        Two = 2,
    }
    layout_of_enum!(Kind { One, Two });

    mod renumbered {
        #[allow(dead_code)]
        #[derive(Clone, Copy)]
        pub enum Kind {
            One = 2,
            Two = 1,
        }
        layout_of_enum!(Kind { One, Two });
    }

    #[test]
    fn fields_that_change_places_or_types_change_the_number_though_the_size_stays() {
        assert_eq!(size_of::<ours::Limits>(), size_of::<swapped::Limits>());
        assert_ne!(ours::Limits::HASH, swapped::Limits::HASH);
        assert_ne!(ours::Limits::HASH, retyped::Limits::HASH);
        assert_ne!(<[ours::Limits; 2]>::HASH, <[swapped::Limits; 2]>::HASH);
        assert_ne!(<[ours::Limits; 2]>::HASH, <[ours::Limits; 3]>::HASH);
        assert_ne!(Kind::HASH, renumbered::Kind::HASH);
        assert_eq!(fold_text(START, "fn(A, B)"), fold_text(START, "fn(A,B)"));
        assert_ne!(
            fold_text(fold_text(START, "a"), "b"),
            fold_text(START, "ab")
        );
    }
}
