//! The envelope of a study file: what stands around the parameters of each item.
