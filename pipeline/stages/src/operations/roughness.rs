//! Converts the section `[roughness]` to settings of the kernel.

use crate::job::JobError;
use sastrugi_roughness::{ClassThresholds, DescribeSettings};
use sastrugi_schemas::study::RoughnessSection;

/// Settings of the kernel.
///
/// # Errors
/// Thresholds that do not increase.
pub fn settings(section: &RoughnessSection) -> Result<DescribeSettings, JobError> {
    let thresholds = ClassThresholds::new(section.low_max, section.semi_max).map_err(JobError::new)?;
    Ok(DescribeSettings {
        thresholds,
        border_m: section.border_m,
        band_window_m: section.band_window_m,
        ..DescribeSettings::default()
    })
}
