//! Arguments of all commands that draw figures.

use crate::{
    Error,
    output::Fault,
    plot::{Format, Print},
};

/// Form of the figures.
#[derive(Debug, Default, clap::Args)]
pub struct Pictures {
    /// Formats of the figures
    #[arg(long, value_enum, value_delimiter = ',', default_value = "svg,png", help_heading = "Figures")]
    format: Vec<Format>,
    /// Size of the figures: a width such as 85mm or 178mm, or WxH in mm; for a screen if left out
    #[arg(long, value_name = "SIZE", help_heading = "Figures")]
    size: Option<String>,
    /// Size of the numbers at the axes, points
    #[arg(long, value_name = "PT", help_heading = "Figures")]
    font_size: Option<f64>,
    /// Draw these panels only, counted from 1
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = clap::value_parser!(u16).range(1..), help_heading = "Figures")]
    panels: Vec<u16>,
    /// Leave out the titles of figures: a paper has captions
    #[arg(long, help_heading = "Figures")]
    no_titles: bool,
}

impl Pictures {
    /// Returns the requested form.
    pub fn print(&self) -> Result<Print, Error> {
        let mut faults: Vec<Fault> = Vec::new();
        let mut print = Print {
            formats: self.format.clone(),
            has_titles: !self.no_titles,
            panels: self.panels.iter().map(|panel| usize::from(*panel)).collect(),
            ..Print::default()
        };
        let mut take = |next: Result<Print, Fault>, print: &mut Print| match next {
            Ok(next) => *print = next,
            Err(fault) => faults.push(fault),
        };
        if let Some(size) = &self.size {
            take(print.clone().sized(size), &mut print);
        }
        if let Some(points) = self.font_size {
            take(print.clone().lettered(points), &mut print);
        }
        if faults.is_empty() { Ok(print) } else { Err(Error::Arguments(faults)) }
    }
}
