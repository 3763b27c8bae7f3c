//! Shares of work that is divided among processes.

use std::{fmt, str::FromStr};

/// Part `i` of `N` of some work: every N-th of the chains of its rows, from number `i` on, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    /// Its number, from 0.
    pub part: usize,
    /// Number of parts, at least 1.
    pub of: usize,
}

impl Share {
    /// All of the work.
    pub const ALL: Self = Self { part: 0, of: 1 };
    /// Maximum number of parts.
    pub const MOST: usize = 100_000;

    /// Returns whether chain number `chain` is in this part.
    #[must_use]
    pub fn holds(self, chain: usize) -> bool {
        chain % self.of == self.part
    }

    /// Returns the number of chains in this part, of `chains`.
    #[must_use]
    pub fn count(self, chains: usize) -> usize {
        (chains + self.of - 1 - self.part) / self.of
    }

    /// Returns the number among all chains of chain `i` of this part.
    #[must_use]
    pub fn chain(self, i: usize) -> usize {
        self.part + i * self.of
    }
}

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.part, self.of)
    }
}

impl FromStr for Share {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = text.split_once('/').and_then(|(part, of)| Some((part.parse().ok()?, of.parse().ok()?)));
        match read {
            Some((part, of)) if part < of && of <= Self::MOST => Ok(Self { part, of }),
            _ => Err(format!("I/N is wanted, such as 0/16: part I of N, counted from 0, N at most {}", Self::MOST)),
        }
    }
}
