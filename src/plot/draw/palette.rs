/// Colours of the page around a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Theme {
    /// On white.
    #[default]
    Light,
    /// On near-black.
    Dark,
}

/// Red, green, blue.
pub(crate) type Rgb = (u8, u8, u8);

/// Colours of one theme.
pub(crate) struct Colours {
    pub paper: Rgb,
    pub ink: Rgb,
    /// Guides, their names and ticks.
    pub muted: Rgb,
    pub grid: Rgb,
    /// Colours of series: Okabe and Ito, "Color universal design" (2008), distinct in all kinds of colour vision; the most legible on this
    /// paper come first.
    pub series: [Rgb; 8],
    /// Shades of bands, drawn on the paper with `band_opacity`.
    pub bands: [Rgb; 6],
    pub band_opacity: f64,
    /// Colours of adjacent tiles: of the same set, distinct by hue and by lightness; curves are drawn on them in `ink`.
    pub tiles: [Rgb; 7],
    pub tile_opacity: f64,
}

const ORANGE: Rgb = (0xe6, 0x9f, 0x00);
const SKY: Rgb = (0x56, 0xb4, 0xe9);
const GREEN: Rgb = (0x00, 0x9e, 0x73);
const YELLOW: Rgb = (0xf0, 0xe4, 0x42);
const BLUE: Rgb = (0x00, 0x72, 0xb2);
const VERMILION: Rgb = (0xd5, 0x5e, 0x00);
const PURPLE: Rgb = (0xcc, 0x79, 0xa7);
const GREY: Rgb = (0x80, 0x86, 0x8e);

const LIGHT: Colours = Colours {
    paper: (0xff, 0xff, 0xff),
    ink: (0x1f, 0x23, 0x28),
    muted: (0x5f, 0x68, 0x73),
    grid: (0xe4, 0xe7, 0xeb),
    series: [BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, (0, 0, 0), GREY],
    bands: [ORANGE, SKY, GREEN, PURPLE, YELLOW, GREY],
    band_opacity: 0.2,
    // In rising weight, as outcomes are listed from good to bad.
    tiles: [SKY, PURPLE, YELLOW, GREEN, ORANGE, VERMILION, GREY],
    tile_opacity: 0.75,
};

const DARK: Colours = Colours {
    paper: (0x15, 0x18, 0x1c),
    ink: (0xe6, 0xe8, 0xeb),
    muted: (0x9d, 0xa7, 0xb3),
    grid: (0x2b, 0x31, 0x38),
    series: [SKY, (0xf0, 0x7f, 0x2e), (0x1c, 0xb8, 0x8b), PURPLE, ORANGE, YELLOW, (0xff, 0xff, 0xff), GREY],
    band_opacity: 0.24,
    ..LIGHT
};

impl Colours {
    pub(crate) fn series(&self, number: usize) -> Rgb {
        self.series[number % self.series.len()]
    }

    pub(crate) fn band(&self, number: usize) -> Rgb {
        self.bands[number % self.bands.len()]
    }

    pub(crate) fn tile(&self, number: usize) -> Rgb {
        self.tiles[number % self.tiles.len()]
    }
}

impl Theme {
    pub(crate) fn colours(self) -> &'static Colours {
        match self {
            Self::Light => &LIGHT,
            Self::Dark => &DARK,
        }
    }
}

/// Returns a colour as `#rrggbb`.
pub(crate) fn hex((r, g, b): Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}
