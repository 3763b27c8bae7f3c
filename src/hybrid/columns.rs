/// Changes of a state side by side: one row of `count` values for each component of the state.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns {
    /// Number of columns.
    pub count: usize,
    /// Components, `[dim][count]`.
    pub values: Vec<f64>,
}

impl Columns {
    /// Returns the columns of the unit matrix of `dim` rows.
    #[must_use]
    pub fn unit(dim: usize) -> Self {
        let mut values = vec![0.0; dim * dim];
        (0..dim).for_each(|i| values[i * dim + i] = 1.0);
        Self { count: dim, values }
    }

    /// Returns component `i` of all columns.
    #[must_use]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.count..(i + 1) * self.count]
    }

    pub(crate) fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.values[i * self.count..(i + 1) * self.count]
    }

    /// Adds `factor` times `row` to component `i`.
    pub(crate) fn add(&mut self, i: usize, factor: f64, row: &[f64]) {
        self.row_mut(i).iter_mut().zip(row).for_each(|(c, r)| *c += factor * r);
    }
}
