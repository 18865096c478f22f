//! Revisions of the rooms: hashes of their sources, computed by the build script. They are used in cache keys only; a release
//! states the crate version.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// A room that may be part of a cache key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
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

/// What all stages depend on: schemas, numeric, store, the jobs with their trait and operations, and the locked dependencies.
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

/// Revision of a stage that uses these rooms; each is computed once.
pub fn revision(rooms: &[Room]) -> String {
    static KNOWN: Mutex<BTreeMap<Vec<Room>, String>> = Mutex::new(BTreeMap::new());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    match known.get(rooms) {
        Some(revision) => revision.clone(),
        None => known.entry(rooms.to_vec()).or_insert(computed(rooms)).clone(),
    }
}

fn computed(rooms: &[Room]) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in FOUNDATION.into_iter().chain(rooms.iter().map(|r| revision_of(*r))) {
        hasher.update(part.as_bytes());
    }
    hasher.finalize().to_hex()[..16].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A change of one room must not go unnoticed because it looks like another.
    #[test]
    fn prop_every_room_has_its_own_revision() {
        use Room::{Imaging, Mobility, Navigation, Roughness, Statistics, Terrain, Texture};
        let rooms = [Roughness, Terrain, Texture, Mobility, Navigation, Imaging, Statistics];
        let mut all: Vec<String> = rooms.iter().map(|room| revision(&[*room])).collect();
        all.extend([revision(&[]), revision(&[Terrain, Texture])]);
        assert!(all.iter().all(|hex| hex.len() == 16 && hex.bytes().all(|b| b.is_ascii_hexdigit())), "{all:?}");
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), rooms.len() + 2);
    }
}
