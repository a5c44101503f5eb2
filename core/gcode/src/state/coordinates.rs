//! The offsets between program and machine coordinates.

use tandem_sdk::AxisVector;

/// Number of work coordinate systems, G54 to G59.3.
pub(crate) const SYSTEMS: usize = 9;

/// Coordinate systems, G92 and the tool length; all vectors in mm or rad.
#[derive(Clone, Debug)]
pub(crate) struct Coordinates {
    origins: [AxisVector; SYSTEMS],
    active: usize,
    g92: AxisVector,
    /// What G92.3 restores.
    g92_stored: AxisVector,
    tool: AxisVector,
    /// The sum in force.
    total: AxisVector,
    /// Bit per axis whose offset follows from what the first pass has assumed.
    pub assumed: u32,
    /// Stored positions of G28 and G30, machine coordinates.
    pub reference: [AxisVector; 2],
}

impl Coordinates {
    pub fn new(reference: [AxisVector; 2]) -> Self {
        let zero = AxisVector::ZERO;
        Self {
            origins: [zero; SYSTEMS],
            active: 0,
            g92: zero,
            g92_stored: zero,
            tool: zero,
            total: zero,
            assumed: 0,
            reference,
        }
    }

    /// The sum of all offsets in force.
    #[inline]
    pub fn total(&self) -> &AxisVector {
        &self.total
    }

    /// A point of program coordinates in machine coordinates, mm or rad.
    pub fn to_machine(&self, program: &AxisVector) -> AxisVector {
        *program + self.total
    }

    /// A point of machine coordinates in program coordinates, mm or rad.
    pub fn to_program(&self, machine: &AxisVector) -> AxisVector {
        *machine - self.total
    }

    /// Index of the coordinate system in force: 0 for G54.
    pub fn active(&self) -> usize {
        self.active
    }

    pub fn origin(&self, system: usize) -> &AxisVector {
        &self.origins[system]
    }

    pub fn g92(&self) -> &AxisVector {
        &self.g92
    }

    pub fn g92_stored(&self) -> &AxisVector {
        &self.g92_stored
    }

    /// The tool length offset in force.
    pub fn tool(&self) -> &AxisVector {
        &self.tool
    }

    pub fn select(&mut self, system: usize) {
        self.active = system;
        self.sum_up();
    }

    pub fn set_origin(&mut self, system: usize, origin: AxisVector) {
        self.origins[system] = origin;
        self.sum_up();
    }

    pub fn set_g92(&mut self, g92: AxisVector) {
        self.g92 = g92;
        self.g92_stored = g92;
        self.sum_up();
    }

    /// G92.1
    pub fn clear_g92(&mut self) {
        self.set_g92(AxisVector::ZERO);
    }

    /// G92.2
    pub fn suspend_g92(&mut self) {
        self.g92 = AxisVector::ZERO;
        self.sum_up();
    }

    /// G92.3
    pub fn restore_g92(&mut self) {
        self.g92 = self.g92_stored;
        self.sum_up();
    }

    pub fn set_tool(&mut self, offset: AxisVector) {
        self.tool = offset;
        self.sum_up();
    }

    fn sum_up(&mut self) {
        self.total = self.origins[self.active] + self.g92 + self.tool;
    }
}
