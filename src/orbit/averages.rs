//! Means over cycles and their standard errors.

use serde::{Deserialize, Serialize};

/// Number of blocks for the estimate of a band.
pub(super) const BLOCKS: usize = 40;
/// Correlation of neighbouring blocks above which a band is doubled.
const CORRELATED: f64 = 0.2;
/// Maximum number of rows stored: from then on each contains twice as many cycles.
const MOST: usize = 8192;

/// Returns the means of the columns of `rows`, and their standard errors from blocks.
pub(crate) fn means(rows: &[impl AsRef<[f64]>], period: f64) -> (Vec<f64>, Vec<f64>) {
    let count = rows.first().map_or(0, |row| row.as_ref().len());
    let columns: Vec<Vec<f64>> = (0..count).map(|l| rows.iter().map(|row| row.as_ref()[l]).collect()).collect();
    let mean = |column: &[f64]| column.iter().sum::<f64>() / (column.len() as f64 * period);
    let band = |column: &Vec<f64>| {
        let length = column.len() / BLOCKS;
        if length == 0 {
            return f64::NAN;
        }
        // Last blocks: rows that do not fill a block are left out at the front.
        let blocks: Vec<f64> = column[column.len() - BLOCKS * length..].chunks_exact(length).map(mean).collect();
        let middle = blocks.iter().sum::<f64>() / BLOCKS as f64;
        let off: Vec<f64> = blocks.iter().map(|b| b - middle).collect();
        let squares: f64 = off.iter().map(|o| o * o).sum();
        let neighbours: f64 = off.windows(2).map(|pair| pair[0] * pair[1]).sum();
        let error = (squares / (BLOCKS * (BLOCKS - 1)) as f64).sqrt();
        let error = if squares > 0.0 && neighbours / squares > CORRELATED { 2.0 * error } else { error };
        // A regular rotation averages out over suitable blocks. The range of the deviation of the sum from its mean shows it.
        let (mean, mut sum, mut low, mut high) = (mean(column) * period, 0.0, 0.0f64, 0.0f64);
        for log in column {
            sum += log - mean;
            (low, high) = (low.min(sum), high.max(sum));
        }
        error.max(0.5 * (high - low) / (column.len() as f64 * period))
    };
    (columns.iter().map(|column| mean(column)).collect(), columns.iter().map(band).collect())
}

/// Sums of the numbers of cycles, over so many cycles each that memory does not grow with the number of cycles.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Averages {
    /// Cycles per row.
    length: u64,
    /// Sums over `length` cycles each.
    rows: Vec<Vec<f64>>,
    /// Incomplete row, and its cycles.
    open: (Vec<f64>, u64),
    /// Sums over all cycles.
    sums: Vec<f64>,
    pub cycles: u64,
}

impl Default for Averages {
    fn default() -> Self {
        Self { length: 1, rows: Vec::new(), open: Default::default(), sums: Vec::new(), cycles: 0 }
    }
}

/// Adds a row to sums, which may be empty.
fn add(sums: &mut Vec<f64>, row: &[f64]) {
    sums.resize(row.len(), 0.0);
    sums.iter_mut().zip(row).for_each(|(sum, r)| *sum += r);
}

impl Averages {
    /// Adds the numbers of a cycle.
    pub fn add(&mut self, row: &[f64]) {
        add(&mut self.sums, row);
        add(&mut self.open.0, row);
        (self.open.1, self.cycles) = (self.open.1 + 1, self.cycles + 1);
        if self.open.1 == self.length {
            self.rows.push(std::mem::take(&mut self.open).0);
        }
        if self.rows.len() == MOST {
            for i in 0..MOST / 2 {
                let second = std::mem::take(&mut self.rows[2 * i + 1]);
                self.rows.swap(i, 2 * i);
                add(&mut self.rows[i], &second);
            }
            self.rows.truncate(MOST / 2);
            self.length *= 2;
        }
    }

    /// Returns the means over all cycles per unit of time, and their standard errors.
    pub fn figures(&self, period: f64) -> (Vec<f64>, Vec<f64>) {
        let (_, band) = means(&self.rows, period * self.length as f64);
        let mean = self.sums.iter().map(|sum| sum / (self.cycles as f64 * period)).collect();
        (mean, band)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_averages_keep_their_means_and_bands() {
        // A sequence that looks random; its errors fall with the root of the number.
        let row = |i: u64| {
            let u = (i as f64 * 0.618_033_988_749_894_9).fract();
            [u, (997.0 * u).fract()]
        };
        let (mut averages, mut all) = (Averages::default(), Vec::new());
        for i in 0..3 * MOST as u64 + 77 {
            averages.add(&row(i));
            all.push(row(i));
        }
        assert!(averages.rows.len() < MOST);
        let ((mean, band), (exact, of_all)) = (averages.figures(0.5), means(&all, 0.5));
        for l in 0..2 {
            assert!((mean[l] - exact[l]).abs() <= 1e-13, "{} {}", mean[l], exact[l]);
            assert!((0.5..2.0).contains(&(band[l] / of_all[l])), "{} {}", band[l], of_all[l]);
        }
    }
}
