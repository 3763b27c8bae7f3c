//! Advice in words and tables.

use std::f64::consts::TAU;

use super::{Advice, Rung, measure::Estimate, verdict::Verdict};
use crate::output::{Table, label};

/// Returns a number with four significant digits.
fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if (1e-3..1e5).contains(&size) => {
            // OK to convert: at most four decimals more than digits.
            let decimals = (3 - libm::log10(size).floor() as i32).clamp(0, 6) as usize;
            format!("{value:.decimals$}")
        }
        _ => format!("{value:.2e}"),
    }
}

fn fraction(value: f64) -> String {
    format!("{value:.4}")
}

/// Returns a change of a fraction, `+0.0123`; a change below the digits shown is 0.
fn signed(value: f64) -> String {
    if value.abs() < 5e-5 { "0".to_owned() } else { format!("{value:+.4}") }
}

/// Returns a relative change, `+1.23 %`.
fn percent(value: f64) -> String {
    if value.abs() < 5e-5 { "0 %".to_owned() } else { format!("{:+.2} %", 100.0 * value) }
}

/// Returns a mean, with its standard error if that is visible.
fn with_error(Estimate { value, error }: Estimate, show: impl Fn(f64) -> String) -> String {
    if show(value + error) == show(value) { show(value) } else { format!("{} ± {}", show(value), two_digits(error)) }
}

/// Returns a value as text by `show`, or a dash for none.
fn or_dash<T>(value: Option<T>, show: impl Fn(T) -> String) -> String {
    value.map_or_else(|| "-".to_owned(), show)
}

fn two_digits(error: f64) -> String {
    // OK to convert: a few decimals.
    let decimals = (1 - libm::log10(error).floor() as i32).clamp(0, 6) as usize;
    format!("{error:.decimals$}")
}

impl Advice {
    fn unit(&self, unit: &str) -> String {
        if self.dimensionless { String::new() } else { format!(", {unit}") }
    }

    /// Returns the table of models, least last: freedoms, motion, time apart, peak force, work and verdict.
    #[must_use]
    pub fn models_table(&self) -> Table {
        let row = |words: &str, rung: &Rung| {
            let motion = &rung.motion;
            let compared = |text: String| if rung.changes.is_empty() { String::new() } else { text };
            vec![
                words.to_owned(),
                motion.freedoms.to_string(),
                motion.kind(),
                with_error(motion.apart(), fraction),
                compared(signed(rung.apart_change())),
                or_dash(motion.peak(), |peak| with_error(peak, short)),
                compared(or_dash(rung.peak_change(), percent)),
                format!("{:.1}", motion.work.steps),
                format!("{:.1}", motion.work.events),
                compared(rung.verdict.words()),
            ]
        };
        let mut rows = vec![row(&self.full.words, &self.full)];
        rows.extend(self.rungs.iter().map(|rung| row(&rung.words, rung)));
        rows.extend(self.together.iter().map(|rung| row("all that is enough, together", rung)));
        let peak = format!("peak{}", self.unit("N"));
        let head = ["model", "freedoms", "motion", "no force, T", "change", &peak, "change", "steps/T", "events/T", ""];
        let note = "Apart: time without force of the family most apart, in forcing periods T; peak: largest force of any \
                    contact. Changes: the largest of any family.";
        Table::new(head).with(rows).titled("Models", note)
    }

    /// Returns the table of groups of freedoms: share in the motion, and the change from holding them.
    #[must_use]
    pub fn freedoms_table(&self) -> Table {
        let rows = self.parts.iter().map(|part| {
            let dropped = part.dropped.as_ref();
            let show = |of: &dyn Fn(&Rung) -> String| or_dash(dropped, of);
            vec![
                part.group.words.clone(),
                part.group.freedoms.join(" "),
                or_dash(part.share, |share| format!("{:.2} %", 100.0 * share)),
                show(&|rung| rung.motion.kind()),
                show(&|rung| signed(rung.apart_change())),
                show(&|rung| or_dash(rung.peak_change(), percent)),
                show(&|rung| match rung.verdict {
                    Verdict::Enough => "can be dropped".to_owned(),
                    Verdict::NotEnough => "matters".to_owned(),
                    Verdict::Unclear => "unclear".to_owned(),
                }),
            ]
        });
        let head = ["freedoms", "names", "kinetic energy", "without: motion", "no force, T", "peak", ""];
        let note = "Kinetic energy: share in the fluctuation of the scene's steady motion. Changes: the group held, all others \
                    free.";
        Table::new(head).with(rows).titled("Freedoms", note)
    }

