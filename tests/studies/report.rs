//! The report page in a real browser: no errors, no requests, every figure drawn, zoom, hover, dark mode, a phone.
#![cfg(feature = "plot")]

use crate::figures;
use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use flank::{
    Simulation, Task,
    plot::{Figure, Item, Panel, Report, Section, Series, Table, TableCell, Verdict},
    study::{Context, FigureKind, page::Contents, plan::Plan, run_page, steady::Rule},
};
use serde_json::Value;

/// Watches the page from its first line on.
const WATCH: &str = r#"<script>
window.seen = { errors: [], blocked: [] };
addEventListener("error", (event) => seen.errors.push(String(event.message)));
addEventListener("unhandledrejection", (event) => seen.errors.push(String(event.reason)));
addEventListener("securitypolicyviolation", (event) => seen.blocked.push(event.blockedURI + " " + event.violatedDirective));
console.error = (...words) => seen.errors.push(words.join(" "));
</script>"#;

/// Uses the page as a reader would, and tells the page around it what happened.
const USE: &str = r##"<script>
(async () => {
  const wait = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));
  const drawn = async () => { while (!document.documentElement.dataset.drawn) await wait(20); };
  const mouse = (kind, target, x, y, buttons) => target.dispatchEvent(new PointerEvent(kind,
    { bubbles: true, cancelable: true, view: window, clientX: x, clientY: y, button: 0, buttons }));
  const all = (query, within) => [...(within || document).querySelectorAll(query)];
  // Words that lie on each other by more than their halos, or leave the picture.
  const clashes = (figure) => {
    const sheet = figure.querySelector(".plot").getBoundingClientRect();
    const words = all(".panel text", figure).filter((text) => text.textContent.trim())
      .map((text) => [text.textContent, text.getBoundingClientRect()]);
    const outside = words.filter(([, room]) => room.left < sheet.left - 1 || room.right > sheet.right + 1 || room.top < sheet.top - 1)
      .map(([word]) => word + " leaves the picture");
    const meet = (a, b) => a.left + 2 < b.right && b.left + 2 < a.right && a.top + 3 < b.bottom && b.top + 3 < a.bottom;
    return words.flatMap(([word, room], i) => words.slice(0, i).filter(([, other]) => meet(room, other))
      .map(([other]) => word + " lies on " + other)).concat(outside);
  };
  const tell = {};
  try {
    await drawn();
    tell.width = innerWidth;
    tell.overflow = document.documentElement.scrollWidth - innerWidth;
    tell.tableScrolls = all(".scroll").some((box) => box.scrollWidth > box.clientWidth);
    tell.figures = all("figure").filter((figure) => !figure.querySelector(".gauges")).map((figure) => ({
      id: figure.id,
      traces: all(".series", figure).filter((series) => series.querySelector("path[d]")).length,
      panels: all(".panel", figure).length,
      columns: new Set(all(".panel", figure).map((panel) => panel.getBoundingClientRect().left)).size,
      words: figure.textContent,
      clashes: clashes(figure),
      legend: all(".legend button", figure).map((entry) => entry.textContent),
      bands: all(".shade", figure).length,
    }));

    const train = document.getElementById("animation");
    if (train) {
      const [play, slider] = [train.querySelector(".play"), train.querySelector("input")];
      const turned = () => all(".train path", train).map((gear) => gear.getAttribute("transform")).join(" ");
      const before = [slider.value, turned()];
      play.click();
      for (let i = 0; i < 50 && slider.value === before[0]; i++) await wait(100);
      play.click();
      const after = [slider.value, turned()];
      train.querySelector(".plot").dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
      tell.animation = { before, after, stepped: slider.value, gears: all(".train path", train).length, rings: all(".train circle", train).length, clashes: clashes(train) };
    }

    const figure = document.getElementById("mesh-forces");
    const plot = figure.querySelector(".plot");
    plot.scrollIntoView();
    const panel = () => figure.querySelector(".over");
    const range = () => JSON.parse(figure.querySelector(".panel").dataset.x);
    const ticks = () => all(".tick-x", figure).map((tick) => tick.textContent).sort().join(" ");
    const box = panel().getBoundingClientRect();
    const middle = box.top + box.height / 2;

    mouse("pointermove", panel(), box.left + box.width * 0.3, middle, 0);
    await wait(500);
    tell.hover = all(".hover text", figure).map((label) => label.textContent).join(" ");

    tell.before = { range: range(), ticks: ticks() };
    mouse("pointerdown", panel(), box.left + box.width * 0.25, middle, 1);
    await wait(50);
    for (const part of [0.3, 0.4, 0.5]) { mouse("pointermove", window, box.left + box.width * part, middle, 1); await wait(50); }
    mouse("pointerup", window, box.left + box.width * 0.5, middle, 0);
    await wait(800);
    tell.zoomed = { range: range(), ticks: ticks() };
    figure.querySelector(".reset").click();
    await wait(800);
    tell.reset = { range: range(), ticks: ticks() };

    const count = () => all(".series", figure).length;
    tell.lines = [count()];
    figure.querySelector(".legend button").click();
    await wait(300);
    tell.lines.push(count());

    const colours = () => [getComputedStyle(document.body).backgroundColor, getComputedStyle(figure.querySelector(".plot")).color,
      getComputedStyle(figure.querySelector(".tick-x")).fill];
    tell.colours = [colours()];
    document.getElementById("theme").click();
    await drawn();
    tell.colours.push(colours());

    tell.requests = performance.getEntriesByType("resource").map((entry) => entry.name);
  } catch (error) {
    seen.errors.push(String(error && error.stack || error));
  }
  parent.postMessage({ ...tell, ...seen }, "*");
})();
</script>"##;

