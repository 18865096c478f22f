//! `mcap/foxglove-layout.json`: a viewer layout for the recordings.

use super::described::Described;
use sastrugi_schemas::study::McapFlavour;
use sastrugi_store::mcap::VIEWER_LAYOUT;

/// The text of the layout, if the release has recordings for the viewer.
pub fn text(described: &Described<'_>) -> Option<String> {
    let recorded = || described.files.iter().any(|file| file.path().ends_with(".mcap"));
    (described.head.mcap == McapFlavour::Viewer && recorded()).then(|| VIEWER_LAYOUT.to_owned())
}
