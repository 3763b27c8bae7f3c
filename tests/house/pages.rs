//! The pages: their links and pictures exist, their commands run and print what the pages say, their numbers come from these commands.
//!
//! A block `sh` is run in a folder with `examples`, its lines one after the other, as far as they call `flank`. Each line of the block `text`
//! below it must be printed; a block without a word is an excerpt that differs from run to run. A block `sh slow` is run with the ignored tests; else its arguments alone are read. With `FLANK_WRITE=1`
//! pictures of the gallery are written in place of compared.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// All pages, by their paths below the root.
fn pages() -> Vec<String> {
    let mut pages: Vec<String> = ["README.md", "CONTRIBUTING.md"].map(String::from).to_vec();
    for folder in ["docs", "docs/how-to", "examples/scenes"] {
        let entries = fs::read_dir(Path::new(ROOT).join(folder)).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        pages.extend(names.filter(|name| name.ends_with(".md")).map(|name| format!("{folder}/{name}")));
    }
    pages.sort();
    pages
}

fn read(page: &str) -> String {
    fs::read_to_string(Path::new(ROOT).join(page)).unwrap_or_else(|error| panic!("{page}: {error}"))
}

/// A fenced block: the words after the fence, the text, and the line it begins in.
struct Block<'p> {
    info: &'p str,
    text: String,
    line: usize,
}

/// Fenced blocks of a page, and its lines outside of them.
fn parts(page: &str) -> (Vec<Block<'_>>, Vec<&str>) {
    let (mut blocks, mut prose, mut is_open) = (Vec::<Block<'_>>::new(), Vec::new(), false);
    for (i, line) in page.lines().enumerate() {
        match (line.strip_prefix("```"), is_open) {
            (Some(info), false) => {
                blocks.push(Block { info, text: String::new(), line: i + 1 });
                is_open = true;
            }
            (Some(_), true) => is_open = false,
            (None, true) => {
                let text = &mut blocks.last_mut().unwrap().text;
                text.push_str(line);
                text.push('\n');
            }
            (None, false) => prose.push(line),
        }
    }
    assert!(!is_open, "a block is not closed");
    (blocks, prose)
}

/// The anchor of a heading: letters and digits in lower case, `-` for a space.
fn anchor(heading: &str) -> String {
    let kept = heading.trim_start_matches('#').trim().chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c.to_ascii_lowercase() }).collect()
}

/// Targets of links and pictures in a line.
fn targets(line: &str) -> impl Iterator<Item = &str> {
    line.split("](").skip(1).filter_map(|rest| rest.split(')').next())
}

#[test]
fn blocks_of_json_are_json() {
    let mut count = 0;
    for page in pages() {
        let text = read(&page);
        for block in parts(&text).0.iter().filter(|block| block.info == "json") {
            let value: Result<serde_json::Value, _> = serde_json::from_str(&block.text);
            assert!(value.is_ok(), "{page}:{}: {}", block.line, value.unwrap_err());
            count += 1;
        }
    }
    assert!(count >= 10, "{count} blocks");
}

