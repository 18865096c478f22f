//! `cache`.

use super::serve;
use crate::Verdict;
use crate::args::{Cache, Common};
use crate::failure::{Code, Failure};
use crate::output::{bytes, print};
use sastrugi_schemas::counted;
use sastrugi_stages::runner::shared::{self, Keep, Pruned, prune};
use std::time::{Duration, SystemTime};

/// Seconds of a day.
const DAY_S: f64 = 86_400.0;

/// `cache`.
pub fn cache(args: &Cache, common: &Common) -> Verdict {
    let keep = Keep {
        bytes: args.max_bytes.as_deref().map(|text| serve::bytes("--max-bytes", text)).transpose()?,
        age: args.max_age.map(age).transpose()?,
    };
    // A cache that is only looked at is not created.
    let place = shared::open(&args.place, keep == Keep::default())?;
    let pruned = prune(&*place, keep, SystemTime::now())?;
    print(common.json, &serde_json::to_value(&pruned).map_err(Failure::failed)?, &described(&args.place, &pruned))?;
    Ok(Code::Done)
}

fn age(days: f64) -> Result<Duration, Failure> {
    let refused = || Failure::usage(format!("`--max-age {days}`: must be a number of days, 0 or more"));
    Duration::try_from_secs_f64(days * DAY_S).map_err(|_| refused())
}

fn described(place: &str, pruned: &Pruned) -> String {
    let Pruned { entries, bytes: size, unused_days, drafts, removed, removed_bytes } = pruned;
    let mut text = format!("{place}: {}, {}", counted(entries, "entry"), bytes(*size as f64));
    if let Some(days) = unused_days {
        text.push_str(&format!(", the least recently used {days:.1} days ago"));
    }
    if *drafts > 0 {
        text.push_str(&format!("; {}", counted(drafts, "draft")));
    }
    if *removed > 0 {
        text.push_str(&format!("; removed {removed}, {}", bytes(*removed_bytes as f64)));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_ages_are_days() {
        assert_eq!(age(1.5).ok(), Some(Duration::from_secs(129_600)));
        assert_eq!(age(0.0).ok(), Some(Duration::ZERO));
        for days in [-1.0, f64::NAN, f64::INFINITY, 1e30] {
            assert!(age(days).is_err_and(|failure| failure.0.to_string().contains("must be a number of days")));
        }
    }

    #[test]
    fn val_a_cache_is_described() {
        let full = Pruned {
            entries: 3,
            bytes: 2_000_000,
            unused_days: Some(1.5),
            drafts: 1,
            removed: 2,
            removed_bytes: 5_000,
        };
        let expected = "c: 3 entries, 2.0 MB, the least recently used 1.5 days ago; 1 draft; removed 2, 5.0 kB";
        assert_eq!(described("c", &full), expected);
        assert_eq!(described("c", &Pruned::default()), "c: 0 entries, 0 bytes");
    }
}
