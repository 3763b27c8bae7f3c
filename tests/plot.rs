#![cfg(feature = "plot")]
#![allow(clippy::unwrap_used)]
mod figures;

#[test]
fn look() {
    let Ok(folder) = std::env::var("LOOK") else { return };
    let report = flank::plot::Report {
        title: "Planetary study".into(),
        summary: vec!["All <numbers> are made up.".into()],
        sections: vec![
            flank::plot::Section {
                title: "Figures".into(),
                text: "One & two.\n\nThree.".into(),
                items: figures::all().into_iter().map(flank::plot::Item::Figure).collect(),
            },
            flank::plot::Section {
                title: "Numbers".into(),
                text: String::new(),
                items: vec![flank::plot::Item::Table(flank::plot::Table {
                    title: "Published numbers".into(),
                    head: ["quantity", "published", "Flank", "difference", "source", "verdict"]
                        .map(String::from)
                        .to_vec(),
                    rows: (0..5)
                        .map(|i| {
                            vec![
                                "time apart at 500 rpm without load".into(),
                                "0.25".into(),
                                "0.25413".into(),
                                "1.6 %".into(),
                                "section 7.2".into(),
                                flank::plot::Cell::judged(
                                    ["agrees", "deviates", "the source says 0.25 and 0.35"][i % 3],
                                    [
                                        flank::plot::Verdict::Ok,
                                        flank::plot::Verdict::Deviates,
                                        flank::plot::Verdict::Contradicts,
                                    ][i % 3],
                                ),
                            ]
                        })
                        .collect(),
                    note: "A note.".into(),
                })],
            },
        ],
        provenance: vec!["Flank 0.1.0".into()],
        files: Some("figures".into()),
    };
    std::fs::write(format!("{folder}/report.html"), report.html()).unwrap();
    for figure in figures::all() {
        let name = format!("{folder}/{}", figure.id);
        std::fs::write(format!("{name}.svg"), flank::plot::svg(&figure, flank::plot::Theme::Light)).unwrap();
        std::fs::write(format!("{name}-dark.svg"), flank::plot::svg(&figure, flank::plot::Theme::Dark)).unwrap();
        std::fs::write(format!("{name}.png"), flank::plot::png(&figure, 2.0)).unwrap();
    }
}
