//! `manifest.json` of a release: origin and hashes of each file. No clock times.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;
use std::fmt;
use std::sync::Arc;

/// Version of the manifest's format.
pub const FORMAT: u32 = 1;
/// Name of the program in [`Manifest::program`].
pub const PROGRAM: &str = "sastrugi";

/// The manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Always [`PROGRAM`].
    pub program: String,
    /// Version of the program that made the release.
    pub version: String,
    /// Version of the manifest's format, [`FORMAT`].
    pub format: u32,
    /// Name of the study.
    pub name: String,
    /// SHA-256 of the study as run.
    pub study_sha256: String,
    /// Seed of the study.
    pub seed: u64,
    /// Licence of the release, SPDX.
    pub license: String,
    /// All files of the release except this one and SHA256SUMS, by path.
    pub artifacts: Vec<Artifact>,
    /// Measured data that files are derived from, in the study's order.
    #[serde(default)]
    pub sources: Vec<Source>,
    /// Items that failed, by stage and item.
    pub failed: Vec<FailedItem>,
    /// Notes on items, in order of the items.
    #[serde(default)]
    pub notes: Vec<ItemNote>,
}

/// One file of a release.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Artifact {
    /// Path in the release, `/` between folders.
    pub path: String,
    /// Size, bytes.
    pub bytes: u64,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Its origin.
    #[serde(flatten)]
    pub origin: Origin,
}

/// Origin of a file, and hash of its decoded content.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Origin {
    /// Stage that produced it; empty for documents of the release itself.
    pub stage: String,
    /// Item of that stage.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub item: String,
    /// SHA-256 of the decoded content (heights, rows, messages).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub content_sha256: Option<String>,
    /// Number of rows or messages.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub records: Option<u64>,
    /// Parent items, such as `terrain/t-0001`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parents: Vec<String>,
    /// Label of its random streams, words joined by `/`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stream: Option<String>,
    /// Ids of the measured data it is derived from, directly or through its parents.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<String>,
}

/// Measured data, with terms that extend to everything derived from it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Id of the DEM in the study.
    pub id: String,
    /// Licence, as stated in the study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub license: Option<String>,
    /// Attribution: whom to credit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attribution: Option<String>,
    /// How to cite it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub citation: Option<String>,
}

/// A note on an item, one sentence: a conversion, a rounded size, the verdict on a fit.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ItemNote {
    /// Stage.
    pub stage: String,
    /// Item of that stage.
    pub item: String,
    /// The sentence.
    pub note: String,
}

/// An item that failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailedItem {
    /// Stage.
    pub stage: String,
    /// Item of that stage.
    pub item: String,
    /// The error.
    pub error: String,
    /// Parameters of the item; `None` if it was skipped because another failed, which `error` names.
    pub parameters: Option<JsonText>,
}

/// A JSON value, stored as its text. A study may have very many failed items, and a parsed value takes several times the memory. Copies share
/// the text.
#[derive(Clone, PartialEq, Eq)]
pub struct JsonText(Arc<str>);

impl JsonText {
    /// A value from its text, which must be JSON: otherwise it cannot be serialised.
    pub fn of_text(text: String) -> Self {
        Self(text.into())
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl From<&Value> for JsonText {
    fn from(value: &Value) -> Self {
        Self::of_text(value.to_string())
    }
}

impl fmt::Display for JsonText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl fmt::Debug for JsonText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Serialised as the value, not as a string.
impl Serialize for JsonText {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let value: Value = serde_json::from_str(&self.0).map_err(serde::ser::Error::custom)?;
        value.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for JsonText {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Value::deserialize(deserializer).map(|value| Self::from(&value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn manifest() -> Manifest {
        Manifest {
            program: PROGRAM.to_owned(),
            version: "0.1.0".to_owned(),
            format: FORMAT,
            name: "x".to_owned(),
            study_sha256: "0".to_owned(),
            seed: u64::MAX,
            license: "CC-BY-4.0".to_owned(),
            artifacts: vec![Artifact {
                path: "README.md".to_owned(),
                bytes: 5,
                sha256: "1".to_owned(),
                origin: Origin::default(),
            }],
            sources: Vec::new(),
            failed: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// What is written is read; the origin of a document is its stage alone, and lies beside its hash.
    #[test]
    fn val_a_manifest_is_written_and_read() {
        let written = serde_json::to_value(manifest()).unwrap();
        let readme = serde_json::json!({ "path": "README.md", "bytes": 5, "sha256": "1", "stage": "" });
        assert_eq!(written["artifacts"][0], readme);
        assert_eq!(written["seed"], u64::MAX);
        assert_eq!(serde_json::from_value::<Manifest>(written).unwrap(), manifest());
    }

    /// Parameters are written as a JSON value, not as text, and read back; a skipped item has none. Text that is not JSON is refused.
    #[test]
    fn val_parameters_of_failed_items() {
        let value = serde_json::json!({ "b": 0.1, "a": [null, "x"], "n": u64::MAX });
        let failed =
            |parameters| FailedItem { stage: "s".to_owned(), item: "i".to_owned(), error: "no".to_owned(), parameters };
        let own = failed(Some(JsonText::from(&value)));
        let written = serde_json::to_value(&own).unwrap();
        assert_eq!(written["parameters"], value);
        assert_eq!(serde_json::from_value::<FailedItem>(written).unwrap(), own);
        let skipped = serde_json::to_string(&failed(None)).unwrap();
        assert!(skipped.ends_with(r#""parameters":null}"#), "{skipped}");
        assert_eq!(serde_json::from_str::<FailedItem>(&skipped).unwrap(), failed(None));
        assert!(serde_json::to_value(failed(Some(JsonText::of_text("{".to_owned())))).is_err());
    }

    /// Manifests without sources and notes, of earlier versions, are read; unknown keys are not passed over.
    #[test]
    fn val_manifests_of_other_versions() {
        let mut written = serde_json::to_value(manifest()).unwrap();
        for key in ["sources", "notes"] {
            written.as_object_mut().unwrap().remove(key);
        }
        assert_eq!(serde_json::from_value::<Manifest>(written.clone()).unwrap(), manifest());
        written["clock"] = "now".into();
        let error = serde_json::from_value::<Manifest>(written).unwrap_err().to_string();
        assert!(error.contains("unknown field `clock`"), "{error}");
    }
}
