//! How long a task takes and what it stores: a model shipped with the program, and what past runs say of it.
//!
//! The model is linear in what is known before the work. With `F` frames, `M` megapixels of a picture, `V` thousand vertices and
//! `S` shapes made of them, a stage takes on one thread
//!
//! ```text
//! t = a + F·(b + c·M) + d·M + V·(e + f·S)
//! ```
//!
//! seconds, of which a part `p` is divided by the threads. The coefficients of each kind are in `model.rs`, measured; what stores results has
//! others in bytes. So the estimate of a plan follows from the pipeline and its inputs alone.
//!
//! A machine is faster or slower than the one that was measured, and not by the same factor in all it does. [`Calibration`] has one factor
//! per kind of stage and quantity: the median of measured over predicted, of the runs that [`past`] holds.

mod makespan;
mod model;
pub mod past;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::batch::Instance;
use super::memory::ClipShape;
use super::plan::temporary_space;
use super::summary::Summary;
use crate::stages::kept::RESULTS;

pub use makespan::makespan;
pub use past::{Calibration, Measurement, Quantity};

/// What the time of a job depends on, as far as it is known before the work; 0 for what it has not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WorkSize {
    /// Frames of the clip.
    pub frames: f64,
    /// Megapixels of a frame, or of the picture.
    pub megapixels: f64,
    /// Thousands of vertices of the meshes.
    pub kilovertices: f64,
    /// Shapes that are made of them: frames of an animation.
    pub shapes: f64,
}

/// What a task is expected to take.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Wall time on the threads of the task, s.
    pub seconds: f64,
    /// Space for results and temporary files, MB.
    pub disk_mb: f64,
    /// What the figures follow from.
    pub work: WorkSize,
    /// Seconds by kind of stage.
    pub stages: BTreeMap<String, f64>,
}

/// Seconds and megabytes as a plan states them: a hundredth is less than a task takes to start.
fn rounded(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}

impl Estimate {
    /// By the shipped model, for `threads` threads.
    pub fn of(instance: &Instance, work: &WorkSize, threads: usize) -> Self {
        let mut stages: BTreeMap<String, f64> = BTreeMap::new();
        let mut bytes = temporary_bytes(instance, work) as f64;
        for (stage, cost) in model::costs(&instance.graph, work) {
            *stages.entry(stage.kind.name.to_owned()).or_default() += cost.seconds(threads);
            bytes += cost.bytes;
        }
        for seconds in stages.values_mut() {
            *seconds = rounded(*seconds);
        }
        stages.retain(|_, seconds| *seconds > 0.0);
        let seconds = rounded(model::START_S + stages.values().sum::<f64>());
        Self { seconds, disk_mb: rounded(bytes / 1e6), work: *work, stages }
    }

    /// Of a task that joins the parts of a clip, of which `whole` is the estimate at once: encoded pictures are copied.
    pub fn of_joining(whole: &Self) -> Self {
        let seconds = rounded(model::START_S + model::JOIN_S * whole.work.frames);
        Self { seconds, stages: BTreeMap::new(), ..whole.clone() }
    }
}

/// Bytes of the temporary files of a clip.
fn temporary_bytes(instance: &Instance, work: &WorkSize) -> u64 {
    let frames = (work.frames > 0.0).then_some(work.frames as u64);
    let clip = ClipShape { width: (1e6 * work.megapixels) as u32, height: 1, frame_bytes: 0, frames };
    frames.map_or(0, |_| temporary_space(&instance.graph, &clip))
}

