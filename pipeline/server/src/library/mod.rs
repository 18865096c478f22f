//! Tiles that were made once, in memory and on disk.
