//! Result of a search: the best numbers, their determination by the claims, and the claims that were never met together.

use serde::Serialize;

use super::{Fit, Trial};
use crate::{
    output::five_digits,
    plot::{Axis, Figure, Guide, Panel, Series, Style},
    study::plan::Plan,
};

/// Least number of trials with a claim met for which the claim counts as one that can be met.
const ALONE: usize = 10;
/// Difference from the least loss within which numbers count as equally good: half a statement.
const EQUAL: f64 = 0.5;

/// Result of a search.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FitResult {
    /// Number of sets that were tried.
    pub trials: usize,
    /// Least loss.
    pub loss: f64,
    /// Counts of fitted claims that agree, agree in part, deviate, and cannot be judged.
    pub fitted: [usize; 4],
    /// The same counts of claims that are held out.
    pub held_out: [usize; 4],
    /// Numbers of the best set.
    pub numbers: Vec<FoundNumber>,
    /// Claims with the best numbers.
    pub claims: Vec<ClaimCount>,
    /// Pairs of claims that were never met together.
    pub never_together: Vec<ExclusivePair>,
    /// Claims that were never met.
    pub never: Vec<String>,
}

/// Number that was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FoundNumber {
    /// Its name.
    pub name: String,
    /// Its places.
    pub pointers: Vec<String>,
    /// Its value in the best set.
    pub found: f64,
    /// Least and largest value of the sets that are as good, to half a statement.
    pub as_good: [f64; 2],
    /// Its range.
    pub between: [f64; 2],
    /// Its plausible range, if it has one.
    pub plausible: Option<[f64; 2]>,
    /// True if the value found is plausible.
    pub is_plausible: bool,
    /// Source of the plausible values.
    pub source: String,
}

/// Claim, with the number of trials in which it was met.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ClaimCount {
    /// Its place in the source.
    pub place: String,
    /// Its quantity.
    pub quantity: String,
    /// True if it was not fitted.
    pub held_out: bool,
    /// Verdict with the best numbers: `a` agrees, `p` in part, `d` deviates, `-` cannot be judged.
    pub verdict: char,
    /// Number of trials in which it agreed, or did in part.
    pub met: usize,
}

/// Two claims that were never met together.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ExclusivePair {
    /// The claims.
    pub claims: [String; 2],
    /// Number of trials in which each was met.
    pub met: [usize; 2],
}

impl FitResult {
    /// Returns the result of all trials; `None` without any.
    #[must_use]
    pub fn new(fit: &Fit<'_>, trials: &[Trial]) -> Option<Self> {
        let best = trials.iter().min_by(|a, b| a.loss.total_cmp(&b.loss))?;
        let letters: Vec<Vec<char>> = trials.iter().map(|trial| trial.verdicts.chars().collect()).collect();
        let is_met = |row: &[char], i: usize| matches!(row.get(i), Some('a' | 'p'));
        let met = |i: usize| letters.iter().filter(|row| is_met(row, i)).count();
        let own: Vec<char> = best.verdicts.chars().collect();
        let words = |i: usize| format!("{}: {}", fit.claims[i].place, fit.claims[i].quantity);
        let claims: Vec<ClaimCount> = fit
            .claims
            .iter()
            .enumerate()
            .map(|(i, claim)| ClaimCount {
                place: claim.place.clone(),
                quantity: claim.quantity.clone(),
                held_out: claim.is_held_out,
                verdict: own.get(i).copied().unwrap_or('-'),
                met: met(i),
            })
            .collect();
        let count = |held_out: bool| {
            let letter = |letter| claims.iter().filter(|c| c.held_out == held_out && c.verdict == letter).count();
            ['a', 'p', 'd', '-'].map(letter)
        };
        let can: Vec<usize> = (0..claims.len()).filter(|i| claims[*i].met >= ALONE).collect();
        let pairs = can.iter().enumerate().flat_map(|(k, i)| can[k + 1..].iter().map(move |j| (*i, *j)));
        let together = |(i, j): &(usize, usize)| letters.iter().any(|row| is_met(row, *i) && is_met(row, *j));
        let never_together = pairs
            .filter(|pair| !together(pair))
            .map(|(i, j)| ExclusivePair { claims: [words(i), words(j)], met: [claims[i].met, claims[j].met] })
            .collect();
        let as_good: Vec<&Trial> = trials.iter().filter(|trial| trial.loss <= best.loss + EQUAL).collect();
        let number = |(k, number): (usize, &super::Number)| {
            let values = as_good.iter().map(|trial| trial.values[k]);
            let range = [values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max)];
            let found = best.values[k];
            FoundNumber {
                name: number.name.clone(),
                pointers: number.pointers.clone(),
                found,
                as_good: range,
                between: number.between,
                plausible: number.plausible,
                is_plausible: number.plausible.is_none_or(|[low, high]| (low..=high).contains(&found)),
                source: number.source.clone(),
            }
        };
        Some(Self {
            trials: trials.len(),
            loss: best.loss,
            fitted: count(false),
            held_out: count(true),
            numbers: fit.question.numbers.iter().enumerate().map(number).collect(),
            never: (0..claims.len()).filter(|i| claims[*i].met == 0).map(words).collect(),
            claims,
            never_together,
        })
    }

    /// Returns the best set.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        self.numbers.iter().map(|number| number.found).collect()
    }

    /// Draws the determination of each number by the claims: the loss of all trials over its value.
    #[must_use]
    pub fn figure(&self, fit: &Fit<'_>, trials: &[Trial]) -> Figure {
        let most = trials.iter().map(|trial| trial.loss).fold(0.0, f64::max);
        let panel = |(k, number): (usize, &FoundNumber)| {
            let share = |value: f64| fit.question.numbers[k].share(value);
            let x: Vec<f64> = trials.iter().map(|trial| share(trial.values[k])).collect();
            let y = trials.iter().map(|trial| trial.loss).collect();
            let plausible = number.plausible.into_iter().flatten();
            let upright = plausible.map(|end| Guide::Vertical { x: share(end), name: "plausible".to_owned() });
            let level = Guide::Horizontal { y: self.loss + EQUAL, name: "as good".to_owned() };
            Panel {
                title: number.name.clone(),
                x: Axis { range: Some([0.0, 1.0]), ..Axis::new(words(number.between), "share of the range") },
                y: Axis::new("loss", ""),
                series: vec![
                    Series::line("trials", 0, x, y).styled(Style::Points),
                    Series::line("best", 1, vec![share(number.found)], vec![self.loss]).styled(Style::Marks),
                ],
                guides: upright.chain([level]).collect(),
                ..Panel::default()
            }
        };
        Figure {
            id: "fit".to_owned(),
            title: "How far the claims determine each number".to_owned(),
            caption: format!(
                "Loss of {} trials over the value of each number; the lower edge shows how well a value can be made up for by the other \
                 numbers. Sets below the line are as good as the best one, to half a statement. Losses up to {most:.1}.",
                trials.len()
            ),
            columns: 3,
            panels: self.numbers.iter().enumerate().map(panel).collect(),
        }
    }
}

/// Returns a range in words.
fn words([low, high]: [f64; 2]) -> String {
    format!("{} to {}", five_digits(low), five_digits(high))
}

impl Fit<'_> {
    /// Returns the study with a set of numbers in its scenes; `None` if they give no valid train.
    #[must_use]
    pub fn study(&self, values: &[f64]) -> Option<Plan> {
        self.question.put(self.whole, values).ok()
    }
}
