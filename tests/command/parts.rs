//! Divided work: the merged files are those of an undivided run, byte for byte; damaged records are computed again; every end has its
//! exit code.

#![cfg(feature = "cli")]

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    thread::sleep,
    time::Duration,
};

const PAIR: &str = "examples/scenes/kahraman-singh.json";
const FREQUENCY: &str = "/train/transmission_error/0/frequency";

/// Commands of a few rows: what they are asked, and the file of their rows.
fn commands() -> [(String, &'static str); 5] {
    let sweep = format!("sweep {PAIR} --vary {FREQUENCY}=0.4:2:3 --vary /train/mean_load=0.02:0.3:6 --seed");
    [
        (format!("{sweep} fresh"), "sweep.journal"),
        (format!("{sweep} both"), "sweep.journal"),
        (format!("map {PAIR} --vary {FREQUENCY}=0.4:2:9 --vary /train/mean_load=0.02:0.3:7"), "map.rows"),
        (
            format!("diagram {PAIR} --vary {FREQUENCY}=0.7:0.9:6 --seed both --starts 2 --transient 60 --points 8"),
            "diagram.journal",
        ),
        // On a plane so coarse that parts find attractors that the survey has not.
        (format!("basins {PAIR} --vary /initial/q/0=-2:2:40 --vary /initial/v/0=-1:1:33"), "basins.rows"),
    ]
}

fn flank(words: &str, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_flank"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(words.split_whitespace()).args(more).output().unwrap()
}

#[track_caller]
fn ended(output: &Output, code: i32) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let said = text(&output.stdout) + &text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
    said
}

/// All files below a folder.
fn tree(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            files.extend(
                tree(&entry).into_iter().map(|(name, bytes)| (Path::new(entry.file_name().unwrap()).join(name), bytes)),
            );
        } else {
            files.insert(entry.file_name().unwrap().into(), fs::read(&entry).unwrap());
        }
    }
    files
}

#[test]
fn merged_parts_are_an_undivided_run() {
    for (words, _) in commands() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name).to_str().unwrap().to_owned();
        ended(&flank(&words, &["-q", "--out", &at("whole")]), 0);
        let survey = if words.starts_with("basins") { vec!["--survey".to_owned(), at("survey.json")] } else { vec![] };
        let survey: Vec<&str> = survey.iter().map(String::as_str).collect();
        let folders = ["0", "1", "2"].map(at);
        for (part, folder) in folders.iter().enumerate() {
            let part = format!("{part}/3");
            ended(&flank(&words, &[&survey[..], &["-q", "--part", &part, "--out", folder]].concat()), 0);
        }
        let [a, b, c] = folders.each_ref().map(String::as_str);
        // In any order; a check writes nothing.
        assert!(
            ended(&flank("merge", &[b, c, a, "--dry-run", "--out", &at("none")]), 0).contains("3 parts are complete")
        );
        assert!(!Path::new(&at("none")).exists());
        ended(&flank("merge", &[b, c, a, "-q", "--out", &at("merged")]), 0);
        assert!(tree(&place.path().join("merged")) == tree(&place.path().join("whole")), "{words}");
        // What is missing, there twice, or of other work is named.
        assert!(ended(&flank("merge", &[a, c]), 2).contains("missing of 3 parts: 1/3"));
        assert!(ended(&flank("merge", &[a, c, c]), 2).contains("part 2 is there twice"));
        assert!(ended(&flank("merge", &[a, &at("whole")]), 2).contains("part.json"));
    }
}

