//! Published stages.