/// What a run that ended well says of the model: seconds of each kind of stage that computed its result, and bytes of what it wrote.
///
/// Results from the cache say nothing of the time that they take, and a clip that is cut short nothing of its own.
pub fn measurements(instance: &Instance, work: &WorkSize, threads: usize, summary: &Summary) -> Vec<Measurement> {
    if summary.cut_short || summary.up_to_date {
        return Vec::new();
    }
    let is_cached =
        |kind: &str| RESULTS.iter().any(|r| r.stage == kind && summary.cached.iter().any(|name| name == r.name));
    let mut predicted: BTreeMap<(&str, Quantity), f64> = BTreeMap::new();
    let mut measured: BTreeMap<(&str, Quantity), f64> = BTreeMap::new();
    for (stage, cost) in model::costs(&instance.graph, work) {
        let kind = stage.kind.name;
        *predicted.entry((kind, Quantity::Seconds)).or_default() += cost.seconds(threads);
        if cost.bytes > 0.0 {
            *predicted.entry((kind, Quantity::Bytes)).or_default() += cost.bytes;
            let sizes =
                stage.settings.writes().into_iter().filter_map(|path| super::paths::to_path(&path).metadata().ok());
            *measured.entry((kind, Quantity::Bytes)).or_default() += sizes.map(|meta| meta.len() as f64).sum::<f64>();
        }
    }
    for (kind, seconds) in summary.stage_seconds.iter().filter(|(kind, _)| !is_cached(kind)) {
        measured.insert((kind.as_str(), Quantity::Seconds), *seconds);
    }
    let both = predicted.into_iter().filter_map(|(of, predicted)| {
        let (stage, quantity) = of;
        let measured = *measured.get(&of)?;
        Some(Measurement { stage: stage.to_owned(), quantity, predicted, measured })
    });
    both.filter(Measurement::is_usable).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::{read, shipped};

    fn instance(name: &str) -> Instance {
        let source = shipped::find_source(name).expect("shipped");
        let pipeline = read(source, &["batch.foreach=item.x".to_owned()]).expect("no faults");
        pipeline.instances().expect("one item").remove(0)
    }

    /// A clip, a photo and a mesh at once: each kind of stage takes what it knows.
    const WORK: WorkSize = WorkSize { frames: 300.0, megapixels: 2.0, kilovertices: 20.0, shapes: 4.0 };

    #[test]
    fn every_shipped_pipeline_has_an_estimate_that_grows_with_its_work() {
        for (name, _) in shipped::SHIPPED {
            let instance = instance(name);
            let estimate = Estimate::of(&instance, &WORK, 1);
            assert!(estimate.seconds > 0.1 && estimate.disk_mb > 0.0, "{name}: {estimate:?}");
            assert_eq!(Estimate::of(&instance, &WORK, 1), estimate, "the same each time");
            let WorkSize { frames, megapixels, kilovertices, shapes } = WORK;
            let twice = WorkSize {
                frames: 2.0 * frames,
                megapixels: 2.0 * megapixels,
                kilovertices: 2.0 * kilovertices,
                shapes,
            };
            assert!(Estimate::of(&instance, &twice, 1).seconds > estimate.seconds, "{name}");
            assert!(Estimate::of(&instance, &WORK, 2).seconds <= estimate.seconds, "{name}");
            assert!(Estimate::of(&instance, &WorkSize::default(), 1).seconds < estimate.seconds, "{name}");
        }
    }

    #[test]
    fn a_run_measures_what_it_computed() {
        let instance = instance("stabilize");
        let seconds = [("video.track", 2.0), ("video.motion", 3.0), ("video.encode", 5.0), ("other", 1.0)];
        let mut summary = Summary {
            cached: vec!["tracks".to_owned()],
            stage_seconds: seconds.map(|(kind, s)| (kind.to_owned(), s)).into(),
            ..Summary::default()
        };
        let found = measurements(&instance, &WORK, 2, &summary);
        let kinds: Vec<&str> = found.iter().map(|m| m.stage.as_str()).collect();
        assert_eq!(kinds, ["video.encode", "video.motion"], "no tracks: they came from the cache");
        summary.cut_short = true;
        assert_eq!(measurements(&instance, &WORK, 2, &summary), []);
    }
}
