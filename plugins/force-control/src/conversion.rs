//! Force at the table and torque at the motor.

use std::f64::consts::TAU;

/// Force per torque, 1/m: 2π·efficiency/lead. An efficiency above 1 is not possible while the motor drives.
pub fn force_per_torque_per_m(lead_mm: f64, efficiency: f64) -> f64 {
    TAU * efficiency / (lead_mm * 1e-3)
}

/// Resultant of the axes' torques as a torque on the screw of the first: equal forces count the same whatever the leads.
/// `torques` are pairs of torque, N·m, and force per torque, 1/m.
pub fn resultant_nm(torques: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (mut first, mut sum) = (None, 0.0);
    for (torque_nm, per_m) in torques {
        first.get_or_insert(per_m);
        let force_n = torque_nm * per_m;
        sum += force_n * force_n;
    }
    first.map_or(0.0, |per_m| sum.sqrt() / per_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_forces_count_the_same() {
        let coarse = force_per_torque_per_m(20.0, 1.0);
        let fine = force_per_torque_per_m(10.0, 1.0);
        assert!((resultant_nm([(0.3, coarse), (0.4, coarse)].into_iter()) - 0.5).abs() < 1e-15);
        let force_n = 100.0;
        let both = resultant_nm([(force_n / coarse, coarse), (force_n / fine, fine)].into_iter());
        assert!((both * coarse - force_n * 2f64.sqrt()).abs() < 1e-9);
        assert_eq!(resultant_nm(std::iter::empty()), 0.0);
    }
}