/// Two windows, as wide as a desk and as a phone, and what they tell.
const WINDOWS: &str = r#"<!DOCTYPE html><meta charset="utf-8"><pre id="told"></pre>
<iframe src="watched.html\#light" style="width:1200px;height:900px;border:0"></iframe>
<iframe src="watched.html\#light" style="width:360px;height:800px;border:0"></iframe>
<script>
const told = [];
addEventListener("message", (event) => {
  told.push(event.data);
  if (told.length === 2) {
    told.sort((one, other) => other.width - one.width);
    document.getElementById("told").textContent = encodeURIComponent(JSON.stringify(told));
  }
});
</script>"#;

/// A browser of Chromium's kin: the one that `FLANK_BROWSER` names, or the first in the path.
fn browser() -> Option<PathBuf> {
    if let Some(named) = env::var_os("FLANK_BROWSER") {
        return Some(named.into());
    }
    let folders: Vec<PathBuf> = env::split_paths(&env::var_os("PATH")?).collect();
    let names = ["chromium", "chromium-browser", "google-chrome"];
    names.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name))).find(|path| path.is_file())
}

/// What the browser makes of a page, once its scripts are done.
fn document(browser: &Path, folder: &Path, page: &str) -> String {
    let out = folder.join("document.html");
    let mut running = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"])
        .args(["--disable-component-update", "--disable-sync", "--no-first-run", "--window-size=1700,1000"])
        .args(["--virtual-time-budget=120000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .arg(format!("file://{}", folder.join(page).display()))
        .stdout(fs::File::create(&out).unwrap())
        .stderr(Stdio::null())
        .spawn()
        .unwrap_or_else(|error| panic!("{}: {error}", browser.display()));
    // A browser that hangs must not hang the tests; on a loaded machine it takes some 20 s.
    let begin = Instant::now();
    while running.try_wait().unwrap().is_none() {
        if begin.elapsed() > Duration::from_secs(300) {
            running.kill().unwrap();
            panic!("{} did not come to an end", browser.display());
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    fs::read_to_string(out).unwrap()
}

fn percent_decoded(text: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = text.as_bytes();
    while let [first, tail @ ..] = rest {
        if *first == b'%' {
            bytes.push(u8::from_str_radix(std::str::from_utf8(&tail[..2]).unwrap(), 16).unwrap());
            rest = &tail[2..];
        } else {
            bytes.push(*first);
            rest = tail;
        }
    }
    String::from_utf8(bytes).unwrap()
}

fn report(figures: Vec<Figure>) -> Report {
    let table = Table {
        title: "Numbers".into(),
        head: ["quantity", "published", "Flank", "difference", "place in the source", "verdict"]
            .map(String::from)
            .to_vec(),
        rows: vec![vec![
            "time apart at 500 rpm".into(),
            "0.25".into(),
            "0.254".into(),
            "2 %".into(),
            "figure 7".into(),
            TableCell::judged("agrees", Verdict::Agrees),
        ]],
        note: String::new(),
    };
    let items = figures.into_iter().map(Item::Figure).chain([Item::Table(table)]).collect();
    Report {
        title: "Study".into(),
        sections: vec![Section { title: "All".into(), text: String::new(), items }],
        ..Report::default()
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

#[test]
fn a_browser_shows_the_report() {
    let mut figures = figures::all();
    figures.push(figures::hard());
    // A panel without anything, and numbers that have no place.
    let gaps = Series::line("gaps", 0, vec![1.0, 2.0, f64::NAN, 3.0], vec![1.0, 1.0, 2.0, f64::INFINITY]);
    let panels = vec![Panel::default(), Panel { series: vec![gaps], ..Panel::default() }];
    figures.push(Figure { id: "odd".into(), columns: 2, panels, ..Figure::default() });
    let Some(windows) = windows(&report(figures.clone()).html(), "mesh-forces") else { return };
    for window in &windows {
        check(window, &figures);
        check_use(window);
    }
    // A table too wide for a phone scrolls in its own box.
    assert_eq!([&windows[0]["tableScrolls"], &windows[1]["tableScrolls"]], [false, true]);
}

/// The page of the reference study, on a few speeds and loads: every figure is there, and can be zoomed.
#[test]
fn a_browser_shows_the_study() {
    let context = Context { rule: Rule::default(), task: Task::default() };
    let plan = Plan::reference().unwrap().varied(Some(vec![0.0, 20.0, 40.0]), Some(vec![500.0, 1000.0, 2000.0]));
    let kinds = FigureKind::ALL.into_iter().filter(|kind| !kind.is_table());
    let entries = kinds.map(|kind| (kind, plan.make(kind, &context).unwrap())).collect();
    let report = Contents { title: "Study".into(), entries, ..Contents::default() }.report(&plan);
    let items = report.sections.iter().flat_map(|section| &section.items);
    let figures = items.filter_map(|item| if let Item::Figure(figure) = item { Some(figure.clone()) } else { None });
    let figures: Vec<Figure> = figures.collect();
    assert_eq!(figures.len(), 10);
    let Some(windows) = windows(&report.html(), "cycles") else { return };
    for window in &windows {
        check(window, &figures);
        let [before, zoomed, reset] = ["before", "zoomed", "reset"].map(|state| &window[state]);
        assert_ne!(before, zoomed);
        assert_eq!(before, reset);
    }
}

/// The page of a run: its train moves, steps by a key, and fits a phone.
#[test]
fn a_browser_shows_a_run() {
    let simulation = Simulation::from_file("examples/scenes/reference-light.json").unwrap();
    let record = simulation.run().unwrap();
    let page = run_page::page(&simulation, &record, &record.end, Task::default()).unwrap();
    let html = page.html();
    assert!(html.len() < 300_000, "{}", html.len());
    let items = page.sections.iter().flat_map(|section| &section.items);
    let figures = items.filter_map(|item| if let Item::Figure(figure) = item { Some(figure.clone()) } else { None });
    let figures: Vec<Figure> = figures.collect();
    assert_eq!(figures.len(), run_page::FIGURES.len());
    // The time of a browser without a screen may run on without frames: then the animation stands, and the page is opened again.
    let moves = |windows: &Vec<Value>| windows.iter().all(|w| w["animation"]["before"] != w["animation"]["after"]);
    let opened = || windows(&html, "deflection");
    let Some(windows) = (0..4).map(|_| opened()).find(|seen| seen.as_ref().is_none_or(moves)).unwrap_or_else(opened)
    else {
        return;
    };
    for window in &windows {
        check(window, &figures);
        let animation = &window["animation"];
        assert_ne!(animation["before"], animation["after"]);
        let frame = |value: &Value| value.as_str().unwrap().parse::<u32>().unwrap();
        assert_eq!((frame(&animation["after"][0]) + 1) % 100, frame(&animation["stepped"]));
        assert_eq!([&animation["gears"], &animation["rings"]], [5, 6]);
        assert_eq!(animation["clashes"], serde_json::json!([]));
    }
}

/// What a page tells in a wide and in a narrow window, when its figure `used` is used; none without a browser.
fn windows(page: &str, used: &str) -> Option<Vec<Value>> {
    let Some(browser) = browser() else {
        let wanted = env::var_os("CI").is_some() || env::var_os("FLANK_REQUIRE_BROWSER").is_some();
        assert!(!wanted, "no chromium, chromium-browser or google-chrome in the path; FLANK_BROWSER can name one");
        eprintln!("skipped: no browser found");
        return None;
    };
    let (head, rest) = page.split_once("<head>").unwrap();
    let (body, end) = rest.rsplit_once("</body>").unwrap();
    let acts = USE.replace("mesh-forces", used);
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("watched.html"), format!("{head}<head>{WATCH}{body}{acts}</body>{end}")).unwrap();
    fs::write(folder.path().join("windows.html"), WINDOWS.replace("\\#", "#")).unwrap();
    let document = document(&browser, folder.path(), "windows.html");
    let told = document.split_once("<pre id=\"told\">").unwrap().1.split_once("</pre>").unwrap().0;
    assert!(!told.is_empty(), "the page did not get to its end");
    let told: Value = serde_json::from_str(&percent_decoded(told)).unwrap();
    let windows = told.as_array().unwrap().clone();
    assert_eq!(windows.iter().map(|window| window["width"].as_u64().unwrap()).collect::<Vec<_>>(), [1200, 360]);
    Some(windows)
}

/// What must hold in a window of any width.
fn check(window: &Value, figures: &[Figure]) {
    assert_eq!(window["errors"], serde_json::json!([]));
    assert_eq!(window["blocked"], serde_json::json!([]));
    assert_eq!(window["requests"], serde_json::json!([]));
    assert!(window["overflow"].as_f64().unwrap() <= 0.0, "{}", window["overflow"]);

    let shown = window["figures"].as_array().unwrap();
    assert_eq!(shown.len(), figures.len());
    let narrow = window["width"].as_u64().unwrap() < 700;
    for (shown, figure) in shown.iter().zip(figures) {
        let id = &figure.id;
        assert_eq!(shown["id"], id.as_str());
        let series: usize = figure.panels.iter().map(|panel| panel.series.len()).sum();
        assert_eq!(shown["traces"], series, "{id}");
        assert_eq!(shown["panels"], figure.panels.len(), "{id}");
        assert_eq!(shown["columns"], if narrow { 1 } else { figure.columns }, "{id}");
        assert_eq!(shown["clashes"], serde_json::json!([]), "{id} at {}", window["width"]);
        let bands: usize =
            figure.panels.iter().map(|panel| panel.bands.len() + panel.tiles.len() + panel.guides.len()).sum();
        assert_eq!(shown["bands"], bands, "{id}");
        let (words, legend) = (shown["words"].as_str().unwrap(), shown["legend"].to_string());
        for panel in &figure.panels {
            for axis in [&panel.x, &panel.y] {
                // A long label is broken into lines, which are joined without a space here.
                let label =
                    if axis.unit.is_empty() { axis.label.clone() } else { format!("{} [{}]", axis.label, axis.unit) };
                assert!(words.replace(' ', "").contains(&label.replace(' ', "")), "{id}: `{label}`");
            }
            let names = panel.series.iter().map(|series| &series.name).chain(panel.bands.iter().map(|band| &band.name));
            let names = names.chain(panel.tiles.iter().map(|tile| &tile.name));
            for name in names.filter(|name| !name.is_empty()) {
                assert!(legend.contains(&Value::from(name.as_str()).to_string()), "{id}: `{name}` in {legend}");
            }
        }
    }
}

/// What came of using the figure of mesh forces.
fn check_use(window: &Value) {
    let hover = window["hover"].as_str().unwrap();
    assert!(
        hover.contains("mesh force") && hover.contains(" N") && hover.contains("time") && hover.contains(" ms"),
        "{hover}"
    );

    // Dragged from a quarter to half of 20 ms, and back. A pixel is 0.1 ms on a phone.
    let [before, zoomed, reset] = ["before", "zoomed", "reset"].map(|state| &window[state]);
    assert_eq!(numbers(&before["range"]), [0.0, 20.0]);
    for (end, expected) in numbers(&zoomed["range"]).into_iter().zip([5.0, 10.0]) {
        assert!((end - expected).abs() < 0.2, "{end} for {expected}");
    }
    assert_ne!(before["ticks"], zoomed["ticks"]);
    assert_eq!(before, reset);

    let lines = numbers(&window["lines"]);
    assert_eq!(lines[1], lines[0] - 1.0, "an entry of the legend hides its series");

    let colours = window["colours"].as_array().unwrap();
    for (before, after) in colours[0].as_array().unwrap().iter().zip(colours[1].as_array().unwrap()) {
        assert_ne!(before, after);
    }
    assert_eq!(colours[0][0], "rgb(255, 255, 255)");
    assert_eq!(colours[1][1], colours[1][2], "the ink of page and pictures");
}
