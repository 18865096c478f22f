//! The documents of a release for people and catalogues: description, citation, licence.
//!
//! Each document is a module here with a function `text`, and an entry in [`all`].

mod citation;
mod croissant;
mod described;
mod license;
mod readme;
mod ro_crate;
pub mod sources;
mod spdx_list;
pub mod terms;
mod viewer_layout;
mod zenodo;

pub use described::{Described, folded, quoted, source_line};
pub use license::license_warning;
pub use readme::hub_license;

/// All documents of a release: path and text.
pub fn all(described: &Described<'_>) -> Vec<(&'static str, String)> {
    let documents = [
        ("README.md", readme::text(described)),
        ("CITATION.cff", citation::text(described)),
        ("LICENSE", license::text(described)),
        ("croissant.json", croissant::text(described)),
        ("ro-crate-metadata.json", ro_crate::text(described)),
        (".zenodo.json", zenodo::text(described)),
    ];
    let layout = viewer_layout::text(described).map(|text| ("mcap/foxglove-layout.json", text));
    documents.into_iter().chain(layout).collect()
}
