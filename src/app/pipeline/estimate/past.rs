//! What past runs measured: a file of lines in the folder of the cache, and the factors that follow from them.
//!
//! ```json
//! {"model":1,"stage":"video.track","quantity":"seconds","predicted":4.21,"measured":5.07}
//! ```
//!
//! The file is private with the cache, off with it, and as little trusted: lines that are none, of another model, or of figures that no
//! run has are passed over. It is read to a bounded length and shortened where it grows; at worst estimates are those of the
//! shipped model.
//!
//! # Fit
//! Of each kind of stage and quantity the factor is the median of the logarithms of measured over predicted, over its last runs; the
//! median passes over the one run in several that another program disturbed. What all kinds have in common, the median of their medians,
//! counts as one more run of each: one run moves its factor half of the distance, and kinds that never ran follow the rest.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::pipeline::cache::Cache;
use crate::pipeline::lines_file::{append, locked};
use crate::stages::find_in_task;

/// Version of the model's coefficients: measurements of another are of no use.
const MODEL: u32 = 1;
/// Name of the file in the folder of a cache.
pub(in crate::pipeline) const TIMES_FILE: &str = "times.jsonl";
/// Length from which on the file is shortened, and length that is read, from its end, bytes: a line has about a hundred.
const MAX_BYTES: u64 = 512 << 10;
/// Runs of a kind that count, the last ones: of fewer the median is moved by a busy hour, of more by what the machine was last year.
const MAX_RUNS: usize = 32;
/// Least and greatest figures that are taken for measured ones. Below a hundredth of a second, and a hundred bytes, a run measures the system.
const SECONDS: (f64, f64) = (0.01, 1e8);
const BYTES: (f64, f64) = (100.0, 1e15);
/// Greatest factor between model and machine; what is farther off is no figure of a run.
const MAX_FACTOR: f64 = 1e3;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    /// Wall time.
    Seconds,
    /// Size of the results.
    Bytes,
}

/// What a run measured of a kind of stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// The kind.
    pub stage: String,
    /// What was measured.
    pub quantity: Quantity,
    /// By the shipped model.
    pub predicted: f64,
    /// By the run.
    pub measured: f64,
}

impl Measurement {
    /// Both figures are of a size that says something of the machine.
    pub(super) fn is_usable(&self) -> bool {
        let (low, high) = if self.quantity == Quantity::Seconds { SECONDS } else { BYTES };
        let fits = |value: f64| value >= low && value <= high;
        let factor = self.measured / self.predicted;
        fits(self.predicted) && fits(self.measured) && factor < MAX_FACTOR && factor > 1.0 / MAX_FACTOR
    }

    /// Logarithm of measured over predicted.
    fn log_factor(&self) -> f64 {
        (self.measured / self.predicted).ln()
    }
}

/// A line of the file.
#[derive(Serialize, Deserialize)]
struct Line {
    model: u32,
    #[serde(flatten)]
    measurement: Measurement,
}

/// Adds what a run measured to the file of a cache.
///
/// # Errors
/// The system's error.
pub fn add(cache: &Cache, found: &[Measurement]) -> io::Result<()> {
    let path = cache.folder().join(TIMES_FILE);
    let mut text = String::new();
    for measurement in found {
        let line = serde_json::to_string(&Line { model: MODEL, measurement: measurement.clone() })?;
        // Writing to a string does not fail.
        let _ = writeln!(text, "{line}");
    }
    if text.is_empty() {
        return Ok(());
    }
    let (length, written) = append(&path, &text)?;
    if length + written > MAX_BYTES { shorten(&path) } else { Ok(()) }
}

/// What past runs measured, the last ones of each kind, in their order.
pub fn read(cache: &Cache) -> Vec<Measurement> {
    let path = cache.folder().join(TIMES_FILE);
    // A pipe would be waited for.
    if !path.metadata().is_ok_and(|meta| meta.is_file()) {
        return Vec::new();
    }
    File::open(path).and_then(|mut file| last_lines(&mut file)).unwrap_or_default()
}