/// Bits that are flipped by chance in the rows of a part cost their rows, or the header is refused. Nothing else comes of them.
#[test]
fn flipped_bits_are_computed_again_or_refused() {
    let mut state = 1u64;
    let mut random = |below: usize| {
        // xorshift64 of Marsaglia (2003).
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    for (words, rows) in commands() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name).to_str().unwrap().to_owned();
        let [whole, first, second, merged] = ["whole", "0", "1", "merged"].map(at);
        let survey =
            if words.starts_with("basins") { format!(" --survey {}", at("survey.json")) } else { String::new() };
        let words = words + &survey;
        ended(&flank(&words, &["-q", "--out", &whole]), 0);
        ended(&flank(&words, &["-q", "--part", "0/2", "--out", &first]), 0);
        ended(&flank(&words, &["-q", "--part", "1/2", "--out", &second]), 0);
        let (file, whole) = (Path::new(&first).join(rows), tree(Path::new(&whole)));
        let good = fs::read(&file).unwrap();
        let head = good.iter().position(|byte| *byte == b'\n').unwrap();
        for flip in 0..6 {
            let mut bytes = good.clone();
            // Half of them behind the header.
            let place = if flip % 2 == 0 { head + 1 + random(good.len() - head - 1) } else { random(good.len()) };
            bytes[place] ^= 1 << random(8);
            fs::write(&file, &bytes).unwrap();
            let resumed = flank(&words, &["--part", "0/2", "--resume", "--out", &first]);
            if place <= head {
                ended(&resumed, 2);
                assert_eq!(fs::read(&file).unwrap(), bytes, "nothing is changed");
                continue;
            }
            // The user is told, unless the end of the last line is gone.
            assert!(ended(&resumed, 0).contains("damaged") || place + 1 == good.len());
            ended(&flank("merge", &[&first, &second, "-q", "--force", "--out", &merged]), 0);
            assert!(tree(Path::new(&merged)) == whole, "{words}: bit of byte {place}");
        }
    }
}

/// A folder in use, a signal and a time limit have codes of their own; what was done is kept.
#[cfg(unix)]
#[test]
fn every_end_has_its_code() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("map").to_str().unwrap().to_owned();
    let words = format!("map {PAIR} --vary {FREQUENCY}=0.4:2:400 --vary /train/mean_load=0.02:0.3:300 --out {out}");
    let begin = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_flank"));
        let command = command.current_dir(env!("CARGO_MANIFEST_DIR")).args(words.split_whitespace()).args(more);
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    };
    let wait = || {
        while fs::read(format!("{out}/map.rows")).map_or(0, |rows| rows.len()) < 2000 {
            sleep(Duration::from_millis(2));
        }
    };
    let signal = |child: &std::process::Child, name: &str| {
        assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
    };
    let child = begin(&[]);
    wait();
    for more in ["--resume", "--force"] {
        assert!(ended(&flank(&words, &[more]), 73).contains("another command is writing into"));
    }
    signal(&child, "-TERM");
    assert!(ended(&child.wait_with_output().unwrap(), 75).contains("--resume"));
    let kept = fs::read(format!("{out}/map.rows")).unwrap();
    assert!(ended(&flank(&words, &["--resume", "--time-limit", "0.2"]), 75).contains("--resume"));
    assert!(fs::read(format!("{out}/map.rows")).unwrap().len() > kept.len());
    // Under nohup SIGHUP is ignored.
    let mut nohup = Command::new("sh");
    let line = format!("trap '' HUP; exec {} {words} --resume", env!("CARGO_BIN_EXE_flank"));
    let nohup =
        nohup.current_dir(env!("CARGO_MANIFEST_DIR")).args(["-c", &line]).stdout(Stdio::piped()).spawn().unwrap();
    sleep(Duration::from_millis(150));
    signal(&nohup, "-HUP");
    sleep(Duration::from_millis(100));
    signal(&nohup, "-INT");
    let ended = nohup.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(75));
}

