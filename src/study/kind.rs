macro_rules! kinds {
    ($($(#[$about:meta])* $kind:ident = $id:literal,)*) => {
        /// A figure a study can make.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
        pub enum FigureKind { $($(#[$about])* #[serde(rename = $id)] $kind,)* }

        impl FigureKind {
            /// All of them, in the order of a report.
            pub const ALL: [Self; [$($id),*].len()] = [$(Self::$kind),*];

            /// Its name on the command line and in file names.
            #[must_use]
            pub fn id(self) -> &'static str {
                match self { $(Self::$kind => $id),* }
            }
        }
    };
}

kinds! {
    /// Natural modes, drawn.
    Modes = "modes",
    /// Numbers of scenes that follow from published values; a table.
    Identification = "identification",
    /// Mesh forces over time and their spectra.
    Forces = "forces",
    /// Spectra against speed.
    Waterfall = "waterfall",
    /// First harmonics against speed.
    Harmonics = "harmonics-vs-speed",
    /// Force and speed over a few periods, modes shaded.
    Cycles = "cycles",
    /// Time apart and amplitude against load.
    ApartVsLoad = "apart-vs-load",
    /// Time apart and amplitude against speed.
    ApartVsSpeed = "apart-vs-speed",
    /// Threshold load against speed.
    ThresholdVsSpeed = "threshold-vs-speed",
    /// Effects of single changes on the results; a table.
    Changes = "changes",
    /// Paths of the centres of gears.
    Trajectories = "trajectories",
    /// One displacement over time and its spectrum.
    History = "history",
    /// Numbers beside those of an independent implementation; a table.
    Values = "values",
}

impl FigureKind {
    /// Returns whether it is a table of a list in the file of a study.
    #[must_use]
    pub fn is_table(self) -> bool {
        matches!(self, Self::Identification | Self::Changes | Self::Values)
    }
}