fn last_lines(file: &mut File) -> io::Result<Vec<Measurement>> {
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(MAX_BYTES)))?;
    let mut bytes = Vec::new();
    file.take(MAX_BYTES).read_to_end(&mut bytes)?;
    let lines = bytes.split(|byte| *byte == b'\n').filter_map(|line| serde_json::from_slice::<Line>(line).ok());
    let known = lines.filter(|line| line.model == MODEL).map(|line| line.measurement);
    let mut found: Vec<Measurement> =
        known.filter(|m| m.is_usable() && find_in_task(&m.stage).is_some_and(|kind| kind.name == m.stage)).collect();
    let mut counts: BTreeMap<(String, Quantity), usize> = BTreeMap::new();
    found.reverse();
    found.retain(|m| {
        let count = counts.entry((m.stage.clone(), m.quantity)).or_default();
        *count += 1;
        *count <= MAX_RUNS
    });
    found.reverse();
    Ok(found)
}

/// Keeps the lines that count, and of those as many of the last as fit half of the file.
fn shorten(path: &Path) -> io::Result<()> {
    let mut held = locked(path)?;
    let kept = last_lines(&mut held)?;
    let lines: Vec<String> = kept
        .into_iter()
        .map(|measurement| serde_json::to_string(&Line { model: MODEL, measurement }))
        .collect::<Result<_, _>>()?;
    let mut left = MAX_BYTES / 2;
    let fits = |line: &&String| {
        let bytes = line.len() as u64 + 1;
        left.checked_sub(bytes).inspect(|rest| left = *rest).is_some()
    };
    let mut kept: Vec<&String> = lines.iter().rev().take_while(fits).collect();
    kept.reverse();
    let mut out = tempfile::NamedTempFile::new_in(path.parent().unwrap_or(Path::new(".")))?;
    kept.iter().try_for_each(|line| writeln!(out, "{line}"))?;
    out.persist(path).map_err(|e| e.error)?;
    drop(held);
    Ok(())
}

/// Factors by which a machine differs from the shipped model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Calibration {
    factors: BTreeMap<(String, Quantity), f64>,
    /// Of kinds without a run, by quantity.
    others: BTreeMap<Quantity, f64>,
    /// Measurements that they follow from.
    count: usize,
    /// Half of the measurements of time are within this factor of what the model says of them with its factors.
    spread: Option<f64>,
}

impl Calibration {
    /// The fit to past runs, which may be none.
    pub fn of(past: &[Measurement]) -> Self {
        let mut logs: BTreeMap<(String, Quantity), Vec<f64>> = BTreeMap::new();
        for m in past.iter().filter(|m| m.is_usable()) {
            logs.entry((m.stage.clone(), m.quantity)).or_default().push(m.log_factor());
        }
        let mut fit = Self { count: logs.values().map(Vec::len).sum(), ..Self::default() };
        for quantity in [Quantity::Seconds, Quantity::Bytes] {
            let of_quantity = || logs.iter().filter(move |((_, q), _)| *q == quantity);
            // The machine that was measured counts as one more kind.
            let medians = of_quantity().map(|(_, logs)| median(logs.clone()));
            let common = median(medians.chain([0.0]).collect());
            fit.others.insert(quantity, common.exp());
            for (of, logs) in of_quantity() {
                let with_common = logs.iter().copied().chain([common]).collect();
                fit.factors.insert(of.clone(), median(with_common).exp());
            }
        }
        let seconds = past.iter().filter(|m| m.quantity == Quantity::Seconds && m.is_usable());
        let off: Vec<f64> = seconds.map(|m| (m.log_factor() - fit.factor(&m.stage, m.quantity).ln()).abs()).collect();
        fit.spread = (!off.is_empty()).then(|| median(off).exp());
        fit
    }

    /// Measured over predicted, of a kind of stage.
    pub fn factor(&self, stage: &str, quantity: Quantity) -> f64 {
        let known = self.factors.get(&(stage.to_owned(), quantity)).or_else(|| self.others.get(&quantity));
        known.copied().unwrap_or(1.0)
    }

    /// Number of measurements.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The factor within which the fit has half of the measured times; `None` without any.
    pub fn spread(&self) -> Option<f64> {
        self.spread
    }
}