#[test]
fn points_are_counted_and_parts_planned() {
    let words = format!("sweep {PAIR} --vary {FREQUENCY}=0.4:2:3 --vary /train/mean_load=0.02:0.3:6 --seed both");
    let count = ended(&flank(&words, &["--count", "--threads", "1"]), 0);
    assert!(count.contains("36 rows in 6 chains, about ") && count.contains(" here (threads: 1)"), "{count}");
    let plan = ended(&flank(&words, &["--plan", "2", "--out", "my parts"]), 0);
    let lines: Vec<&str> = plan.lines().collect();
    assert_eq!(lines.len(), 2);
    assert!(lines[1].ends_with("--part 1/2 --resume --out 'my parts/part-1'"), "{plan}");
    // All parts use the instructions of the machine that planned them; one without these refuses.
    assert!(lines[1].contains(&format!(" --instructions {} ", flank::Instructions::best().name())), "{plan}");
    let foreign = if cfg!(target_arch = "aarch64") { "avx2" } else { "neon" };
    assert!(ended(&flank(&words, &["--instructions", foreign]), 2).contains("does not have them"));
    for wrong in ["2/2", "1", "0/0", "a/2"] {
        assert!(ended(&flank(&words, &["--part", wrong]), 2).contains("I/N is wanted"));
    }
}

/// Finished work whose files were changed or removed is computed again, with the same bytes.
#[test]
fn lost_results_are_written_again() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("map");
    let words =
        format!("map {PAIR} --vary {FREQUENCY}=0.4:2:5 --vary /train/mean_load=0.02:0.3:4 --out {}", out.display());
    ended(&flank(&words, &[]), 0);
    let whole = tree(&out);
    assert!(ended(&flank(&words, &["--resume"]), 0).contains("holds all of it"));
    for name in ["map.csv", "figures/map.svg"] {
        let text = fs::read_to_string(out.join(name)).unwrap();
        fs::write(out.join(name), text.replacen('1', "2", 1)).unwrap();
        let said = ended(&flank(&words, &["--resume"]), 0);
        assert!(said.contains("missing or changed") && said.contains(name), "{said}");
        assert!(tree(&out) == whole, "{name}");
        fs::remove_file(out.join(name)).unwrap();
        assert!(ended(&flank(&words, &["--resume"]), 0).contains(name));
        assert!(tree(&out) == whole, "{name}");
    }
}

/// Streams that are closed or full, pipes in place of scenes, and what a killed command left of its first manifest.
#[cfg(unix)]
#[test]
fn streams_and_special_files_do_no_harm() {
    let place = tempfile::tempdir().unwrap();
    let program = env!("CARGO_BIN_EXE_flank");
    let shell = |line: &str| {
        let line = line.replace("FLANK", program);
        let mut command = Command::new("timeout");
        command.args(["20", "sh", "-c", &line]).current_dir(place.path()).output().unwrap()
    };
    fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join(PAIR), place.path().join("scene.json")).unwrap();
    for (line, code) in [
        ("FLANK check scene.json >&- 2>&-", 0),
        ("FLANK check none.json >&- 2>/dev/full", 2),
        ("FLANK check scene.json 2>/dev/full >/dev/full", 74),
        ("mkfifo pipe && FLANK check pipe", 2),
        ("FLANK check /dev/zero", 2),
        ("FLANK check /", 2),
        ("mkdir -p left && echo '{ \"fla' > left/flank-manifest.json.part && FLANK check scene.json --out left", 0),
    ] {
        let said = ended(&shell(line), code);
        assert!(!said.contains("panicked"), "{line}: {said}");
    }
}

/// A run of years says so after a moment, and ends by a signal.
#[cfg(unix)]
#[test]
fn a_run_of_years_says_so() {
    let place = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(PAIR)).unwrap();
    let scene = place.path().join("scene.json");
    fs::write(&scene, text.replace("\"cycles\": 500", "\"step_budget\": 100000000000000, \"cycles\": 1000000000000"))
        .unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_flank"));
    let mut child = command.arg("run").arg(&scene).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(child.stderr.take().unwrap())).map(Result::unwrap);
    let line = lines.find(|line| line.contains("at this rate the run takes about"));
    assert!(line.is_some_and(|line| line.contains("days") || line.contains("years")));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(75));
}
