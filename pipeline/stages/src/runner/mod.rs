//! The runner: graph of items, cache by key, execution, shards, assembly.

pub mod assemble;
pub mod cache;
pub mod damage;
pub mod execute;
pub mod graph;
mod lock;
pub mod plan;
pub mod progress;
pub mod shard;
pub mod tables;
