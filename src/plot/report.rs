use std::fmt::Write;

use serde_json::{Value, json};

use super::{
    Animation, Figure, Print,
    draw::{
        Theme, escaped,
        legend::{self, Entry, Symbol},
        palette::hex,
        panel::scales,
    },
    figure::{Axis, Guide, Panel, Series, Verdict},
};
use crate::output::{self, Folder, OutputError};

/// Result of a study, as one page that needs no network: text, tables, and interactive figures.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Title.
    pub title: String,
    /// Paragraphs at the top.
    pub summary: Vec<String>,
    /// Sections; their titles are the table of contents.
    pub sections: Vec<Section>,
    /// Origin of the page, line by line, at the foot: version, scene and its hash, command.
    pub provenance: Vec<String>,
    /// Folder of the figures' files, relative to the page, if they exist: `id.svg`, `id.png`, `id.csv` and `id.json` of each figure are
    /// linked there.
    pub files: Option<String>,
}

/// A section of a report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// Title.
    pub title: String,
    /// Paragraphs, with an empty line between two; may be empty.
    pub text: String,
    /// Contents, in order.
    pub items: Vec<Item>,
}

impl Section {
    /// Returns a section.
    #[must_use]
    pub fn new(title: &str, text: &str, items: Vec<Item>) -> Self {
        Self { title: title.to_owned(), text: text.to_owned(), items }
    }
}

/// Item of a section.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "a report holds dozens of them")]
pub enum Item {
    /// A figure.
    Figure(Figure),
    /// A table.
    Table(Table),
    /// Animation of a train.
    Animation(Animation),
}

/// Table whose cells may have verdicts.
pub type Table = output::Table<TableCell>;

/// A table of words alone.
impl From<output::Table> for Item {
    fn from(output::Table { title, head, rows, note }: output::Table) -> Self {
        let rows = rows.into_iter().map(|row| row.into_iter().map(TableCell::from).collect()).collect();
        Self::Table(Table { title, head, rows, note })
    }
}

/// A cell of a table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TableCell {
    /// Text of the cell.
    pub text: String,
    /// Verdict of a comparison, if any.
    pub verdict: Option<Verdict>,
}

impl Verdict {
    /// Returns the class in the page, and a sign, which does not depend on colour.
    fn class_and_sign(self) -> (&'static str, &'static str) {
        match self {
            Self::Agrees => ("ok", "✓"),
            Self::Partly => ("partly", "≈"),
            Self::Deviates => ("deviates", "≠"),
            Self::Contradiction => ("contradicts", "⇄"),
        }
    }
}

impl TableCell {
    /// Returns a cell with a verdict.
    #[must_use]
    pub fn judged(text: impl Into<String>, verdict: Verdict) -> Self {
        Self { text: text.into(), verdict: Some(verdict) }
    }
}

impl<T: Into<String>> From<T> for TableCell {
    fn from(text: T) -> Self {
        Self { text: text.into(), verdict: None }
    }
}

/// Page without its contents; the words between at signs are replaced, in this order.
const PAGE: &str = include_str!("report.html");
/// Script that draws the figures of a page, with zoom and values at the pointer.
const SCRIPT: &str = include_str!("page.js");

impl Report {
    /// Name of its file.
    pub const FILE: &str = "report.html";

