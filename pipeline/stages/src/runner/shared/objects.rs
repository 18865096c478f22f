//! A shared cache in a bucket of an object store: `s3://bucket/prefix`.
//!
//! The objects of an entry are `entries/ab/ab12.../<file>`. There is no rename, so the record is written last, and only if there is none: an
//! entry exists when its record does. It disappears with its record, which is removed first. Concurrent writers write the same bytes; a
//! reader that runs into a removal finds a file missing and computes the item. A removal leaves files that are newer than the record, because
//! another run is uploading them to publish the item again. A file that is uploaded after they were listed may still be removed. Its entry is
//! then damaged, and the next reader publishes it again. Entries age from their publication.

use super::{DRAFT_AGE_MAX, Entry, Shared, is_entry};
use crate::error::Error;
use crate::runner::cache::{RECORD, Record, is_unchanged};
use crate::runner::damage::Changed;
use sastrugi_store::objects::{Bucket, Object};
use sastrugi_store::release::MANIFEST;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::SystemTime;

/// A shared cache in a bucket.
#[derive(Debug)]
pub struct Objects {
    bucket: Arc<Bucket>,
    is_read_only: bool,
}

impl Objects {
    /// Opens the cache in a bucket.
    ///
    /// # Errors
    /// A release has this address, or the bucket cannot be read.
    pub fn open(bucket: Bucket, is_read_only: bool) -> Result<Self, Error> {
        if bucket.contains(MANIFEST)? {
            let advice = "is a release, which cannot hold a cache; choose another prefix for the cache";
            return Err(Error::Usage(format!("{} {advice}", bucket.address())));
        }
        Ok(Self::new(Arc::new(bucket), is_read_only))
    }

    /// The cache in a bucket.
    pub fn new(bucket: Arc<Bucket>, is_read_only: bool) -> Self {
        Self { bucket, is_read_only }
    }
}

impl Shared for Objects {
    fn read(&self, name: &str, file: &str, to: &mut dyn Write) -> Result<bool, Error> {
        Ok(self.bucket.read(&format!("{name}/{file}"), to)?)
    }

    fn publish(&self, name: &str, record: &Record, folder: &Path) -> Result<bool, Error> {
        let own = format!("{name}/{RECORD}");
        if self.bucket.contains(&own)? {
            return Ok(false);
        }
        let changed = Changed::default();
        is_unchanged(record, folder, &changed)?;
        changed.remove()?;
        for stored in &record.files {
            let file = &stored.product.file;
            // What a killed run left under this name is replaced.
            self.bucket.replace_from(&format!("{name}/{file}"), &folder.join(file))?;
        }
        Ok(self.bucket.create_from(&own, &folder.join(RECORD))?)
    }

    fn remove(&self, name: &str) -> Result<(), Error> {
        let objects = self.bucket.list(name)?;
        let own = format!("{name}/{RECORD}");
        let (record, files): (Vec<&Object>, Vec<&Object>) = objects.iter().partition(|object| object.name == own);
        // Without a record, only what a killed run left is removed.
        let until = match record.first() {
            Some(record) => record.modified,
            None => SystemTime::now() - DRAFT_AGE_MAX,
        };
        let old = files.into_iter().filter(|file| file.modified <= until);
        record.into_iter().chain(old).try_for_each(|object| Ok(self.bucket.remove(&object.name)?))
    }

    fn list(&self) -> Result<Vec<Entry>, Error> {
        let mut entries: BTreeMap<String, Entry> = BTreeMap::new();
        for Object { name, bytes, modified } in self.bucket.list(super::ENTRIES)? {
            let Some((name, file)) = name.rsplit_once('/').filter(|(name, _)| is_entry(name)) else { continue };
            let new = Entry { name: name.to_owned(), bytes: 0, used: modified, is_complete: false };
            let entry = entries.entry(name.to_owned()).or_insert(new);
            entry.bytes += bytes;
            entry.used = entry.used.max(modified);
            entry.is_complete |= file == RECORD;
        }
        Ok(entries.into_values().collect())
    }

    fn is_read_only(&self) -> bool {
        self.is_read_only
    }
}
