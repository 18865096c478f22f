//! `manifest.json` of a release: what each file is, where it came from, and what it hashes to. No clock times.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Version of the manifest's form.
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
    /// Version of the manifest's form, [`FORMAT`].
    pub format: u32,
    /// Name of the study.
    pub name: String,
    /// SHA-256 of the study as it was run.
    pub study_sha256: String,
    /// Seed of the study.
    pub seed: u64,
    /// Licence of the release, SPDX.
    pub license: String,
    /// Every file of the release but this one and SHA256SUMS, by path.
    pub artifacts: Vec<Artifact>,
    /// Measured data that files come from, in the study's order.
    #[serde(default)]
    pub sources: Vec<Source>,
    /// Items that failed, by stage and item.
    pub failed: Vec<FailedItem>,
    /// Sentences that readers of an item's files must know, in order of the items.
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
    /// Where it came from.
    #[serde(flatten)]
    pub origin: Origin,
}

/// Where a file came from, and what it holds when decoded.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Origin {
    /// Stage that made it; empty for documents of the release itself.
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
    /// Items that it was made from, as `terrain/t-0001`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parents: Vec<String>,
    /// Words of its random streams, joined by `/`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stream: Option<String>,
    /// Ids of the measured data it comes from, itself or through its parents.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<String>,
}

/// Measured data: what its maker asks of everything that comes from it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Id of the DEM in the study.
    pub id: String,
    /// Licence, as the study states it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub license: Option<String>,
    /// Whom to name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attribution: Option<String>,
    /// How to cite it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub citation: Option<String>,
}

/// A sentence about an item: a conversion, a rounded size, the verdict on a fit.
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
    /// What went wrong.
    pub error: String,
    /// Parameters of the item.
    pub parameters: Value,
}
