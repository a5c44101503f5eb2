//! Any bytes as a model file and as measurements: a model that is read is one that can be written and read again, and
//! measurements that are read are times of polygons.

use tandem_estimate::{measurements, model_file};

/// Judges one input.
///
/// # Panics
/// The reader broke what it promises.
pub fn judge(bytes: &[u8]) {
    match measurements::parse("times.csv", bytes) {
        Ok(timed) => {
            assert!(
                timed.len() >= 6
                    && timed
                        .iter()
                        .all(|timed| timed.time_s > 0.0 && timed.time_s.is_finite())
            );
        }
        Err(cause) => assert!(cause.starts_with("times.csv:"), "{cause}"),
    }
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    match model_file::parse("model.toml", text) {
        Ok(model) => {
            let Some(written) = model_file::write(&model, "by nobody") else {
                return;
            };
            let again =
                model_file::parse("written", &written).unwrap_or_else(|e| panic!("{e}\n{written}"));
            assert_eq!(model_file::write(&again, "by nobody"), Some(written));
        }
        Err(error) => assert!(error.to_string().starts_with("model.toml"), "{error}"),
    }
}
