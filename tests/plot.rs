#![cfg(feature = "plot")]
#![allow(clippy::unwrap_used)]
mod figures;

#[test]
fn look() {
    let Ok(folder) = std::env::var("LOOK") else { return };
    for figure in figures::all() {
        let name = format!("{folder}/{}", figure.id);
        std::fs::write(format!("{name}.svg"), flank::plot::svg(&figure, flank::plot::Theme::Light)).unwrap();
        std::fs::write(format!("{name}-dark.svg"), flank::plot::svg(&figure, flank::plot::Theme::Dark)).unwrap();
        std::fs::write(format!("{name}.png"), flank::plot::png(&figure, 2.0)).unwrap();
    }
}