    /// Returns the table of natural modes with every contact closed.
    #[must_use]
    pub fn modes_table(&self) -> Table {
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        let rows = self.modes.iter().map(|mode| {
            let mut parts: Vec<(f64, &str)> =
                mode.groups.iter().zip(&self.parts).map(|(share, part)| (*share, part.group.words.as_str())).collect();
            parts.sort_by(|a, b| b.0.total_cmp(&a.0));
            let main = parts.iter().filter(|(share, _)| *share >= 0.2).take(3);
            let frequency = if self.dimensionless { mode.omega } else { mode.omega / TAU };
            let mut cells = vec![short(frequency)];
            cells.extend(mode.meshes.iter().map(|weight| percent(*weight)));
            cells.push(or_dash(mode.strain_of_contacts, percent));
            cells.push(or_dash(mode.motion, percent));
            cells.push(
                main.map(|(share, words)| format!("{words} {:.0} %", 100.0 * share)).collect::<Vec<_>>().join(", "),
            );
            cells
        });
        let frequency = if self.dimensionless { "rad per unit of time" } else { "Hz" };
        let mut head = vec![frequency.to_owned()];
        head.extend(self.families.iter().map(|family| format!("in {family}")));
        head.extend(["strain in contacts", "in the motion", "moving"].map(String::from));
        let note = "Every contact closed, power laws with their tangent under the static load. In a contact: weight in its \
                    deflection; in the motion: share of its kinetic energy. Both sum to one.";
        Table::new(head).with(rows).titled("Natural modes", note)
    }

    /// Returns the rule of the verdicts, in words.
    #[must_use]
    pub fn rule_in_words(&self) -> String {
        format!(
            "A model is enough if the time apart of every family of contacts changes by at most {} of the forcing period, its peak \
             force by at most {} %, and the motion stays of its kind: of one period, or irregular. Irregular motions need twice \
             the standard error to spare, transients ten times their scatter.",
            self.tolerance,
            100.0 * self.tolerance
        )
    }

    /// Returns the meaning of verdicts for a scene that has not settled.
    fn transient(&self) -> Option<String> {
        let motion = &self.full.motion;
        motion.settling().then(|| {
            format!(
                "The scene has not settled in {} cycles: verdicts are on its transient in the {} cycles after them, not on a \
                 steady motion, and are left open where a change is not clear of the tolerance by ten times the scatter.",
                motion.settled.cycles, motion.cycles
            )
        })
    }

    /// Returns the verdicts, sentence by sentence.
    #[must_use]
    pub fn verdicts(&self) -> Vec<String> {
        let mut lines = self.transient().into_iter().collect::<Vec<_>>();
        let mut say = |rungs: &[&Rung], verdict: Verdict, words: &str, why: bool| {
            let own = rungs.iter().filter(|rung| rung.verdict == verdict);
            let named = |rung: &&&Rung| {
                let words = rung.words.trim_start_matches("without ");
                if why { format!("{words} ({})", cost(rung)) } else { words.to_owned() }
            };
            let names: Vec<String> = own.map(|rung| named(&rung)).collect();
            if !names.is_empty() {
                lines.push(format!("{words}: {}.", names.join(", ")));
            }
        };
        let rungs: Vec<&Rung> = self.rungs.iter().collect();
        say(&rungs, Verdict::Enough, "Enough", false);
        say(&rungs, Verdict::NotEnough, "Not enough", false);
        say(&rungs, Verdict::Unclear, "Hidden by scatter or drift of the motion", true);
        let parts: Vec<&Rung> = self.dropped().collect();
        say(&parts, Verdict::Enough, "Freedoms that can each be dropped", false);
        say(&parts, Verdict::NotEnough, "Freedoms that matter", false);
        say(&parts, Verdict::Unclear, "Freedoms whose weight is hidden by scatter or drift", true);
        if let Some(rung) = self.together.as_ref().filter(|rung| rung.verdict != Verdict::Enough) {
            lines.push(format!("Each is enough by itself, not together: {} ({}).", rung.words, cost(rung)));
        }
        for (rung, other) in self.models().filter_map(|rung| Some((rung, rung.own_start.as_ref()?))) {
            let peak = other.peak().map(|peak| format!(", peak {}", short(peak.value))).unwrap_or_default();
            let (kind, apart) = (other.kind(), fraction(other.apart().value));
            lines.push(format!(
                "The start decides: from the scene's own, {} has another motion ({kind}, no force for {apart} T{peak}).",
                quoted(&rung.words)
            ));
        }
        for rung in self.models().skip(1).filter(|rung| !rung.motion.followed) {
            lines.push(format!("{} could not take up the scene's motion.", quoted(&rung.words)));
        }
        lines.extend(self.left.iter().map(|left| format!("Not tried: {} ({}).", left.words, left.why)));
        lines.push(match self.least() {
            Some(rung) => {
                let (from, to) = (&self.full.motion, &rung.motion);
                let set = rung.set.iter().map(|(pointer, value)| format!(" In the scene: {pointer} = {value}."));
                format!(
                    "Least model that is enough: {}; {} of {} freedoms, {:.1} of {:.1} steps a cycle.{}",
                    rung.words,
                    to.freedoms,
                    from.freedoms,
                    to.work.steps,
                    from.work.steps,
                    set.collect::<String>()
                )
            }
            None if rungs.is_empty() && parts.is_empty() => "Nothing could be made simpler.".to_owned(),
            None if self.full.motion.settling() => {
                "Nothing that was tried is shown to be enough; whether that holds once the scene has settled is open."
                    .to_owned()
            }
            None if self.models().any(|rung| rung.verdict == Verdict::Unclear) => {
                "Nothing that was tried is shown to be enough.".to_owned()
            }
            None => "Nothing that was tried is enough: the scene models no more than it needs.".to_owned(),
        });
        lines
    }

