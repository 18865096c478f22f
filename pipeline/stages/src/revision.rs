//! Revisions of the rooms: hashes of their sources, made by the build script. They are part of cache keys only; a release
//! holds the crate version.

/// A room as far as cache keys go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Room {
    /// `pipeline/roughness`.
    Roughness,
    /// `pipeline/terrain`.
    Terrain,
    /// `pipeline/texture`.
    Texture,
    /// `pipeline/mobility`.
    Mobility,
    /// `pipeline/navigation`.
    Navigation,
    /// `pipeline/imaging`.
    Imaging,
    /// `analysis/statistics`.
    Statistics,
}

/// What every stage stands on: schemas, numeric, store, the jobs with their trait and operations, and the locked dependencies.
const FOUNDATION: [&str; 7] = [
    env!("SASTRUGI_REVISION_SCHEMAS"),
    env!("SASTRUGI_REVISION_NUMERIC"),
    env!("SASTRUGI_REVISION_STORE"),
    env!("SASTRUGI_REVISION_JOB"),
    env!("SASTRUGI_REVISION_JOBS"),
    env!("SASTRUGI_REVISION_OPERATIONS"),
    env!("SASTRUGI_REVISION_DEPENDENCIES"),
];

fn revision_of(room: Room) -> &'static str {
    match room {
        Room::Roughness => env!("SASTRUGI_REVISION_ROUGHNESS"),
        Room::Terrain => env!("SASTRUGI_REVISION_TERRAIN"),
        Room::Texture => env!("SASTRUGI_REVISION_TEXTURE"),
        Room::Mobility => env!("SASTRUGI_REVISION_MOBILITY"),
        Room::Navigation => env!("SASTRUGI_REVISION_NAVIGATION"),
        Room::Imaging => env!("SASTRUGI_REVISION_IMAGING"),
        Room::Statistics => env!("SASTRUGI_REVISION_STATISTICS"),
    }
}

/// Revision of a stage that uses these rooms.
pub fn revision(rooms: &[Room]) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in FOUNDATION.into_iter().chain(rooms.iter().map(|r| revision_of(*r))) {
        hasher.update(part.as_bytes());
    }
    hasher.finalize().to_hex()[..16].to_owned()
}
