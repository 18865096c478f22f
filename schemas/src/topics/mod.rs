//! MCAP topics of a release.
