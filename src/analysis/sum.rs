/// Compensated sum (Neumaier 1974): the error does not grow with the number of terms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sum {
    total: f64,
    rest: f64,
}

impl Sum {
    /// Adds a term.
    pub fn add(&mut self, term: f64) {
        let sum = self.total + term;
        self.rest += if self.total.abs() >= term.abs() { (self.total - sum) + term } else { (term - sum) + self.total };
        self.total = sum;
    }

    /// Returns the sum.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.total + self.rest
    }
}
