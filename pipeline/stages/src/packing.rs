//! Packs a release into one archive with reproducible bytes.

use crate::error::Error;
use crate::remote::check_file;
use crate::runner::progress::Progress;
use crate::studies::{check_outside, head_of};
use crate::verification::{Difference, checked, differences};
use sastrugi_store::release::{self, Packed, Release};
use serde::Serialize;
use std::cell::Cell;
use std::path::{Path, PathBuf};

/// Result of packing.
#[derive(Debug, Serialize)]
pub struct Packing {
    /// The archive.
    pub output: PathBuf,
    /// Files in it.
    pub files: u64,
    /// Its length, bytes.
    pub bytes: u64,
    /// SHA-256 of its bytes; absent if the release is damaged and no archive was written.
    pub sha256: Option<String>,
    /// Damage to the release.
    pub differences: Vec<Difference>,
}

/// Checks a release and writes it to the archive `output`. A damaged release is not packed; its differences are listed.
///
/// # Errors
/// A folder that is not a release; an output inside it or that is a folder; failures of the machine.
pub fn pack(folder: &Path, output: &Path, progress: &dyn Progress) -> Result<Packing, Error> {
    check_output(folder, output)?;
    let report = checked(folder, progress)?;
    let mut packing =
        Packing { output: output.to_owned(), files: 0, bytes: 0, sha256: None, differences: differences(&report) };
    if !packing.differences.is_empty() {
        return Ok(packing);
    }
    let release = Release::open(folder)?;
    let time_s = unix_seconds(&head_of(folder)?.date);
    progress.phase(&format!("packing {} files", release.manifest().artifacts.len() + 2));
    let done = Cell::new(0);
    progress.copied(0, report.bytes);
    let added = |_: &str, bytes: u64| {
        // The checksum list is not among the bytes that were checked.
        done.set((done.get() + bytes).min(report.bytes));
        progress.copied(done.get(), report.bytes);
    };
    let Packed { files, bytes, sha256 } = release::pack(&release, output, time_s, &added)?;
    (packing.files, packing.bytes, packing.sha256) = (files, bytes, Some(sha256));
    Ok(packing)
}

fn check_output(folder: &Path, output: &Path) -> Result<(), Error> {
    check_file(output)?;
    let refusal = "the archive cannot be written into the release, which is sealed; choose a file outside it with -o";
    check_outside(folder, output, refusal)?;
    if output.exists() && output.extension().is_none_or(|ending| ending != "tar") {
        let advice = "already exists and is not a .tar; choose another file with -o";
        return Err(Error::Usage(format!("{} {advice}", output.display())));
    }
    Ok(())
}

/// Midnight UTC of a day YYYY-MM-DD, s since 1970-01-01; earlier days count as that day, since archives cannot store them.
fn unix_seconds(date: &str) -> u64 {
    let part =
        |range: std::ops::Range<usize>| date.get(range).and_then(|text| text.parse::<i64>().ok()).unwrap_or_default();
    let (year, month, day) = (part(0..4), part(5..7), part(8..10));
    // With years beginning in March, the leap day comes last; March to December have 306 days.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let days =
        365 * year + year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400) + (153 * month + 2) / 5 + day - 1;
    let days_to_1970 = 719_468;
    u64::try_from(days - days_to_1970).unwrap_or(0) * 86_400
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against `date -u -d DATE +%s` of GNU coreutils.
    #[test]
    fn val_days_as_seconds() {
        let known = [
            ("1970-01-01", 0),
            ("1969-12-31", 0),
            ("2000-02-29", 951_782_400),
            ("2000-03-01", 951_868_800),
            ("2026-11-21", 1_795_219_200),
            ("2100-12-31", 4_133_894_400),
        ];
        for (date, seconds) in known {
            assert_eq!(unix_seconds(date), seconds, "{date}");
        }
    }
}
