//! The built-in plugins, one line each.

use tandem_host::Registry;

/// The driver that stands in for real ones where the machine names nothing: as it comes, its drives are ideal.
pub const IDEAL_DRIVES: &str = "sim";

/// A registry with everything that is linked in.
pub fn registry() -> Result<Registry, String> {
    let mut registry = Registry::default();
    registry.register(tandem_look_ahead::PLUGIN)?;
    registry.register(tandem_after_interpolation::PLUGIN)?;
    registry.register(tandem_block_overlap::PLUGIN)?;
    registry.register(tandem_nurbs::PLUGIN)?;
    registry.register(tandem_smooth::PLUGIN)?;
    registry.register(tandem_force_control::PLUGIN)?;
    registry.register(tandem_corexy::PLUGIN)?;
    registry.register(tandem_wrapped_rotary::PLUGIN)?;
    registry.register(tandem_scara::PLUGIN)?;
    registry.register(tandem_delta::PLUGIN)?;
    registry.register(tandem_sim::PLUGIN)?;
    #[cfg(feature = "ethercat")]
    registry.register(tandem_ethercat::PLUGIN)?;
    Ok(registry)
}
