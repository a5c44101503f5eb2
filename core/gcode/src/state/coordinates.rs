//! The offsets between program and machine coordinates.

use tandem_sdk::AxisVector;

use crate::persistent::PersistentData;

/// Number of work coordinate systems, G54 to G59.3.
pub(crate) const SYSTEMS: usize = 9;

/// Coordinate systems, G92 and the tool length; all vectors in mm or rad. A point goes from program to machine coordinates
/// by the offset of G92, the rotation, the origin of the system and the tool, as in LinuxCNC.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Coordinates {
    origins: [AxisVector; SYSTEMS],
    /// Rotation of each system about its origin, from X to Y, rad.
    rotations: [f64; SYSTEMS],
    /// Cosine and sine of the rotation in force; `None` where there is none.
    turn: Option<[f64; 2]>,
    /// The axes X and Y, which rotate.
    plane: Option<[usize; 2]>,
    active: usize,
    g92: AxisVector,
    /// G92 is in force, whatever it is: neither cleared nor suspended.
    g92_applies: bool,
    /// What G92.3 restores.
    g92_stored: AxisVector,
    tool: AxisVector,
    /// The origin of the program in machine coordinates.
    total: AxisVector,
    /// Bit per axis whose offset follows from what the first pass has assumed.
    pub assumed: u32,
    /// Stored positions of G28 and G30, machine coordinates.
    pub reference: [AxisVector; 2],
}

impl Coordinates {
    pub fn new(reference: [AxisVector; 2], plane: Option<[usize; 2]>) -> Self {
        let zero = AxisVector::ZERO;
        Self {
            origins: [zero; SYSTEMS],
            rotations: [0.0; SYSTEMS],
            turn: None,
            plane,
            active: 0,
            g92: zero,
            g92_applies: false,
            g92_stored: zero,
            tool: zero,
            total: zero,
            assumed: 0,
            reference,
        }
    }

    /// The origin of the program in machine coordinates. Where no rotation is, it is the sum of the offsets, and the way from
    /// program to machine coordinates.
    #[inline]
    pub fn total(&self) -> &AxisVector {
        &self.total
    }

    /// A point of program coordinates in machine coordinates, mm or rad.
    pub fn to_machine(&self, program: &AxisVector) -> AxisVector {
        self.turned(&(*program + self.g92), 1.0) + self.origins[self.active] + self.tool
    }

    /// A point of machine coordinates in program coordinates, mm or rad.
    pub fn to_program(&self, machine: &AxisVector) -> AxisVector {
        self.turned(&(*machine - self.tool - self.origins[self.active]), -1.0) - self.g92
    }

    /// Whether the coordinate system in force is rotated.
    #[inline]
    pub fn is_rotated(&self) -> bool {
        self.turn.is_some()
    }

    /// A direction of program coordinates in machine coordinates.
    pub fn direction(&self, program: &AxisVector) -> AxisVector {
        self.turned(program, 1.0)
    }

    /// A vector turned by the rotation in force, or back.
    fn turned(&self, vector: &AxisVector, way: f64) -> AxisVector {
        let mut turned = *vector;
        if let (Some([cos, sin]), Some([x, y])) = (self.turn, self.plane) {
            turned[x] = vector[x] * cos - vector[y] * sin * way;
            turned[y] = vector[x] * sin * way + vector[y] * cos;
        }
        turned
    }

    /// The axes X and Y, where both are there and linear.
    pub fn plane(&self) -> Option<[usize; 2]> {
        self.plane
    }

    /// Whether the machine has what rotates.
    pub fn can_rotate(&self) -> bool {
        self.plane.is_some()
    }

    /// A point of machine coordinates in program coordinates without the length of a tool: in the system in force, or in
    /// that of G59.3, which then has no offset of G92.
    pub fn without_tool(&self, machine: &AxisVector, fixture: bool) -> AxisVector {
        let zero = AxisVector::ZERO;
        let base = Self {
            tool: zero,
            ..self.clone()
        };
        let base = if fixture {
            Self {
                active: SYSTEMS - 1,
                g92: zero,
                ..base
            }
        } else {
            base
        };
        base.summed_up().to_program(machine)
    }

    /// Rotation of a coordinate system, rad.
    pub fn rotation(&self, system: usize) -> f64 {
        self.rotations[system]
    }

    pub fn set_rotation(&mut self, system: usize, rotation: f64) {
        self.rotations[system] = rotation;
        self.sum_up();
    }

    /// Moves the origin of `system` so that the point `machine`, which has certain coordinates there, gets others: those of
    /// `wanted`, which are given for the axes where it is a number.
    pub fn shift_origin(&mut self, system: usize, machine: &AxisVector, wanted: &[Option<f64>]) {
        let other = Self {
            active: system,
            ..self.clone()
        }
        .summed_up();
        let current = other.to_program(machine);
        let mut shift = AxisVector::ZERO;
        for (axis, value) in wanted.iter().enumerate() {
            shift[axis] = value.map_or(0.0, |value| current[axis] - value);
        }
        self.set_origin(system, self.origins[system] + other.direction(&shift));
    }

    fn summed_up(mut self) -> Self {
        self.sum_up();
        self
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
        self.g92_applies = true;
        self.sum_up();
    }

    /// Whether G92 is in force, whatever it is.
    pub fn g92_applies(&self) -> bool {
        self.g92_applies
    }

    /// G92.1
    pub fn clear_g92(&mut self) {
        self.set_g92(AxisVector::ZERO);
        self.g92_applies = false;
    }

    /// G92.2
    pub fn suspend_g92(&mut self) {
        self.g92 = AxisVector::ZERO;
        self.g92_applies = false;
        self.sum_up();
    }

    /// G92.3
    pub fn restore_g92(&mut self) {
        self.g92 = self.g92_stored;
        self.g92_applies = true;
        self.sum_up();
    }

    pub fn set_tool(&mut self, offset: AxisVector) {
        self.tool = offset;
        self.sum_up();
    }

    /// Says what lasts of them.
    pub fn tell(&self, persistent: &mut PersistentData) {
        persistent.origins = self.origins;
        persistent.rotations_rad = self.rotations;
        persistent.active_system = self.active;
        (persistent.g92, persistent.g92_stored) = (self.g92, self.g92_stored);
        persistent.reference = self.reference;
        persistent.tool_offset = self.tool;
    }

    /// Takes what has lasted.
    pub fn hear(&mut self, persistent: &PersistentData) {
        self.origins = persistent.origins;
        self.rotations = persistent.rotations_rad;
        self.active = persistent.active_system.min(SYSTEMS - 1);
        (self.g92, self.g92_stored) = (persistent.g92, persistent.g92_stored);
        self.g92_applies = self.g92 != AxisVector::ZERO;
        self.reference = persistent.reference;
        self.tool = persistent.tool_offset;
        self.sum_up();
    }

    fn sum_up(&mut self) {
        let rotation = self.rotations[self.active];
        self.turn = (rotation != 0.0).then(|| [rotation.cos(), rotation.sin()]);
        self.total = self.to_machine(&AxisVector::ZERO);
    }
}
