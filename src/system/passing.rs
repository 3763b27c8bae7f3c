//! Times at which neighbours of a motion reach an event.

use super::{acting::Force, assemble::Structure, contact_mode::guard_of, variation::Evaluation};
use crate::hybrid::{Columns, GuardId, Mode};

impl Structure {
    /// Returns the advance `h_x ξ/ḣ`, s, of the zero of guard `id` for each of the `columns` before the event. The guard h falls in `mode`
    /// at the place of `by`, and depends on the parameters of `by`, if any. `None` if the guard has no rate, or is the force of a contact
    /// at rest.
    pub(crate) fn earlier(&self, mode: &Mode, id: GuardId, by: Evaluation<'_>, columns: &Columns) -> Option<Vec<f64>> {
        let Evaluation { variations, at, x } = by;
        let ((j, watch), n) = (guard_of(id), self.n);
        let (d, rate) = self.deflection(j, at, x);
        let mut row = vec![0.0; columns.count];
        let speed = if watch.side() != 0.0 {
            self.add_along(j, 0, 1.0, columns, &mut row);
            self.add_moves((j, watch.side()), false, by, &mut row);
            rate
        } else {
            let acting = self.acting(mode, j)?;
            let acceleration = self.relative_acceleration(j, mode, at, x);
            let speed = match acting.force {
                Force::Linear { stiffness, damping } => {
                    let (k, slope) = self.stiffness_at(j, stiffness, at);
                    self.add_along(j, 0, k, columns, &mut row);
                    self.add_along(j, n, damping, columns, &mut row);
                    k * rate + slope * (d - acting.side * self.contacts[j].offset()) + damping * acceleration
                }
                Force::Power { latch, .. } => {
                    let by_rate = acting.force.chi(x) * acting.side;
                    self.add_along(j, n, by_rate, columns, &mut row);
                    if let Some(latch) = latch {
                        let by_latch = -by_rate * rate / x[latch];
                        row.iter_mut().zip(columns.row(latch)).for_each(|(r, c)| *r += by_latch * c);
                    }
                    by_rate * acceleration
                }
                Force::Held => return None,
            };
            for (r, variation) in row.iter_mut().zip(variations) {
                *r += variation.of(|train| {
                    let (acting, at) = (train.acting(mode, j), train.same_phase(self, at));
                    acting.map_or(0.0, |acting| match acting.force {
                        Force::Power { .. } => train.factor(&acting, train.deflection(j, at, x).1, x),
                        _ => train.law_force(&acting, at, x),
                    })
                });
            }
            speed
        };
        row.iter_mut().for_each(|r| *r /= speed);
        row.iter().all(|r| r.is_finite()).then_some(row)
    }
}
