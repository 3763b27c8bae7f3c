//! `flank sound`.

use std::{fs, path::PathBuf};

use super::{
    Completion, open, print,
    progress::{cancellable, catch_interrupt, running},
    tell,
};
use crate::{
    Error,
    output::{Fault, read_text},
    plot::Theme,
    study::sound::{RATE, TransferPath, impacts, render, spectrum},
};

/// Arguments of `flank sound`.
#[derive(Debug, clap::Args)]
pub struct SoundArguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Sound file: WAV, one channel, 48 kHz, 32-bit float
    #[arg(long, value_name = "FILE", default_value = "rattle.wav")]
    out: PathBuf,
    /// Length, s, from the end of the scene's transient on
    #[arg(long, value_name = "S", default_value_t = 3.0)]
    seconds: f64,
    /// Momentum, N s, of the impact that a path of amplitude 1 makes as loud as a file can be; keep it for files to compare
    #[arg(long, value_name = "NS", default_value_t = 0.1)]
    full_scale: f64,
    /// Transfer path: a JSON file with "modes", each of frequency_hz, damping_ratio and amplitude; a placeholder if left out
    #[arg(long, value_name = "FILE")]
    path: Option<PathBuf>,
    /// Write the spectrum of the sound as SVG into this file
    #[arg(long, value_name = "FILE")]
    spectrum: Option<PathBuf>,
    /// Replace the files
    #[arg(long)]
    force: bool,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
}

/// Longest sound, s.
const LONGEST: f64 = 600.0;

/// Renders the impacts of a scene.
pub fn execute(arguments: &SoundArguments) -> Result<Completion, Error> {
    let mut faults = Vec::new();
    let mut positive = |name: &str, value: f64, most: f64| {
        if !(value > 0.0 && value <= most) {
            let fault = Fault::new(name, value.to_string(), format!("above 0, to {most}"));
            faults.push(fault.remedy("write a number in this range"));
        }
    };
    positive("--seconds", arguments.seconds, LONGEST);
    positive("--full-scale", arguments.full_scale, f64::MAX);
    for (name, file) in [("--out", Some(&arguments.out)), ("--spectrum", arguments.spectrum.as_ref())] {
        if let Some(file) = file.filter(|file| !arguments.force && file.exists()) {
            let fault = Fault::new(name, format!("{} exists", file.display()), "a file that does not");
            faults.push(fault.remedy("name another file, or add --force"));
        }
    }
    let path = match &arguments.path {
        None => TransferPath::placeholder(),
        Some(file) => {
            let name = file.display().to_string();
            let text = read_text(file).map_err(|error| Error::Unread(name.clone(), error))?;
            match serde_json::from_str::<TransferPath>(&text) {
                Ok(path) => {
                    path.check().map_err(|found| faults.extend(found)).map_or(TransferPath::placeholder(), |()| path)
                }
                Err(error) => {
                    let fault = Fault::new("--path", format!("{name}: {error}"), "a JSON object with \"modes\"");
                    faults.push(fault.remedy("see docs/SOUND.md"));
                    TransferPath::placeholder()
                }
            }
        }
    };
    if !faults.is_empty() {
        return Err(Error::Arguments(faults));
    }
    let simulation = open(arguments.scene.as_deref())?;
    let bar = running(arguments.quiet);
    let progress = |_| bar.tick();
    let working = catch_interrupt();
    let blows = impacts(&simulation, arguments.seconds, cancellable(&progress));
    drop(working);
    bar.finish_and_clear();
    let blows = blows?;
    let mut samples = render(&blows, &path, arguments.seconds);
    samples.iter_mut().for_each(|sample| *sample /= arguments.full_scale);
    write(&arguments.out, &samples)
        .map_err(|error| Error::File(arguments.out.display().to_string(), std::io::Error::other(error)))?;
    if let Some(file) = &arguments.spectrum {
        let picture = spectrum(&samples, &path).svg(Theme::Light);
        fs::write(file, picture).map_err(|error| Error::file(file.display(), error))?;
    }
    let largest = samples.iter().fold(0.0, |most: f64, sample| most.max(sample.abs()));
    let rms = (samples.iter().map(|sample| sample * sample).sum::<f64>() / samples.len().max(1) as f64).sqrt();
    let level =
        |value: f64| if value > 0.0 { format!("{:.1} dB", 20.0 * libm::log10(value)) } else { "silence".to_owned() };
    if !arguments.quiet {
        let source = if arguments.path.is_some() { "as given" } else { "a placeholder, no measured gearbox" };
        let frequencies: Vec<String> = path.modes.iter().map(|mode| format!("{} Hz", mode.frequency_hz)).collect();
        print(&format!(
            "{} impacts in {} s. RMS {}, peak {}, re full scale ({} N s).\nTransfer path: {source}; modes {}.\nWritten: {}\n",
            blows.len(),
            arguments.seconds,
            level(rms),
            level(largest),
            arguments.full_scale,
            frequencies.join(", "),
            arguments.out.display()
        ))?;
    }
    if largest > 1.0 {
        tell(&format!(
            "warning: the peak is beyond full scale; players clip it: use a --full-scale above {:.3}",
            largest * arguments.full_scale
        ));
    }
    Ok(Completion::Completely)
}

fn write(file: &std::path::Path, samples: &[f64]) -> Result<(), hound::Error> {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: RATE,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::create(file, spec)?;
    samples.iter().try_for_each(|sample| writer.write_sample(*sample as f32))?;
    writer.finalize()
}