    /// Returns the names of the files of a command that writes a report, these figures and these data.
    pub fn files<'a>(figures: impl IntoIterator<Item = &'a str>, data: &[&str]) -> Vec<String> {
        let data = data.iter().copied().chain([Self::FILE]).map(str::to_owned);
        figures.into_iter().flat_map(Figure::files).chain(data).collect()
    }

    /// Writes the page.
    ///
    /// # Errors
    /// [`OutputError`] if it cannot be written.
    pub fn write(&self, folder: &mut Folder, print: &Print) -> Result<(), OutputError> {
        folder.bytes(Self::FILE, self.linked(print))
    }

    /// Returns the page. Equal reports give equal bytes.
    ///
    /// Numbers of figures are rounded to a millionth of the range of their axis (on logarithmic axes to six digits); the data files of
    /// [`Figure`] contain them in full.
    #[must_use]
    pub fn html(&self) -> String {
        self.linked(&Print::default())
    }

    /// Returns the page, with links to the files of figures in the formats of `print`.
    fn linked(&self, print: &Print) -> String {
        let mut page = String::new();
        let mut rest = PAGE;
        for (mark, part) in [
            ("@title@", escaped(&self.title)),
            ("@body@", self.body(print)),
            ("@script@", SCRIPT.replace("@colours@", &colours().to_string())),
        ] {
            let (before, after) = rest.split_once(mark).expect("the page has every mark once, in order");
            page.push_str(before);
            page.push_str(&part);
            rest = after;
        }
        page + rest
    }

    fn body(&self, print: &Print) -> String {
        let mut body = format!("<header>\n<h1>{}</h1>\n{}</header>\n", escaped(&self.title), paragraphs(&self.summary));
        let contents = self.sections.iter().enumerate();
        let contents: String = contents
            .map(|(i, section)| format!("<li><a href=\"#section-{}\">{}</a></li>\n", i + 1, escaped(&section.title)))
            .collect();
        write!(body, "<nav aria-label=\"Contents\"><ol>\n{contents}</ol></nav>\n<main>\n").expect("a string grows");
        body += &self.without_script();
        for (i, section) in self.sections.iter().enumerate() {
            let text: Vec<String> = section.text.split("\n\n").map(str::to_owned).collect();
            let title = escaped(&section.title);
            write!(body, "<section id=\"section-{}\">\n<h2>{title}</h2>\n{}", i + 1, paragraphs(&text))
                .expect("a string grows");
            for item in &section.items {
                body += &match item {
                    Item::Figure(figure) => self.figure(figure, print),
                    Item::Table(table) => table_html(table),
                    Item::Animation(animation) => {
                        figure_html([&animation.id, &animation.title, &animation.caption], animation.data(), "")
                    }
                };
            }
            body += "</section>\n";
        }
        body + "</main>\n<footer>\n" + &paragraphs(&self.provenance) + "</footer>\n"
    }

    fn figure(&self, figure: &Figure, print: &Print) -> String {
        let id = escaped(&figure.id);
        let links = self.files.as_ref().map_or_else(String::new, |folder| {
            let link = |kind: &str| {
                format!("<a href=\"{}/{id}.{kind}\">{}</a>", escaped(folder.trim_end_matches('/')), kind.to_uppercase())
            };
            format!(
                "<p class=\"files\">{}</p>\n",
                print
                    .formats
                    .iter()
                    .map(|format| format.ending())
                    .chain(["csv", "json"])
                    .map(link)
                    .collect::<Vec<_>>()
                    .join(" ")
            )
        });
        figure_html([&figure.id, &figure.title, &figure.caption], figure_data(figure), &links)
    }

    /// Returns the part of the page that replaces the figures if no script runs.
    fn without_script(&self) -> String {
        let items = self.sections.iter().flat_map(|section| &section.items);
        let figures = items.filter_map(|item| if let Item::Figure(figure) = item { Some(figure) } else { None });
        let folder = self.files.as_ref().map(|folder| format!("{}/", folder.trim_end_matches('/'))).unwrap_or_default();
        let names: Vec<String> = figures.map(|figure| escaped(&format!("{folder}{}.svg", figure.id))).collect();
        let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        format!("<noscript><p>The figures of this page need JavaScript. As pictures: {names}.</p></noscript>\n")
    }
}

/// Returns the element into which the script of a page draws.
fn figure_html([id, title, caption]: [&str; 3], data: Value, links: &str) -> String {
    // A script element ends at the first `</script`.
    let data = data.to_string().replace('<', "\\u003c");
    format!(
        "<figure id=\"{}\">\n<h3>{}</h3>\n<div class=\"legend\"></div>\n<div class=\"plot\"></div>\n<script \
         type=\"application/json\">{data}</script>\n<figcaption>{}</figcaption>\n{links}</figure>\n",
        escaped(id),
        escaped(title),
        escaped(caption),
    )
}

fn paragraphs(lines: &[String]) -> String {
    let lines = lines.iter().filter(|line| !line.trim().is_empty());
    lines.fold(String::new(), |all, line| all + "<p>" + &escaped(line) + "</p>\n")
}

fn table_html(table: &Table) -> String {
    let head: String = table.head.iter().map(|cell| format!("<th scope=\"col\">{}</th>", escaped(cell))).collect();
    let cell = |cell: &TableCell| match cell.verdict.map(Verdict::class_and_sign) {
        None => format!("<td>{}</td>", escaped(&cell.text)),
        Some((class, sign)) => format!("<td class=\"{class}\"><span>{sign}</span> {}</td>", escaped(&cell.text)),
    };
    let row = |row: &Vec<TableCell>| format!("<tr>{}</tr>\n", row.iter().map(cell).collect::<String>());
    let rows: String = table.rows.iter().map(row).collect();
    let note = paragraphs(std::slice::from_ref(&table.note));
    format!(
        "<div class=\"table\">\n<h3>{}</h3>\n<div class=\"scroll\" tabindex=\"0\"><table>\n<thead><tr>{head}</tr></thead>\n\
         <tbody>\n{rows}</tbody>\n</table></div>\n{note}</div>\n",
        escaped(&table.title),
    )
}

