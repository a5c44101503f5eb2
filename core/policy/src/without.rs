//! The engine of a build without policy scripts: it refuses to be made, so nothing that it would give ever exists.

use std::convert::Infallible;

use crate::bounds::Asks;
use crate::budget::Budget;
use crate::error::{Refusal, Trouble};
use crate::geometry::Geometry;
use crate::inputs::{Input, Places};
use crate::parameters::Parameter;
use crate::window::{Record, Sight};

/// A compiler of policy scripts, which this build does not have.
#[derive(Clone)]
pub struct Engine(Infallible);

impl Engine {
    /// There is none.
    ///
    /// # Errors
    /// Always.
    pub fn new() -> Result<Self, Refusal> {
        Err(Refusal::NoScripts)
    }

    /// Compiles nothing.
    ///
    /// # Errors
    /// None: there is no engine that could be called.
    pub fn compile(&self, _bytes: &[u8]) -> Result<Script, Refusal> {
        match self.0 {}
    }
}

/// A compiled policy script, of which there is none.
#[derive(Clone)]
pub struct Script {
    none: Infallible,
    /// The version of the ABI that it speaks.
    pub version: u32,
    /// Whether it tunes blocks.
    pub tunes_blocks: bool,
    /// Whether it answers rough periods.
    pub answers_periods: bool,
    /// Whether it hands over state at a reload.
    pub keeps_state: bool,
}

impl Script {
    /// Whether two scripts are the same compilation.
    pub fn is_same(&self, _other: &Self) -> bool {
        match self.none {}
    }
}

/// A live script, of which there is none.
pub struct Instance {
    none: Infallible,
    /// Fuel that the last call used.
    pub fuel_used: u64,
}

impl Instance {
    /// Starts nothing.
    ///
    /// # Errors
    /// None: there is no script that could be given.
    pub fn new(
        script: &Script,
        _budget: &Budget,
        _stated: &[(String, f64)],
    ) -> Result<Self, Refusal> {
        match script.none {}
    }

    /// The parameters that the script declares.
    pub fn parameters(&self) -> &[Parameter] {
        match self.none {}
    }

    /// What the script wants to see.
    pub fn inputs(&self) -> &[Input] {
        match self.none {}
    }

    /// Tells the script where its inputs are.
    pub fn place(&mut self, _places: &Places) {
        match self.none {}
    }

    /// Whether it looks at the geometry of blocks.
    pub fn sees_geometry(&self) -> bool {
        match self.none {}
    }

    /// Pages of memory in use.
    pub fn memory_pages(&self) -> u64 {
        match self.none {}
    }

    /// Hands over a window of blocks.
    ///
    /// # Errors
    /// None: there is no instance that could be called, as in all that follow.
    pub fn blocks(
        &mut self,
        _records: &[Record],
        _sights: &[Sight],
        _geometries: &[Geometry],
        _asks: &mut Vec<Asks>,
    ) -> Result<(), Trouble> {
        match self.none {}
    }

    /// Hands over the means of a rough period.
    ///
    /// # Errors
    /// None.
    pub fn period(&mut self, _record: &[u8]) -> Result<f64, Trouble> {
        match self.none {}
    }

    /// What must survive a reload.
    ///
    /// # Errors
    /// None.
    pub fn save(&mut self) -> Result<Vec<u8>, Trouble> {
        match self.none {}
    }

    /// Hands over what another instance saved.
    ///
    /// # Errors
    /// None.
    pub fn restore(&mut self, _state: &[u8]) -> Result<(), Trouble> {
        match self.none {}
    }
}

#[cfg(test)]
mod tests {
    use super::Engine;

    #[test]
    fn every_script_is_refused_in_words() {
        let refusal = Engine::new().err().map(|refusal| refusal.to_string());
        assert_eq!(
            refusal.as_deref(),
            Some("this tandem was built without policy scripts: build it with the feature scripts")
        );
    }
}