#[test]
fn links_and_pictures_exist() {
    let (mut links, mut shown, mut wrong) = (0, BTreeSet::new(), Vec::new());
    for page in pages() {
        let text = read(&page);
        let folder = Path::new(ROOT).join(&page).parent().unwrap().to_owned();
        for target in parts(&text).1.into_iter().flat_map(targets) {
            if target.contains("://") {
                continue;
            }
            links += 1;
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let path = if file.is_empty() { Path::new(ROOT).join(&page) } else { folder.join(file) };
            let Ok(path) = path.canonicalize() else {
                wrong.push(format!("{page}: no {target}"));
                continue;
            };
            let is_there =
                || fs::read_to_string(&path).unwrap().lines().any(|l| l.starts_with('#') && anchor(l) == heading);
            if !heading.is_empty() && !is_there() {
                wrong.push(format!("{page}: no heading {target}"));
            }
            shown.insert(path);
        }
        // Files of the repository that the text names.
        for name in text.split('`').skip(1).step_by(2) {
            let is_file =
                ["src/", "tests/", "docs/", "examples/", "benches/"].iter().any(|root| name.starts_with(root));
            if is_file && !name.contains(['*', '<', ' ', '…', '{']) {
                links += 1;
                if !Path::new(ROOT).join(name.trim_end_matches('/')).exists() {
                    wrong.push(format!("{page}: no {name}"));
                }
            }
        }
    }
    for entry in fs::read_dir(Path::new(ROOT).join("docs")).unwrap() {
        let path = entry.unwrap().path().canonicalize().unwrap();
        if path.extension().is_some_and(|e| e == "svg") && !shown.contains(&path) {
            wrong.push(format!("no page shows {}", path.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(links > 300, "{links} links");
}

#[cfg(feature = "cli")]
pub mod commands {
    use std::process::Command;

    use super::*;

    /// Lines of a block that call `flank`: their arguments. Comments are left out, continued lines are joined.
    fn calls(block: &str) -> Vec<Vec<String>> {
        let joined = block.replace("\\\n", " ");
        let lines = joined.lines().map(|line| line.split(" #").next().unwrap_or(line).trim());
        let calls = lines.filter_map(|line| line.strip_prefix("flank ")).filter(|line| !line.contains('…'));
        calls.map(words).collect()
    }

    /// Words of a command line; double quotes hold one together.
    fn words(line: &str) -> Vec<String> {
        let mut words = Vec::new();
        for (i, part) in line.split('"').enumerate() {
            if i % 2 == 1 {
                words.push(part.to_owned());
            } else {
                words.extend(part.split_whitespace().map(String::from));
            }
        }
        words
    }

    /// A folder with the examples in it.
    pub fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for part in ["scenes", "scenes/measured-pair", "gearboxes", "studies"] {
            let to = folder.path().join("examples").join(part);
            fs::create_dir_all(&to).unwrap();
            for entry in fs::read_dir(Path::new(ROOT).join("examples").join(part)).unwrap().map(|entry| entry.unwrap())
            {
                if entry.path().is_file() {
                    fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
                }
            }
        }
        folder
    }

    /// Standard output and standard error of `flank`.
    fn run(arguments: &[String], folder: &Path) -> String {
        let mut flank = Command::new(env!("CARGO_BIN_EXE_flank"));
        let output = flank.args(arguments).current_dir(folder).output().unwrap();
        let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
        assert!(output.status.success(), "flank {}: {}\n{text}", arguments.join(" "), output.status);
        text
    }

    /// A number, without what encloses it in a sentence.
    fn number(word: &str) -> Option<f64> {
        word.trim_matches(|c| "(),:;".contains(c)).parse().ok()
    }

    /// Tells that two lines have the same words, and the same numbers to ten digits: the last ones differ from processor to processor.
    fn is_same(a: &str, b: &str) -> bool {
        let is_near = |a: f64, b: f64| (a - b).abs() <= 1e-10 * a.abs().max(b.abs()) || a.abs().max(b.abs()) < 1e-12;
        let (a, b): (Vec<&str>, Vec<&str>) = (a.split_whitespace().collect(), b.split_whitespace().collect());
        let same = |(a, b): (&&str, &&str)| a == b || number(a).zip(number(b)).is_some_and(|(a, b)| is_near(a, b));
        a.len() == b.len() && a.iter().zip(&b).all(same)
    }

    /// What the commands of a page print, and how many commands and lines were compared.
    fn printed(page: &str, info: &str) -> (String, usize, usize) {
        let text = read(page);
        let folder = folder();
        let (mut all, mut latest, mut commands, mut lines) = (String::new(), None, 0, 0);
        for block in parts(&text).0 {
            match block.info {
                "json" if page == "docs/TUTORIAL.md" => {
                    fs::write(folder.path().join("my-pair.json"), block.text).unwrap()
                }
                "sh" | "sh slow" => {
                    let calls = calls(&block.text);
                    latest = None;
                    if block.info == info {
                        commands += calls.len();
                        let output: String = calls.iter().map(|call| run(call, folder.path())).collect();
                        all.push_str(&output);
                        latest = Some(output);
                    } else if block.info == "sh slow" {
                        // Arguments are read up to the request for help.
                        commands += calls.len();
                        calls
                            .iter()
                            .for_each(|call| drop(run(&[&call[..], &["--help".to_owned()]].concat(), folder.path())));
                    }
                }
                "text" => {
                    let Some(output) = &latest else { continue };
                    for line in block.text.lines().filter(|line| line.trim() != "...") {
                        let is_printed = output.lines().any(|own| is_same(own, line));
                        assert!(is_printed, "{page}:{}: not printed\n{line}\nbut\n{output}", block.line);
                        lines += 1;
                    }
                }
                _ => {}
            }
        }
        (all, commands, lines)
    }

    #[test]
    fn commands_run_and_print_what_the_pages_say() {
        let (mut commands, mut lines) = (0, 0);
        for page in pages() {
            // The gallery has a test of its own.
            if page != "docs/GALLERY.md" {
                let (_, some_commands, some_lines) = printed(&page, "sh");
                (commands, lines) = (commands + some_commands, lines + some_lines);
            }
        }
        assert!(commands >= 50 && lines >= 50, "{commands} commands, {lines} lines");
    }

    #[test]
    #[ignore = "takes minutes"]
    fn slow_commands_run_and_print_what_the_pages_say() {
        let pages = pages();
        let counts = pages.iter().filter(|page| *page != "docs/GALLERY.md").map(|page| printed(page, "sh slow").1);
        let commands: usize = counts.sum();
        assert!(commands >= 5, "{commands} commands");
    }

    /// A number: its value, how many digits it has without leading zeros, and a unit of its last digit.
    fn parsed(word: &str) -> Option<(f64, usize, f64)> {
        let (mantissa, power) = word.split_once(['e', 'E']).unwrap_or((word, "0"));
        if !mantissa.starts_with(|c: char| c.is_ascii_digit()) {
            return None;
        }
        let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len() as i32);
        let digits = mantissa.chars().filter(char::is_ascii_digit).skip_while(|digit| *digit == '0').count();
        Some((word.parse().ok()?, digits, 10f64.powi(power.parse::<i32>().ok()? - decimals)))
    }

    /// Numbers of a text with three digits or more, as words.
    fn numbers(text: &str) -> Vec<&str> {
        let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || ".-+".contains(c)));
        let words = words.map(|word| word.trim_matches(|c: char| ".-+".contains(c)));
        words.filter(|word| parsed(word).is_some_and(|(_, digits, _)| digits >= 3)).collect()
    }

    /// Tells that `exact` rounds to `said` with the digits of `said`: in the same unit, a prefix of it, or per cent.
    fn rounds_to(exact: &str, said: &str) -> bool {
        let (Some((exact, ..)), Some((said, _, unit))) = (parsed(exact), parsed(said)) else { return false };
        // Half a unit of the last digit that is said, and what doubles make of it.
        [0, 2, 3, 6, 9, -3, -6, -9].iter().any(|power| (exact * 10f64.powi(*power) - said).abs() <= 0.5001 * unit)
    }

    #[test]
    fn numbers_in_the_sentences_of_a_task_come_from_its_commands() {
        let (mut checked, mut wrong) = (0, Vec::new());
        for page in pages().iter().filter(|page| page.contains("how-to/") || page.ends_with("TUTORIAL.md")) {
            let text = read(page);
            let (blocks, prose) = parts(&text);
            let mut known = printed(page, "sh").0;
            blocks.iter().for_each(|block| known.push_str(&block.text));
            // So do the numbers of the scenes that it names.
            let scenes =
                fs::read_dir(Path::new(ROOT).join("examples/scenes")).unwrap().map(|entry| entry.unwrap().path());
            let named =
                scenes.filter(|path| path.is_file() && text.contains(path.file_name().unwrap().to_str().unwrap()));
            named.for_each(|path| known.push_str(&fs::read_to_string(path).unwrap()));
            let known = numbers(&known);
            for line in prose.iter().filter(|line| !line.contains("http")) {
                // Code in a sentence is none of its numbers, nor is the target of a link.
                let plain: String = line.split('`').step_by(2).collect();
                for said in numbers(&plain).into_iter().filter(|said| *said != "1.92") {
                    checked += 1;
                    if !known.iter().any(|exact| rounds_to(exact, said)) {
                        wrong.push(format!("{page}: {said} in: {line}"));
                    }
                }
            }
        }
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
        assert!(checked >= 12, "{checked} numbers");
    }

    /// Pictures of the gallery: the page's picture, the drawn one, the commands.
    fn gallery(info: &str) -> Vec<(PathBuf, String, Vec<Vec<String>>)> {
        let page = read("docs/GALLERY.md");
        let mut pictures = Vec::new();
        for section in page.split("\n## ").skip(1) {
            let (blocks, prose) = parts(section);
            let Some(block) = blocks.iter().find(|block| block.info == info) else { continue };
            let picture = prose.iter().find(|line| line.starts_with("![")).and_then(|line| targets(line).next());
            let drawn = prose.iter().find_map(|line| line.strip_prefix('`')?.split('`').next());
            let (picture, drawn) = (picture.expect("a picture"), drawn.expect("a file"));
            pictures.push((Path::new(ROOT).join("docs").join(picture), drawn.to_owned(), calls(&block.text)));
        }
        pictures
    }

    fn draw(info: &str, least: usize) {
        let pictures = gallery(info);
        assert!(pictures.len() >= least, "{} pictures", pictures.len());
        let mut stale = Vec::new();
        for (picture, drawn, calls) in pictures {
            let folder = folder();
            calls.iter().for_each(|call| drop(run(call, folder.path())));
            let drawn = fs::read(folder.path().join(&drawn)).unwrap_or_else(|error| panic!("{drawn}: {error}"));
            if std::env::var_os("FLANK_WRITE").is_some() {
                fs::write(&picture, drawn).unwrap();
            } else if fs::read(&picture).unwrap() != drawn {
                stale.push(picture.display().to_string());
            }
        }
        assert!(stale.is_empty(), "not what the commands draw, see docs/GALLERY.md:\n{}", stale.join("\n"));
    }

    #[test]
    fn gallery_shows_what_commands_draw() {
        draw("sh", 7);
    }

    #[test]
    #[ignore = "takes minutes"]
    fn gallery_shows_what_slow_commands_draw() {
        draw("sh slow", 3);
    }

    /// Programs in `examples` print the lines that their headers show.
    #[test]
    fn examples_print_what_they_say() {
        let built = Path::new(env!("CARGO_BIN_EXE_flank")).parent().unwrap().join("examples");
        let mut lines = 0;
        for name in ["first_run", "own_observer", "own_train", "sweep", "orbit", "continuation", "map", "ensemble"] {
            let source = read(&format!("examples/{name}.rs"));
            let header: Vec<&str> = source.lines().map_while(|line| line.strip_prefix("//!")).collect();
            let shown = header.join("\n");
            let shown = shown.split("```text\n").nth(1).unwrap_or_else(|| panic!("{name}: no output is shown"));
            let program = built.join(name).with_extension(std::env::consts::EXE_EXTENSION);
            assert!(program.exists(), "build it first: cargo build --example {name}");
            let output = Command::new(program).current_dir(ROOT).output().unwrap();
            let printed = String::from_utf8(output.stdout).unwrap();
            assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
            for line in
                shown.lines().take_while(|line| !line.contains("```")).filter(|line| !line.contains("cargo run"))
            {
                if !["", "..."].contains(&line.trim()) {
                    assert!(
                        printed.lines().any(|own| is_same(own, line)),
                        "{name} does not print\n{line}\nbut\n{printed}"
                    );
                    lines += 1;
                }
            }
        }
        assert!(lines >= 16, "{lines} lines");
    }
}
