//! The files of a release under construction, in little memory: a release may have a million of them.

use sastrugi_schemas::manifest::{Artifact, Manifest, Origin};
use serde::ser::{Serialize, SerializeStruct, Serializer};
use std::sync::Arc;

/// A file of a release under construction. Files of one item share their origin.
#[derive(Clone, Debug)]
pub struct Listed {
    path: Arc<str>,
    bytes: u64,
    sha256: Box<str>,
    content_sha256: Option<Box<str>>,
    records: Option<u64>,
    origin: Arc<Origin>,
}

impl Listed {
    /// The entry of a file, which shares the origin of the file listed before it if both have the same.
    pub(super) fn new(path: Arc<str>, bytes: u64, sha256: &str, mut origin: Origin, before: Option<&Self>) -> Self {
        let content_sha256 = origin.content_sha256.take().map(String::into_boxed_str);
        let records = origin.records.take();
        let origin = match before {
            Some(before) if *before.origin == origin => Arc::clone(&before.origin),
            _ => Arc::new(origin),
        };
        Self { path, bytes, sha256: sha256.into(), content_sha256, records, origin }
    }

    /// Path in the release.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Size, bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// SHA-256 of the file, hexadecimal.
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// Its origin, without the hash of its content and its number of records.
    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// Its entry in the manifest.
    fn artifact(&self) -> Artifact {
        let content_sha256 = self.content_sha256.as_deref().map(str::to_owned);
        let origin = Origin { content_sha256, records: self.records, ..Origin::clone(&self.origin) };
        Artifact { path: self.path().to_owned(), bytes: self.bytes, sha256: self.sha256().to_owned(), origin }
    }
}

/// A manifest and the files that it lists, serialised one by one.
pub(super) struct Listing<'a> {
    /// The manifest without files.
    pub manifest: &'a Manifest,
    /// The files, sorted by path.
    pub files: &'a [Listed],
}

impl Serialize for Listing<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // Field by field, as the manifest serialises itself: a copy of it would double the memory of notes and failed items.
        let Manifest {
            program,
            version,
            format,
            name,
            study_sha256,
            seed,
            license,
            artifacts: _,
            sources,
            failed,
            notes,
        } = self.manifest;
        let mut fields = serializer.serialize_struct("Manifest", 11)?;
        fields.serialize_field("program", program)?;
        fields.serialize_field("version", version)?;
        fields.serialize_field("format", format)?;
        fields.serialize_field("name", name)?;
        fields.serialize_field("study_sha256", study_sha256)?;
        fields.serialize_field("seed", seed)?;
        fields.serialize_field("license", license)?;
        fields.serialize_field("artifacts", &Files(self.files))?;
        fields.serialize_field("sources", sources)?;
        fields.serialize_field("failed", failed)?;
        fields.serialize_field("notes", notes)?;
        fields.end()
    }
}

/// The list of files of a manifest.
struct Files<'a>(&'a [Listed]);

impl Serialize for Files<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(Listed::artifact))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_schemas::manifest::{FORMAT, FailedItem, ItemNote, JsonText, PROGRAM, Source};
    use serde_json::json;

    fn manifest(artifacts: Vec<Artifact>) -> Manifest {
        let [stage, item, text] = ["terrain", "a", "\"artifacts\": []"].map(str::to_owned);
        Manifest {
            program: PROGRAM.to_owned(),
            version: "0.1.0".to_owned(),
            format: FORMAT,
            name: "demo".to_owned(),
            study_sha256: "ab".repeat(32),
            seed: u64::MAX,
            license: text.clone(),
            artifacts,
            sources: vec![Source { id: "dem".to_owned(), citation: Some(text.clone()), ..Source::default() }],
            failed: vec![FailedItem {
                stage: stage.clone(),
                item: item.clone(),
                error: text.clone(),
                parameters: Some(JsonText::from(&json!({ "b": 0.1, "a": null }))),
            }],
            notes: vec![ItemNote { stage, item, note: text }],
        }
    }

    /// The same text as that of a manifest which holds its files, with and without files.
    #[test]
    fn prop_a_listing_reads_as_its_manifest() {
        let of_item = |item: &str, records: Option<u64>| Origin {
            stage: "traverse".to_owned(),
            item: item.to_owned(),
            content_sha256: records.map(|n| format!("{n:064x}")),
            records,
            parents: vec!["terrain/a".to_owned(), "missions/m".to_owned()],
            stream: records.map(|_| "item/7/traverse".to_owned()),
            sources: vec!["dem".to_owned()],
        };
        let origins = [
            of_item("a", Some(3)),
            of_item("a", Some(4)),
            of_item("a", None),
            of_item("b", Some(3)),
            Origin::default(),
        ];
        for count in 0..=origins.len() {
            let artifact = |(n, origin): (usize, &Origin)| Artifact {
                path: format!("mcap/{n}"),
                bytes: n as u64,
                sha256: format!("{n:064x}"),
                origin: origin.clone(),
            };
            let artifacts: Vec<Artifact> = origins[..count].iter().enumerate().map(artifact).collect();
            let mut files: Vec<Listed> = Vec::new();
            for Artifact { path, bytes, sha256, origin } in artifacts.clone() {
                files.push(Listed::new(path.as_str().into(), bytes, &sha256, origin, files.last()));
            }
            let listing = Listing { manifest: &manifest(Vec::new()), files: &files };
            let whole = manifest(artifacts);
            assert_eq!(serde_json::to_string_pretty(&listing).unwrap(), serde_json::to_string_pretty(&whole).unwrap());
            let shared = |a: usize, b: usize| Arc::ptr_eq(&files[a].origin, &files[b].origin);
            assert!(count < origins.len() || (shared(0, 1) && !shared(1, 2) && !shared(0, 3)));
        }
    }
}
