//! The runner: graph of items, cache by key, execution, shards, assembly.

pub mod assemble;
pub mod cache;
mod documents;
pub mod execute;
pub mod graph;
mod lock;
pub mod plan;
pub mod progress;
pub mod shard;
pub mod sources;
pub mod tables;
