use std::fmt;

use super::visible;

/// Fault of a scene, or of the arguments of a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Place: a JSON pointer such as `/train/contacts/0/law/kind`, empty for the whole scene, or an argument as it was written.
    pub pointer: String,
    /// Value or fact found there.
    pub found: String,
    /// Values or facts allowed there.
    pub allowed: String,
    /// Remedy; empty if none is known.
    pub remedy: String,
}

impl Fault {
    /// Returns a fault without a remedy.
    pub fn new(pointer: &str, found: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self { pointer: pointer.to_owned(), found: found.into(), allowed: allowed.into(), remedy: String::new() }
    }

    /// Returns the same fault with a remedy.
    #[must_use]
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        self.remedy = remedy.into();
        self
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = if self.pointer.is_empty() { "(the whole scene)" } else { &visible(&self.pointer) };
        write!(f, "  at {place}\n    found:   {}\n    allowed: {}", visible(&self.found), self.allowed)?;
        if !self.remedy.is_empty() {
            write!(f, "\n    remedy:  {}", self.remedy)?;
        }
        Ok(())
    }
}
