//! A step: the series of the state, how far they hold, and the guards on it.

use super::Ways;
use crate::{
    hybrid::{Jet, JetRequest},
    kernel::{Expansion, ORDER, ROW, bounds::bound::Tail, series::clock::StepClock},
    vectors::Path,
};

impl Ways<'_> {
    #[inline(always)]
    pub(super) fn expand<P: Path>(&self, path: P, request: &JetRequest<'_>, out: &mut Jet) {
        match self.series(path, request, false, out) {
            Some((e, clock, tail)) => {
                out.is_estimate = clock.is_some();
                e.guards(clock.as_ref(), &tail, out);
            }
            None => out.reach = f64::NAN,
        }
    }

    /// Forms the series of the state and their reach; `None` if they cannot be formed.
    #[inline(always)]
    pub(super) fn series<'a, P: Path>(
        &'a self,
        path: P,
        request: &'a JetRequest<'a>,
        is_bare: bool,
        out: &mut Jet,
    ) -> Option<(Expansion<'a>, Option<StepClock>, Tail)> {
        let (motion, s) = (&self.motion, self.motion.structure);
        out.dim = s.dim;
        if !is_bare {
            out.state.resize(ROW * s.dim, 0.0);
        }
        out.rows.fit(s.n, s.contacts.len(), s.oscillators.len());
        out.order = ORDER;
        let mut e = Expansion { s, motion, request, room: &self.room, h: request.span, is_bare };
        e.start(path, out);
        // A bare step is linear: the other recurrence is not compiled for it.
        let clock = if !is_bare && motion.is_pressed { e.step_clock(&out.rows) } else { None };
        if let Some(clock) = &clock {
            e.h = e.clock_span(clock, &out.rows);
        }
        out.rows.owner = clock.and_then(|clock| clock.owner.filter(|_| !clock.is_plain()));
        out.rows.since = clock.map_or(f64::NAN, |clock| clock.since);
        loop {
            out.low.clear();
            match &clock {
                None if is_bare || motion.is_linear => e.linear(out),
                clock => e.in_clock(path, clock.as_ref(), out),
            }
            out.span = e.h;
            let reach = match &clock {
                None => e.plain_reach(path, out),
                Some(clock) => {
                    let rooted = e.rooted_reach(path, clock, out);
                    rooted.map(|(reach, defect)| (reach, Tail { rooted: Some(defect), ..Tail::default() }))
                }
            };
            if let Some((reach, tail)) = reach.filter(|(reach, _)| *reach > 0.0) {
                out.reach = reach;
                let tail = e.with_left_out(tail, out);
                return Some((e, clock, tail));
            }
            // The scale was so large that the last coefficients overflowed.
            e.h *= 1e-6;
            if e.h < f64::MIN_POSITIVE {
                return None;
            }
        }
    }
}
