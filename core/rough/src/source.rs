//! Where items come from.

use tandem_gcode::{Item, Stream};

/// A stream of program items, pulled on demand.
pub trait Source {
    /// Appends the next items; `false` where the program is over.
    ///
    /// # Errors
    /// What is wrong with the program, with its place.
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String>;

    /// Answers an [`Item::Wait`]: 1, 0, or −1 for none in time.
    fn provide_input(&mut self, value: f64);
}

impl Source for Stream {
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        Stream::next_items(self, items).map_err(|e| e.to_string())
    }

    fn provide_input(&mut self, value: f64) {
        Stream::provide_input(self, value);
    }
}
