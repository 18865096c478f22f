//! `manifest.json` of a release.