    /// Returns all numbers, one row per model and family of contacts (RFC 4180).
    #[must_use]
    pub fn csv(&self) -> String {
        let head = "model,ladder,verdict,freedoms,motion,steps_per_cycle,events_per_cycle,family,apart_periods,apart_error,\
             separations_per_cycle,separation_s,peak_n,peak_error_n,mean_force_n,apart_change_periods,apart_change_relative,\
             separation_change_relative,peak_change_n,peak_change_relative,mean_force_change_n";
        let mut table = Table::new(head.split(','));
        let some = |value: Option<f64>| value.map(|v| format!("{v:?}")).unwrap_or_default();
        for rung in self.models() {
            let motion = &rung.motion;
            for mesh in &motion.meshes {
                let change = rung.changes.iter().find(|change| change.family == mesh.family);
                let words = [
                    rung.words.clone(),
                    rung.ladder.map(label).unwrap_or_default(),
                    if rung.changes.is_empty() { String::new() } else { rung.verdict.words() },
                    motion.freedoms.to_string(),
                    motion.kind(),
                ];
                let numbers = [Some(motion.work.steps), Some(motion.work.events)];
                let measures = [
                    Some(mesh.apart.value),
                    Some(mesh.apart.error),
                    Some(mesh.separations),
                    mesh.separation_s,
                    mesh.peak.map(|peak| peak.value),
                    mesh.peak.map(|peak| peak.error),
                    Some(mesh.mean_force.value),
                    change.map(|c| c.apart.value),
                    change.and_then(|c| c.apart_relative),
                    change.and_then(|c| c.separation_relative),
                    change.and_then(|c| c.peak_n),
                    change.and_then(|c| c.peak).map(|peak| peak.value),
                    change.map(|c| c.mean_force),
                ];
                let mut cells = words.to_vec();
                cells.extend(numbers.map(some));
                cells.push(mesh.family.clone());
                cells.extend(measures.map(some));
                table.rows.push(cells);
            }
        }
        table.csv()
    }
}

/// Returns the changes by a model, in words.
fn cost(rung: &Rung) -> String {
    let peak = rung.peak_change().map(|change| format!(", peak force {}", percent(change))).unwrap_or_default();
    format!("no force {} T{peak}", signed(rung.apart_change()))
}

fn quoted(words: &str) -> String {
    format!("\"{words}\"")
}

#[cfg(feature = "plot")]
mod report {
    use super::super::{Advice, figures};
    use crate::plot::{Item, Report, Section};

    impl Advice {
        /// The page.
        #[must_use]
        pub fn report(&self, version: &str) -> Report {
            let section = |title: &str, figure: Option<crate::plot::Figure>, tables: Vec<_>| {
                let tables = tables.into_iter().map(Item::from);
                Section::new(title, "", figure.map(Item::Figure).into_iter().chain(tables).collect())
            };
            let mut tables = vec![self.freedoms_table()];
            tables.extend((!self.modes.is_empty()).then(|| self.modes_table()));
            Report {
                title: format!("How little of {} is enough", self.scene),
                summary: [vec![self.rule_in_words()], self.verdicts()].concat(),
                sections: vec![
                    section("What each simplification costs", figures::rungs(self), vec![self.models_table()]),
                    section("Which freedoms matter", figures::freedoms(self), tables),
                ],
                provenance: vec![
                    format!("flank {version}"),
                    format!("scene {}; SHA-256 of the scene {}", self.scene, self.scene_sha256),
                ],
                files: Some("figures".to_owned()),
            }
        }
    }
}