/// Of an even number the mean of the middle two; 0 of none.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => 0.0,
        n if n % 2 == 1 => values[middle],
        _ => f64::midpoint(values[middle - 1], values[middle]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(stage: &str, predicted: f64, measured: f64) -> Measurement {
        Measurement { stage: stage.to_owned(), quantity: Quantity::Seconds, predicted, measured }
    }

    fn cache() -> (tempfile::TempDir, Cache) {
        let folder = tempfile::tempdir().expect("a folder");
        let cache = Cache::open(folder.path(), true).expect("a cache");
        (folder, cache)
    }

    #[test]
    fn factors_are_medians_that_one_run_moves_by_half() {
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
        let none = Calibration::default();
        assert_eq!((none.factor("video.track", Quantity::Seconds), none.count(), none.spread()), (1.0, 0, None));
        let one = Calibration::of(&[seconds("video.track", 1.0, 16.0)]);
        assert!(near(one.factor("video.encode", Quantity::Seconds), 4.0), "{one:?}");
        assert!(near(one.factor("video.track", Quantity::Seconds), 8.0), "{one:?}");
        assert!(near(one.factor("video.track", Quantity::Bytes), 1.0), "{one:?}");
        // Of several, one that was disturbed changes little.
        let mut runs = vec![seconds("video.track", 2.0, 4.0); 9];
        runs.push(seconds("video.track", 2.0, 400.0));
        let fit = Calibration::of(&runs);
        assert!(near(fit.factor("video.track", Quantity::Seconds), 2.0), "{fit:?}");
        assert!(near(fit.spread().expect("runs"), 1.0), "{fit:?}");
    }

    #[test]
    fn runs_are_found_again_the_last_ones_of_each_kind() {
        let (_folder, cache) = cache();
        assert_eq!(read(&cache), []);
        add(&cache, &[]).expect("nothing");
        for run in 0..MAX_RUNS + 3 {
            let track = seconds("video.track", 1.0, 1.0 + run as f64);
            add(&cache, &[track, seconds("video.encode", 2.0, 3.0)]).expect("written");
        }
        let found = read(&cache);
        assert_eq!(found.len(), 2 * MAX_RUNS);
        assert_eq!(found[0].measured, 4.0);
    }

    #[test]
    fn what_is_no_measurement_is_passed_over() {
        let (folder, cache) = cache();
        let path = folder.path().join(TIMES_FILE);
        let line = |text: &str| format!("{{\"model\":1,{text}}}\n");
        let good = line(r#""stage":"video.track","quantity":"seconds","predicted":1.0,"measured":2.0"#);
        let mut text = [
            "\u{0}\u{1}".to_owned(),
            "{".to_owned(),
            "[".repeat(100_000),
            line(r#""stage":"no.such","quantity":"seconds","predicted":1.0,"measured":2.0"#),
            line(r#""stage":"video.track","quantity":"seconds","predicted":1e-300,"measured":2.0"#),
            line(r#""stage":"video.track","quantity":"seconds","predicted":-1.0,"measured":2.0"#),
            line(r#""stage":"video.track","quantity":"seconds","predicted":1.0,"measured":1e300"#),
            line(r#""stage":"video.track","quantity":"hours","predicted":1.0,"measured":2.0"#),
            good.replace("\"model\":1", "\"model\":7"),
            good.clone(),
            good.trim_end()[..40].to_owned(),
        ]
        .join("\n");
        std::fs::write(&path, &text).expect("written");
        assert_eq!(read(&cache), [seconds("video.track", 1.0, 2.0)]);
        // Behind half a line the next one begins anew.
        add(&cache, &[seconds("video.encode", 1.0, 3.0)]).expect("written");
        assert_eq!(read(&cache).len(), 2);
        // A long file is read from its end, and shortened.
        text.push_str(&good.repeat(20_000));
        std::fs::write(&path, &text).expect("written");
        assert_eq!(read(&cache).len(), MAX_RUNS);
        add(&cache, &[seconds("video.encode", 1.0, 3.0)]).expect("written");
        assert!(path.metadata().expect("there").len() < 10_000);
        assert_eq!(read(&cache).len(), MAX_RUNS + 1);
        cache.clear().expect("removed");
        assert!(!path.exists());
        std::fs::create_dir(&path).expect("a folder in its name");
        assert_eq!(read(&cache), []);
        assert!(add(&cache, &[seconds("video.encode", 1.0, 3.0)]).is_err());
    }
}
