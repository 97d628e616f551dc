//! The home of the WGSL sources of pyramap's GPU backend, in a crate of its own so that they are packaged with it.
