use std::fmt;

use super::visible;

/// One thing wrong in a scene, or in the arguments of a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Where: a JSON pointer such as `/train/contacts/0/law/kind`, empty for the whole scene, or an argument as it was written.
    pub pointer: String,
    /// What stands there.
    pub found: String,
    /// What may stand there.
    pub allowed: String,
    /// What to do about it.
    pub remedy: String,
}

impl Fault {
    /// A fault without a remedy.
    pub fn new(pointer: &str, found: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self { pointer: pointer.to_owned(), found: found.into(), allowed: allowed.into(), remedy: String::new() }
    }

    /// The same fault with a remedy.
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
