/// A figure a study can make.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Mesh forces over time and their spectra.
    Forces,
    /// Spectra against speed.
    Waterfall,
    /// First harmonics against speed.
    Harmonics,
    /// Force and speed over a few periods, modes shaded.
    Cycles,
    /// Time apart and amplitude against load.
    ApartVsLoad,
    /// The same against speed.
    ApartVsSpeed,
    /// Threshold load against speed.
    ThresholdVsSpeed,
    /// Paths of sun and ring.
    Trajectories,
    /// One displacement over time and its spectrum.
    History,
    /// Natural modes, drawn.
    Modes,
    /// Identified numbers; a table, for the reference set only.
    Identification,
    /// Numbers beside those of an independent implementation; a table, for the reference set only.
    Values,
    /// What single changes do to the results; a table, for the reference set only.
    Changes,
}

impl Kind {
    /// All of them, in the order of a report.
    pub const ALL: [Self; 13] = [
        Self::Modes,
        Self::Identification,
        Self::Forces,
        Self::Waterfall,
        Self::Harmonics,
        Self::Cycles,
        Self::ApartVsLoad,
        Self::ApartVsSpeed,
        Self::ThresholdVsSpeed,
        Self::Changes,
        Self::Trajectories,
        Self::History,
        Self::Values,
    ];

    /// Whether only the reference set has it.
    #[must_use]
    pub fn is_of_reference(self) -> bool {
        matches!(self, Self::Identification | Self::Changes | Self::Values)
    }

    /// Its name on the command line and in file names.
    #[must_use]
    pub fn id(self) -> &'static str {
        match self {
            Self::Forces => "forces",
            Self::Waterfall => "waterfall",
            Self::Harmonics => "harmonics-vs-speed",
            Self::Cycles => "cycles",
            Self::ApartVsLoad => "apart-vs-load",
            Self::ApartVsSpeed => "apart-vs-speed",
            Self::ThresholdVsSpeed => "threshold-vs-speed",
            Self::Trajectories => "trajectories",
            Self::History => "history",
            Self::Modes => "modes",
            Self::Identification => "identification",
            Self::Changes => "changes",
            Self::Values => "values",
        }
    }
}