/// Returns the colours of both themes, for the page's script.
fn colours() -> Value {
    let theme = |theme: Theme| {
        let colours = theme.colours();
        json!({
            "paper": hex(colours.paper), "ink": hex(colours.ink), "muted": hex(colours.muted), "grid": hex(colours.grid),
            "series": colours.series.map(hex), "bands": colours.bands.map(hex), "bandOpacity": colours.band_opacity,
            "tiles": colours.tiles.map(hex), "tileOpacity": colours.tile_opacity,
        })
    };
    json!({ "light": theme(Theme::Light), "dark": theme(Theme::Dark) })
}

/// Returns a figure in the form of the page's script.
fn figure_data(figure: &Figure) -> Value {
    let look = |look: &Symbol| match look {
        Symbol::Series(style, colour) => json!({ "style": style, "colour": colour }),
        Symbol::Tile(colour) => json!({ "style": "tile", "colour": colour }),
        Symbol::Band(colour) => json!({ "style": "band", "colour": colour }),
    };
    let entry =
        |entry: Entry<'_>| json!({ "name": entry.name, "looks": entry.looks.iter().map(look).collect::<Vec<_>>() });
    json!({
        "height": figure.height(),
        "columns": figure.columns.clamp(1, figure.panels.len().max(1)),
        "legend": legend::entries(&figure.panels).into_iter().map(entry).collect::<Vec<_>>(),
        "panels": figure.panels.iter().map(panel_data).collect::<Vec<_>>(),
    })
}

fn panel_data(panel: &Panel) -> Value {
    let [x, y] = scales(panel);
    let axis = |axis: &Axis, low: f64, high: f64| json!({ "label": axis.label, "unit": axis.unit, "logarithmic": axis.logarithmic, "places": axis.places, "range": [low, high] });
    let rounder = |low: f64, high: f64, logarithmic| move |value: f64| rounded(value, high - low, logarithmic);
    let (round_x, round_y) = (rounder(x.low, x.high, x.logarithmic), rounder(y.low, y.high, y.logarithmic));
    let series = |series: &Series| {
        json!({
            "name": series.name, "style": series.style, "colour": series.colour,
            "x": series.x.iter().copied().map(round_x).collect::<Vec<_>>(),
            "y": series.y.iter().copied().map(round_y).collect::<Vec<_>>(),
        })
    };
    let guide = |guide: &Guide| match guide {
        Guide::Vertical { x, name } => json!({ "x": x, "name": name }),
        Guide::Horizontal { y, name } => json!({ "y": y, "name": name }),
        Guide::Slanted { from, to, name } => json!({ "from": from, "to": to, "name": name }),
    };
    let raster = panel.raster.as_ref().map(|raster| {
        let points: String = raster.points.iter().map(|class| char::from(b'0' + class)).collect();
        let classes = raster.classes.iter().map(|(name, [r, g, b])| json!([name, [r, g, b]]));
        json!({
            "x": raster.x, "y": raster.y, "columns": raster.columns, "points": points, "classes": classes.collect::<Vec<_>>(),
        })
    });
    json!({
        "title": panel.title,
        "raster": raster,
        "x": axis(&panel.x, x.low, x.high),
        "y": axis(&panel.y, y.low, y.high),
        "equal": panel.equal_scales,
        "series": panel.series.iter().map(series).collect::<Vec<_>>(),
        "bands": panel.bands,
        "tiles": panel.tiles,
        "guides": panel.guides.iter().map(guide).collect::<Vec<_>>(),
        "namesAbove": panel.names_above,
        "notes": panel.notes,
    })
}

/// Returns a value to a millionth of the span of its axis, or to six digits; `null` if it has no place there.
pub(super) fn rounded(value: f64, span: f64, logarithmic: bool) -> Value {
    let short = if logarithmic {
        format!("{value:.5e}")
    } else {
        format!("{value:.*}", (6.0 - libm::log10(span).floor()).clamp(0.0, 320.0) as usize)
    };
    // An integer is shorter without its fraction.
    match short.parse::<f64>() {
        Ok(whole) if whole.fract() == 0.0 && whole.abs() < 1e9 => json!(whole as i64),
        Ok(value) => json!(value),
        Err(_) => Value::Null,
    }
}
