//! Smoothing filters.
